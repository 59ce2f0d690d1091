"""Cranks without the folder: few stars are decided by lists, longer cranks are refused by one line."""

from __future__ import annotations

from pathlib import Path

import pytest

import laufruhe
from extensions.removed_folder import run, without
from phasing import engines
from problem_files import PROBLEMS


@pytest.mark.slow
def test_long_cranks_are_refused_and_short_ones_decided(tmp_path: Path) -> None:
    engines.problem(tmp_path, 12, rest=engines.MOUNTS + engines.MOUNT_FORCE)
    (file,) = tmp_path.glob("*.toml")
    laufruhe.load(file)
    environment = without(["long_cranks"], tmp_path / "site")
    refused = run(environment, "-m", "laufruhe", "check", file)
    assert refused.returncode == 2
    (line,) = (refused.stderr + refused.stdout).strip().splitlines()
    assert "needs the extension 'long_cranks'" in line
    ready = PROBLEMS / "vee-twenty-open.toml"
    solved = run(environment, "-c", f"import laufruhe; print(laufruhe.solve('{ready}').objective.value)")
    objective = laufruhe.solve(ready).objective
    assert objective is not None
    assert float(solved.stdout) == objective.value
