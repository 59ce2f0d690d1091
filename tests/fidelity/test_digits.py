"""The rigid reference in 50 digits: double precision agrees with it, and a wrong number would show."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

import rigid_digits
from fidelity.scenes import random_problem
from laufruhe.files.reader import load
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS
from rigid_digits import rigid_part


@pytest.mark.parametrize("seed", range(24))
def test_double_precision_on_random_engines(seed: int) -> None:
    """Check offsets, rod inertia, rotating masses, vees, shafts, gas, one or two points, and every norm."""
    result = rigid_part(random_problem(random.Random(40 + seed)))
    assert result.covered
    assert result.error <= 2e-14


@pytest.mark.parametrize("name", ["tractor-four-lanchester", "vee-eight-cross", "powertrain-torque-roll"])
def test_double_precision_on_ready_engines(name: str) -> None:
    assert rigid_part(load(PROBLEMS / f"{name}.toml")).error <= 2e-15


@pytest.mark.parametrize("part", ["reciprocating_mass", "rotating_mass", "rod_inertia_deficit", "offset"])
def test_a_wrong_number_shows(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that an error of 1e-6 in one part shows in the comparison with 50 digits."""
    problem = random_problem(random.Random(53), gas=False)
    parts = tuple(
        replace(p, rotating_mass=0.5, rod_inertia_deficit=0.004, offset=0.002) for p in problem.engine.slider_cranks
    )
    problem = replace(problem, engine=replace(problem.engine, slider_cranks=parts))
    quantity = replace(problem.objective[0].measure, channel=rigid_digits.channels.MOUNT_FORCE)
    problem = replace(problem, objective=(replace(problem.objective[0], measure=quantity),))
    assert rigid_part(problem).error <= 1e-14
    exact = rigid_digits.wrench_in_digits

    def off(engine, point):  # type: ignore[no-untyped-def]
        changed = tuple(replace(p, **{part: getattr(p, part) * (1.0 + 1e-6)}) for p in engine.slider_cranks)
        return exact(replace(engine, slider_cranks=changed), point)

    monkeypatch.setattr(rigid_digits, "wrench_in_digits", off)
    assert rigid_part(problem).error > 1e-11


def _symmetric(problem: Problem) -> Problem:
    return replace(problem, engine=replace(problem.engine, mounts=tuple(reversed(problem.engine.mounts))))


def test_order_of_mounts_does_not_matter() -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    assert rigid_part(_symmetric(problem)).error <= 2e-15
