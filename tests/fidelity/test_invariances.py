"""Invariance to names, front or back, direction of time, and the units of mass, length and time (C1-C8)."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest

from fidelity.scenes import random_problem
from lanes import first_fast
from laufruhe.machine import Mount, OperatingPoint, Rotor, Seiliger, SliderCrank, Wiebe
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers.accuracy import objective_error

SEEDS = first_fast(range(60), 8, 13)
POWERS = {channels.MOUNT_FORCE: 1, channels.SHAKING_FORCE: 1, channels.ROLL_MOMENT: 2, channels.ROCKING_COUPLE: 2}
"""Power of length in each channel, beside mass over time squared."""


def _value(problem: Problem) -> tuple[float, float]:
    evaluation = evaluate(problem)
    return objective_value(problem, evaluation), objective_error(problem, evaluation)


def _changed(problem: Problem, parts: list[SliderCrank], rotors: list[Rotor], mounts: list[Mount]) -> Problem:
    engine = replace(problem.engine, slider_cranks=tuple(parts), rotors=tuple(rotors), mounts=tuple(mounts))
    return replace(problem, engine=engine)


def _same(found: Problem, problem: Problem, factor: float = 1.0) -> None:
    (value, error), (known, stated) = _value(found), _value(problem)
    # a couple or moment that cancels is a rounding, and has none
    if known > 1e-9 * _largest(problem):
        assert value == pytest.approx(factor * known, rel=1e-8)
        assert error == pytest.approx(stated, rel=1e-3, abs=1e-9)


def _largest(problem: Problem) -> float:
    return max(abs(load.wrench.coefficients).max() for load in evaluate(problem).loads)


@pytest.mark.parametrize("seed", SEEDS)
def test_order_of_the_cylinders(seed: int) -> None:
    problem = random_problem(random.Random(seed), gas=True)
    engine, rng = problem.engine, random.Random(seed)
    parts, mounts = list(engine.slider_cranks), list(engine.mounts)
    rng.shuffle(parts)
    rng.shuffle(mounts)
    _same(_changed(problem, parts, list(engine.rotors), mounts), problem)


@pytest.mark.parametrize("seed", SEEDS)
def test_front_and_back(seed: int) -> None:
    """Check that an engine mirrored in the plane x = 0 turns as before."""
    problem = random_problem(random.Random(seed), gas=True)
    engine = problem.engine
    _same(
        _changed(
            problem,
            [replace(part, x=-part.x) for part in engine.slider_cranks],
            [replace(rotor, x=-rotor.x) for rotor in engine.rotors],
            [replace(m, position=(-m.position[0], *m.position[1:])) for m in engine.mounts],
        ),
        problem,
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_direction_of_time(seed: int) -> None:
    """Check that an engine reversed in time and mirrored in y = 0 turns as before, without gas."""
    problem = random_problem(random.Random(seed), gas=False)
    engine = problem.engine
    rotors = [
        replace(r, unbalance=r.unbalance.conjugate(), shaft=replace(r.shaft, y=-r.shaft.y)) for r in engine.rotors
    ]
    parts = [
        replace(p, throw=-p.throw, bank=-p.bank, offset=-p.offset, firing_angle=(-p.bank + p.throw) % math.tau)
        for p in engine.slider_cranks
    ]
    mounts = [replace(m, position=(m.position[0], -m.position[1], m.position[2])) for m in engine.mounts]
    _same(_changed(problem, parts, rotors, mounts), problem)


@pytest.mark.parametrize("seed", first_fast(range(60), 8, 8))
@pytest.mark.parametrize(
    ("mass", "length", "time"),
    [(1e6, 1.0, 1.0), (1e-6, 1.0, 1.0), (1.0, 1e6, 1.0), (1.0, 1e-6, 1.0), (1.0, 1.0, 1e6), (1.0, 1.0, 1e-6),
     (1e6, 1e-6, 1e3), (1e-6, 1e-3, 1e-6)],
)  # fmt: skip
def test_units_of_mass_length_and_time(seed: int, mass: float, length: float, time: float) -> None:
    problem = random_problem(random.Random(seed), gas=True)
    engine, pressure = problem.engine, mass / (length * time**2)
    parts = [
        replace(
            p, x=p.x * length, crank_radius=p.crank_radius * length, rod_length=p.rod_length * length,
            offset=p.offset * length, reciprocating_mass=p.reciprocating_mass * mass,
            rotating_mass=p.rotating_mass * mass, rod_inertia_deficit=p.rod_inertia_deficit * mass * length**2,
            bore=None if p.bore is None else p.bore * length,
        )
        for p in engine.slider_cranks
    ]  # fmt: skip
    rotors = [
        replace(r, x=r.x * length, unbalance=r.unbalance * mass * length,
                shaft=replace(r.shaft, y=r.shaft.y * length, z=r.shaft.z * length))
        for r in engine.rotors
    ]  # fmt: skip
    mounts = [replace(m, position=tuple(c * length for c in m.position)) for m in engine.mounts]
    points = tuple(_rescaled(point, pressure, time) for point in problem.points)
    result = replace(_changed(problem, parts, rotors, mounts), points=points)
    (term,) = problem.objective
    _same(result, problem, mass * length ** POWERS[term.measure.load] / time**2)


def _rescaled(point: OperatingPoint, pressure: float, time: float) -> OperatingPoint:
    gas = point.gas
    assert isinstance(gas, Seiliger | Wiebe)
    names = ["imep", "intake_pressure", "exhaust_pressure", "crankcase_pressure"]
    names += ["peak_pressure"] if isinstance(gas, Seiliger) else []
    return replace(
        point, speed=point.speed / time, gas=replace(gas, **{name: getattr(gas, name) * pressure for name in names})
    )
