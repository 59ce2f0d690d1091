"""Bounds of the core without the folder: a wider gap, and never above a design."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import laufruhe
from extensions.removed_folder import run, without
from lanes import first_fast
from problem_files import PROBLEMS

SOLVED = """
import json, sys, laufruhe
found = laufruhe.solve(sys.argv[1])
print(json.dumps((found.objective.value, found.certificate.lower_bound)))
"""
READY = {"powertrain-joined-springs": 2e-3, "powertrain-hydraulic": 1e-4, "powertrain-least-force": 1.0}
"""Ready problems of three, four and nine open stiffnesses, and the gap that boxes of the core leave."""


@pytest.mark.parametrize("name", first_fast(READY, 0, 2))
def test_bounds_are_wider_and_hold(name: str, tmp_path: Path) -> None:
    path = PROBLEMS / f"{name}.toml"
    done = run(without(["mount_relaxation"], tmp_path / "site"), "-c", SOLVED, path)
    assert done.returncode == 0, done.stderr
    value, bound = json.loads(done.stdout)
    result = laufruhe.solve(path)
    assert result.objective is not None
    assert result.certificate is not None
    assert value == pytest.approx(result.objective.value, rel=1e-6)
    assert bound <= result.objective.value * (1.0 + 1e-9)
    assert (1.0 - READY[name]) * value <= bound
    assert result.certificate.lower_bound >= bound * (1.0 - result.problem.tolerance)
    assert result.certificate.gap <= 0.1 * (1.0 + 1e-9)
