"""Engines rebuilt at equal power."""

from __future__ import annotations

from dataclasses import replace

import pytest

from laufruhe import load
from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import solve
from laufruhe.studies.equal_power import at_equal_power, equal_power_scale
from laufruhe.studies.scenes import with_shafts
from problem_files import PROBLEMS


def test_rebuilt_engine_has_the_forces_of_eq_23() -> None:
    """Evaluated anew, forces follow 1/z: gas and inertia alike (eq. 23)."""
    for name in ("tractor-two.toml", "tractor-three.toml", "tractor-six.toml", "vee-six-60.toml"):
        problem = load(PROBLEMS / name)
        rebuilt = at_equal_power(problem, 4)
        force = equal_power_scale(len(problem.engine.slider_cranks), 4).length ** 2
        expected = force * objective_value(problem, evaluate(problem))
        assert objective_value(rebuilt, evaluate(rebuilt)) == pytest.approx(expected, rel=1e-9)


def test_rebuilt_optimum_scales_too() -> None:
    """Bounds and gains were rebuilt with the engine, so the optimum is the same design."""
    problem = load(PROBLEMS / "tractor-three.toml")
    first, second = solve(problem), solve(at_equal_power(problem, 4))
    assert first.objective is not None
    assert second.objective is not None
    assert second.objective.value == pytest.approx(first.objective.value * 4.0 / 3.0, rel=1e-4)


def test_equal_power_refuses_unlike_cylinders() -> None:
    problem = load(PROBLEMS / "tractor-two.toml")
    a, b = problem.engine.slider_cranks
    engine = replace(problem.engine, slider_cranks=(a, replace(b, crank_radius=0.9 * b.crank_radius)))
    with pytest.raises(ModelError, match="bore or stroke"):
        at_equal_power(replace(problem, engine=engine), 4)


def test_unknown_shafts_are_refused() -> None:
    with pytest.raises(ModelError, match="no balancer shaft"):
        with_shafts(load(PROBLEMS / "tractor-four-lanchester-and-moment.toml"), ("third",))
