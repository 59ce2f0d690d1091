"""Optimum that follows a limit: bounded, never above the whole solve, and no worse with more room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from laufruhe.extensions.served_page.follower import Follower, can_follow
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import solve
from problem_files import PROBLEMS


@pytest.fixture(scope="module")
def follower() -> Follower:
    return Follower(load(PROBLEMS / "tractor-four-lanchester.toml"))


def test_more_room_is_never_worse_and_prices_are_slopes(follower: Follower) -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    masses = np.linspace(0.1, 0.9, 7)
    found = [follower.at((replace(problem.limits[0], maximum=float(mass)),)) for mass in masses]
    values = [one.value for one in found]
    assert values == sorted(values, reverse=True)
    for one, mass, before, after in zip(found[1:], masses[1:], found, found[2:], strict=False):
        assert one.bound <= one.value
        assert one.standing[0] <= mass * (1 + 1e-6)
        # a convex value has its slope between those of its chords
        step = masses[1] - masses[0]
        assert (one.value - after.value) / step <= one.prices[0] * 1.02
        assert one.prices[0] <= (before.value - one.value) / step * 1.02


@pytest.mark.parametrize("name", ["tractor-single", "vee-six-90"])
def test_the_proven_optimum_lies_between_bound_and_value(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    assert can_follow(problem)
    result, proven = Follower(problem).at(problem.limits), solve(problem).objective
    assert proven is not None
    design = evaluate(problem, problem.design(result.values))
    assert result.bound <= proven.value * (1 + 1e-9)
    assert proven.value * (1 - 1e-4) <= objective_value(problem, design) <= proven.value * (1 + 2e-3)


def test_a_limit_that_no_design_keeps_is_named(follower: Follower) -> None:
    problem = load(PROBLEMS / "tractor-four-bearings.toml")
    tight = [replace(limit, maximum=10.0) if limit.measure.is_load else limit for limit in problem.limits]
    result = Follower(problem).at(tight)
    assert result.conflict
    assert set(result.conflict) <= {limit.name for limit in problem.limits}
    assert result.values == ()


def test_problems_with_loads_that_are_not_affine_are_not_followed() -> None:
    for name in (
        "tractor-four-elastic",
        "vee-eight-open",
        "tractor-four-robust",
        "selective-assembly",
        "worked-diesel-sizes",
    ):
        assert not can_follow(load(PROBLEMS / f"{name}.toml"))


def test_piston_masses_are_followed_if_rod_inertia_has_no_effect() -> None:
    problem = load(PROBLEMS / "tractor-four-seven-metres.toml")
    assert can_follow(problem)
    result, proven = Follower(problem).at(problem.limits), solve(problem).objective
    assert proven is not None
    assert result.bound <= proven.value * (1 + 1e-9)
