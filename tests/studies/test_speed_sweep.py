"""A sweep over speed is the same as solving every speed alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from laufruhe import load
from laufruhe.errors import ModelError, SolverError
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.measure import Limit, Measure
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


def test_limit_holds_at_every_speed() -> None:
    problem = load(PROBLEM)
    mass = Measure(channels.BALANCER_MASS, NORMS["mean"])
    limited = replace(problem, limits=(Limit("mass", mass, 0.5),))
    rated = problem.points[0].speed
    tight, free = (speed_sweep(p, [0.7 * rated, rated]) for p in (limited, replace(problem, limits=())))
    assert all(a.force > 1.01 * b.force for a, b in zip(tight, free, strict=True))
    assert all(a.lower_bound <= a.force * (1.0 + 1e-9) for a in tight)


def test_several_operating_points_are_refused() -> None:
    problem = load(PROBLEM)
    with pytest.raises(ModelError, match="one operating point"):
        speed_sweep(replace(problem, points=problem.points * 2), [100.0])


def test_a_limit_that_no_design_meets_is_an_error() -> None:
    problem = load(PROBLEM)
    force = Limit("force", problem.objective[0].quantity, 1.0)
    with pytest.raises(SolverError, match="no design at 100"):
        speed_sweep(replace(problem, limits=(force,)), [100.0])
