"""Open length of rods without the folder, a number like any other."""

from __future__ import annotations

from pathlib import Path

import pytest

from extensions.removed_folder import run, without
from problem_files import PROBLEMS

SOLVE = """
import laufruhe, sys
result = laufruhe.solve(sys.argv[1])
(one,), (decision,) = result.decisions, result.problem.decisions
print(result.status, one.name, f"{one.value:.4g}", decision.kind.name)
"""


@pytest.mark.slow
def test_an_open_rod_is_decided_by_local_programs(tmp_path: Path) -> None:
    ready = (PROBLEMS / "single-rod-length.toml").read_text(encoding="utf-8")
    plain = ready[: ready.index("[running_gear]")] + '[objective]\nminimise = "mean shaking force"\n'
    environment, file = without(["sizes"], tmp_path / "site"), tmp_path / "rod.toml"
    file.write_text(plain, encoding="utf-8")
    solved = run(environment, "-c", SOLVE, file)
    # the longest rod has the least force of second order
    assert solved.stdout.split() == ["feasible", "engine.rod_length", "0.3", "number"], solved.stderr
