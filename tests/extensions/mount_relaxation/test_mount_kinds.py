"""Bounds by spring forces: hydraulic mounts, damping that follows stiffness, several springs in one place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.problem.problem import Problem
from mounts.bounds_seen import designs
from mounts.files import BLOCK, ENGINE, problem_of
from mounts.test_hydraulic_mounts import HYDRAULIC
from mounts.test_springs_of_a_place import FOLLOWING, OPEN_PAD, RMS
from prove.test_subdivision import boxes


def ratio(problem: Problem, low: np.ndarray, high: np.ndarray) -> float:
    """Return the bound of a box over the least design found in it."""
    minimum = min(designs(problem, low, high, 1))
    return SdpRelaxation(problem, 1.2 * minimum, 1e-4, problem.start).bound(low, high)[0] / minimum


KINDS = {"damping that follows": FOLLOWING, "hydraulic": HYDRAULIC, "joined": OPEN_PAD}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_bounds_know_every_kind_of_mount(kind: str, tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, KINDS[kind], RMS)
    ratios = [ratio(problem, *ends) for ends in zip(*boxes(problem, 3, 7), strict=True)]
    assert max(ratios) <= 1.0 + 1e-9
    assert max(ratios) > 0.98
