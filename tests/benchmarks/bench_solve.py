"""Start-up, solve and re-solve, each beside something that a reader knows, in one run.

Writes results/benchmarks/solve.md. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
from pages import PAGES, ROOT, processor_seconds, publish

from laufruhe import load
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.cores import ONE_THREAD
from laufruhe.problem.problem import Problem
from laufruhe.solvers.cones import conic
from laufruhe.solvers.cones.conic import solve_cones

PROBLEMS = ROOT / "problems"
PROBLEM = PROBLEMS / "tractor-four-lanchester.toml"
CHECKED = ("tractor-four-lanchester", "powertrain-torque-roll", "inline-five-open")
SOLVED = ("tractor-four-lanchester", "tractor-single", "boxer-four", "inline-five", "worked-diesel")
OUT = PAGES / "solve.md"

Times = tuple[float, float]
"""Seconds of a processor, and until the end."""
Row = tuple[str, Times, str, Times]

READS = "import numpy, typer; from pydantic import BaseModel"
DECIDES = f"import clarabel, jinja2, rich.console, rich.table, xlsxwriter; {READS}"
DRAWS = f"import matplotlib.figure, matplotlib.backends.backend_agg, matplotlib.backends.backend_svg; {DECIDES}"
"""Libraries that a command ends with, bare."""
NAMES = {
    READS: "imports of numpy, typer, pydantic",
    DECIDES: "the same, clarabel, jinja2, rich, xlsxwriter",
    DRAWS: "the same, matplotlib",
}


def seconds(command: list[str], compiled: str) -> Times:
    """Return the times of a command in an empty folder; its modules are compiled, as installed ones are."""
    around = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | ONE_THREAD
    with tempfile.TemporaryDirectory() as folder:
        start, began = processor_seconds(), time.perf_counter()
        subprocess.run(
            command, check=True, cwd=folder, capture_output=True, env=around | {"PYTHONPYCACHEPREFIX": compiled}
        )  # fmt: skip
        return processor_seconds() - start, time.perf_counter() - began


def in_turns(package: Callable[[], Times], other: Callable[[], Times], repeats: int) -> tuple[Times, Times]:
    """Return the medians of two things measured in turns, so that both see the same machine."""
    package(), other()
    pairs = [(package(), other()) for _ in range(repeats)]
    return middle([a for a, _ in pairs]), middle([b for _, b in pairs])


def middle(runs: list[Times]) -> Times:
    """Return the medians of both times."""
    return statistics.median(a for a, _ in runs), statistics.median(b for _, b in runs)


def command_rows() -> list[Row]:
    """Return the whole commands against bare imports, both with one thread."""
    python, laufruhe = sys.executable, [sys.executable, "-m", "laufruhe"]
    checked, solved = ([str(PROBLEMS / f"{name}.toml") for name in names] for names in (CHECKED, SOLVED))
    pairs = [
        ([*laufruhe, "--help"], "import typer"),
        *(([*laufruhe, "check", file], READS) for file in checked),
        *(([*laufruhe, "solve", "--no-plots", file], DECIDES) for file in solved),
        *(([*laufruhe, "solve", file], DRAWS) for file in solved),
        ([*laufruhe, "solve", str(PROBLEM)], "import cvxpy, matplotlib.pyplot"),
    ]
    rows = []
    with tempfile.TemporaryDirectory() as compiled:
        for command, imports in pairs:
            package, other = (partial(seconds, words, compiled) for words in (command, [python, "-c", imports]))
            a, b = in_turns(package, other, 7)
            rows.append(
                (" ".join(["laufruhe", *(Path(word).name for word in command[3:])]), a, NAMES.get(imports, imports), b)
            )
    return rows


def resolve_rows() -> list[Row]:
    """Return the re-solves of a sweep over speed against the cone solver's own time on the same programs."""
    problem = load(PROBLEM)
    rows = []
    for samples in (72, 180, 720):
        sweep = [at_speed(problem, samples, factor) for factor in np.linspace(0.6, 1.0, 25)]
        solve_cones(sweep[0])
        start, began = time.process_time(), time.perf_counter()
        for affine in sweep:
            solve_cones(affine)
        package = (time.process_time() - start) / len(sweep), (time.perf_counter() - began) / len(sweep)
        # Clarabel tells its clock alone
        with patch.object(conic, "newton_solution", lambda _: None):
            inside = sum(solve_cones(affine).solver_seconds for affine in sweep)
        rows.append((f"re-solve at {samples} angles", package, "Clarabel alone", (math.nan, inside / len(sweep))))
    return rows


def duration_text(value: float, digits: int) -> str:
    """Return a number; a dash where none was measured."""
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def at_speed(problem: Problem, samples: int, factor: float) -> AffineProblem:
    """Return the problem at another speed in forces over speed squared."""
    point = replace(problem.points[0], speed=factor * problem.points[0].speed)
    rated = AffineModel(problem).at(samples)
    slower = AffineModel(replace(problem, points=(point,))).at(samples)
    terms = tuple(
        (weight, replace(norm, constant=other.constant / factor**2))
        for (weight, norm), (_, other) in zip(rated.terms, slower.terms, strict=True)
    )
    return replace(rated, terms=terms)


def main() -> None:
    """Measure and write the table."""
    lines = [
        "# Start-up, solve, re-solve",
        "",
        "Medians of runs taken in turns on one machine: milliseconds of processors, and milliseconds until it is done.",
        "`solve` reads, solves, proves, and writes its report and pictures; beside each command stands an interpreter",
        "that imports the libraries that the command ends with, no more. Both use one thread.",
        "The re-solves are of `problems/tractor-four-lanchester.toml`.",
        "",
        "| what | ms of processors | ms | beside | ms of processors | ms | ratio of processors | ratio |",
        "| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {name} | {1e3 * package[0]:.1f} | {1e3 * package[1]:.1f} | {rival} | {duration_text(1e3 * other[0], 1)} "
        f"| {1e3 * other[1]:.1f} | {duration_text(package[0] / other[0], 2)} | {package[1] / other[1]:.2f} |"
        for name, package, rival, other in (*command_rows(), *resolve_rows())
    ]
    text = "\n".join(lines) + "\n"
    publish(OUT, text)


if __name__ == "__main__":
    main()
