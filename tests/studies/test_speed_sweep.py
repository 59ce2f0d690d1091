"""A sweep over speed is the same as solving every speed alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from laufruhe import load
from laufruhe.errors import ModelError
from laufruhe.numerics.mixed_norms import Norm
from laufruhe.problem.model import Limit
from laufruhe.problem.quantity import Quantity, Subject
from laufruhe.solvers import solve
from laufruhe.studies.speed_sweep import speed_sweep

PROBLEM = Path(__file__).resolve().parents[2] / "problems" / "tractor-four-lanchester.toml"


def test_sweep_meets_single_solves() -> None:
    problem = replace(load(PROBLEM), limits=())
    rated = problem.points[0].speed
    points = speed_sweep(problem, [0.5 * rated, 0.8 * rated, rated])
    for point in points:
        assert -1e-9 <= (point.force - point.lower_bound) / point.force < 1e-3
        alone = solve(replace(problem, points=(replace(problem.points[0], speed=point.speed),)))
        assert alone.objective is not None
        assert point.force == pytest.approx(alone.objective.value, rel=2e-4)


def test_limits_are_refused() -> None:
    problem = load(PROBLEM)
    limit = Limit("mass", Quantity(Subject.BALANCER_MASS, Norm.SUM), 1.0)
    with pytest.raises(ModelError, match="loads alone"):
        speed_sweep(replace(problem, limits=(limit,)), [100.0])
