"""Results of ready problems, each worked out once in a run of the tests, whichever process needs it first."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cloudpickle

from laufruhe.files.reader import load
from laufruhe.present.tables import Table
from laufruhe.report.tables import number_tables
from laufruhe.solvers import Result, evaluate_only, solve
from problem_files import PROBLEMS
from shared import once


@cache
def solved(name: str) -> Result:
    """Return the result of a ready problem."""

    def fill(folder: Path) -> None:
        (folder / "result").write_bytes(cloudpickle.dumps(solve(load(PROBLEMS / f"{name}.toml"))))

    found: Result = cloudpickle.loads((once(f"solved-{name}", fill) / "result").read_bytes())
    return found


@cache
def initial_tables(name: str) -> tuple[Result, dict[str, Table]]:
    """Return the design as given of a ready problem, and its tables of numbers."""

    def fill(folder: Path) -> None:
        result = evaluate_only(load(PROBLEMS / f"{name}.toml"))
        (folder / "tables").write_bytes(cloudpickle.dumps((result, number_tables(result))))

    found: tuple[Result, dict[str, Table]]
    found = cloudpickle.loads((once(f"tables-{name}", fill) / "tables").read_bytes())
    return found
