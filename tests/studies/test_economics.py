"""Fronts of shaft mass, equal power rebuilt, and tolerances."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from laufruhe import load
from laufruhe.errors import ModelError
from laufruhe.machine.similarity import equal_power_scale
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import solve
from laufruhe.studies.economics import front, fronts, shafts_of, with_shafts
from laufruhe.studies.equal_power import at_equal_power

PROBLEMS = Path(__file__).resolve().parents[2] / "problems"
FOUR = PROBLEMS / "tractor-four-lanchester-and-moment.toml"
LIMITS = (0.0, 0.5, 1.0, 2.0, 4.0)


def test_rebuilt_engine_has_the_forces_of_eq_23() -> None:
    """Evaluated anew, forces follow 1/z: gas and inertia alike (eq. 23)."""
    for name in ("tractor-two.toml", "tractor-three.toml", "tractor-six.toml", "vee-six-60.toml"):
        problem = load(PROBLEMS / name)
        rebuilt = at_equal_power(problem, 4)
        force = equal_power_scale(len(problem.engine.slider_cranks), 4).force
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


def test_front_falls_and_is_proven() -> None:
    problem = load(FOUR)
    points = front(problem, LIMITS)
    forces = [point.force for point in points]
    assert all(b <= a * (1.0 + 1e-6) for a, b in pairwise(forces))
    for point in points:
        assert point.mass <= point.mass_limit + 1e-6
        assert -1e-6 <= point.gap < 1e-3


def test_no_mass_is_the_plain_engine_and_much_mass_the_free_optimum() -> None:
    problem = load(FOUR)
    none, much = front(problem, (0.0, 50.0))
    plain = with_shafts(problem, ())
    assert none.force == pytest.approx(objective_value(plain, evaluate(plain)), rel=1e-4)
    free = solve(problem)
    assert free.objective is not None
    assert much.force == pytest.approx(free.objective.value, rel=1e-3)


def test_fronts_label_builds_and_units() -> None:
    problem = load(FOUR)
    names = shafts_of(problem)
    assert names == ("force left", "force right", "moment left", "moment right")
    data = fronts({"plain": with_shafts(problem, ()), "force pair": with_shafts(problem, names[:2])}, (0.0, 4.0))
    assert data["shafts"].values.tolist() == [0, 2]
    assert data["force"].attrs["units"] == "N"
    assert np.ptp(data["force"].sel(build="plain").values) == 0.0
    with pytest.raises(ModelError, match="no balancer shaft"):
        with_shafts(problem, ("third",))


def test_front_without_shafts_still_sizes_the_counterweights() -> None:
    problem = replace(load(PROBLEMS / "tractor-three.toml"), limits=())
    plain = with_shafts(problem, ())
    assert plain.decisions
    free = solve(plain)
    assert free.objective is not None
    first, second = front(plain, (0.0, 1.0))
    assert first.force == second.force == pytest.approx(free.objective.value, rel=1e-3)
    assert first.mass == 0.0
    assert first.gap < 1e-3
