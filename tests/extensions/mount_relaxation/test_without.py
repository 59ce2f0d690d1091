"""Without the folder boxes of the core bound the same designs: a wider gap, and never over the value."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import laufruhe
from extensions.test_removal import run, without
from problem_files import PROBLEMS

SOLVED = """
import json, sys, laufruhe
for path in sys.argv[1:]:
    found = laufruhe.solve(path)
    print(json.dumps((found.objective.value, found.certificate.lower_bound)))
"""
READY = {"powertrain-joined-springs": 2e-3, "powertrain-hydraulic": 1e-4, "powertrain-least-force": 1.0}
"""Ready problems of three, four and nine open stiffnesses, and the gap that boxes of the core leave."""


@pytest.mark.slow
def test_bounds_are_wider_and_hold(tmp_path: Path) -> None:
    files = [PROBLEMS / f"{name}.toml" for name in READY]
    done = run(without("mount_relaxation", tmp_path / "site"), "-c", SOLVED, *files)
    assert done.returncode == 0, done.stderr
    for path, gap, line in zip(files, READY.values(), done.stdout.splitlines(), strict=True):
        value, bound = json.loads(line)
        found = laufruhe.solve(path)
        assert found.objective is not None
        assert found.certificate is not None
        assert value == pytest.approx(found.objective.value, rel=1e-6)
        assert bound <= found.objective.value * (1.0 + 1e-9)
        assert (1.0 - gap) * value <= bound
        assert found.certificate.lower_bound >= bound * (1.0 - found.problem.tolerance)
        assert found.certificate.gap <= 0.1 * (1.0 + 1e-9)
