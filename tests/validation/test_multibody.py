"""Shaking loads against a multibody simulation that knows none of their formulas.

The integration is of second order: at half the step a quarter of the error is left, so a third of the difference of two
simulations is the error of the finer one. That is the tolerance; the analytic loads add nothing to it. What both steps
extrapolate to (Richardson) is held to the rounding of the simulation.

Errors are counted in the loads that the parts would exert if all were in phase, or in the largest load where that is
more. That has a meaning for loads that cancel, too.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import Cycle, Engine, OperatingPoint, Rod, Role, Rotor, Shaft, SliderCrank
from laufruhe.machine.rotor import CRANKSHAFT
from laufruhe.physics.shaking_loads import shaking_loads
from validation import multibody
from validation.multibody import ConnectingRod, Cylinder, Loads, Machine, Turning

pytestmark = [pytest.mark.validation, pytest.mark.slow]

FloatArray = NDArray[np.float64]

COARSE, FINE = 720, 1440
ROUNDING = 1e-7
"""Rounding of the simulation, which takes accelerations from positions."""

SPEED = 200.0
RADIUS, LENGTH, PISTON, BORE = 0.050, 0.200, 1.0, 0.090
CRANKCASE = 1e5
TRACE_POINTS = 46080
ROD = ConnectingRod(LENGTH, mass=2.0, centre=0.08, inertia=0.65 * 2.0 * 0.08 * 0.12)
"""2 kg with 65 % of the inertia of its two masses."""


@dataclass(frozen=True)
class Case:
    """A machine as bodies, and the same as an engine."""

    machine: Machine
    engine: Engine
    point: OperatingPoint

    @property
    def turns(self) -> int:
        return self.engine.cycle.turns if self.point.gas else 1


# the same machine twice


def described(machine: Machine, *, pressure: PressureTrace | None = None, parts: tuple[Rotor, ...] = ()) -> Case:
    """Return a machine with its engine, each throw and rod in the engine's own terms.

    Parameters
    ----------
    machine
        Bodies.
    pressure
        What the gas force of every cylinder comes from.
    parts
        Rotors that stand for the unbalances of the turning bodies, where one body holds several.
    """
    shafts = [_shaft(k, body) for k, body in enumerate(machine.turning)]
    slider_cranks = tuple(
        _slider_crank(f"cylinder {k + 1}", part, machine.turning[part.throw], shafts[part.throw])
        for k, part in enumerate(machine.cylinders)
    )
    rotors = tuple(
        Rotor(f"body {k + 1}", body.x, body.mass * body.centre, shafts[k]) for k, body in enumerate(machine.turning)
    )
    engine = Engine("multibody", Cycle.FOUR_STROKE, slider_cranks, parts or rotors)
    return Case(machine, engine, OperatingPoint("run", machine.speed, pressure))


def _shaft(k: int, body: Turning) -> Shaft:
    on_crank = body.ratio == 1.0 and body.axis == 0.0
    return CRANKSHAFT if on_crank else Shaft(f"shaft {k + 1}", body.ratio, body.axis.imag, body.axis.real)


def _slider_crank(name: str, part: Cylinder, throw: Turning, shaft: Shaft) -> SliderCrank:
    rod = Rod(part.rod.length, part.rod.mass, part.rod.centre, part.rod.inertia)
    angle = cmath.phase(part.pin)
    return SliderCrank(
        name=name,
        x=throw.x,
        crank_radius=abs(part.pin),
        rod_length=rod.length,
        reciprocating_mass=part.piston_mass + rod.reciprocating_mass,
        throw=angle,
        bank=part.bank,
        offset=part.offset,
        rotating_mass=rod.rotating_mass,
        rod_inertia_deficit=rod.inertia_deficit,
        bore=BORE,
        firing_angle=((part.bank - angle) / shaft.ratio) % math.tau,
        shaft=shaft,
    )


# cases


def pin_at(degrees: float) -> complex:
    return RADIUS * cmath.exp(1j * math.radians(degrees))


def inline(*throws: float, spacing: float = 0.1) -> Machine:
    """Return the cylinders in line, front first (C2, C3)."""
    middle = 0.5 * (len(throws) - 1)
    bodies = tuple(Turning((middle - k) * spacing, mass=4.0) for k in range(len(throws)))
    cylinders = tuple(Cylinder(k, pin_at(angle), ROD, PISTON) for k, angle in enumerate(throws))
    return Machine(bodies, cylinders, SPEED)


def single() -> Case:
    return described(inline(0.0))


def single_with_counterweight() -> Case:
    """Return a single whose web, pin and counterweight are one rigid body here, two unbalances there."""
    pin, weight = 0.8 * RADIUS, 3.0 * 0.07 * cmath.exp(1j * math.radians(170.0))
    throw = Turning(0.0, mass=6.0, centre=(pin + weight) / 6.0)
    parts = (Rotor("pin", 0.0, pin, role=Role.THROW), Rotor("counterweight", 0.0, weight))
    return described(Machine((throw,), (Cylinder(0, pin_at(0.0), ROD, PISTON),), SPEED), parts=parts)


def three_cylinder() -> Case:
    return described(inline(0.0, 240.0, 120.0))


def four_cylinder() -> Case:
    return described(inline(0.0, 180.0, 180.0, 0.0))


def uneven_four_with_counterweights() -> Case:
    """Return an uneven four in which no load cancels."""
    machine = inline(0.0, 100.0, 170.0, 290.0)
    heavy = tuple(
        replace(body, centre=0.01 * cmath.exp(1j * (2.0 + 0.7 * k))) for k, body in enumerate(machine.turning)
    )
    return described(replace(machine, turning=heavy))


def vee_twin() -> Case:
    """Return a twin with two rods on one pin and 90 degrees between the banks, away from the middle."""
    banks = (math.radians(45.0), math.radians(-45.0))
    throw = Turning(0.06, mass=5.0, centre=-0.02 * cmath.exp(1j * banks[0]))
    cylinders = tuple(Cylinder(0, pin_at(45.0), ROD, PISTON, bank=bank) for bank in banks)
    return described(Machine((throw,), cylinders, SPEED))


def offset_crank(offset: float) -> Case:
    machine = inline(0.0)
    return described(replace(machine, cylinders=(replace(machine.cylinders[0], offset=offset),)))


def balancer_pair() -> Case:
    """Return two shafts at twice the crank's speed, both ways round, off the axis and at unequal heights."""
    machine = inline(0.0, 180.0, 180.0, 0.0)
    left = Turning(0.05, 0.8, 0.030 * cmath.exp(0.4j), ratio=2.0, axis=-0.06 + 0.10j)
    right = Turning(-0.03, 0.7, 0.030 * cmath.exp(2.4j), ratio=-2.0, axis=0.14 - 0.09j)
    return described(replace(machine, turning=(*machine.turning, left, right)))


def geared_twin_crank() -> Case:
    """Return the two cranks that run against each other, the second with its flywheel torque through the gears."""
    turning = (Turning(0.0, 4.0, axis=0.08j), Turning(0.0, 4.0, ratio=-1.0, axis=-0.08j))
    cylinders = (
        Cylinder(0, pin_at(0.0), ROD, PISTON, offset=-0.01),
        Cylinder(1, pin_at(0.0), ROD, PISTON, offset=0.01),
    )
    return described(Machine(turning, cylinders, SPEED))


def gas_force(firing: float, angle: float) -> float:
    """Return a force with a pressure stroke every second turn and half orders, over the crank angle [N]."""
    return 2.0e4 * math.exp(20.0 * (math.cos(0.5 * (angle - firing) - 0.12) - 1.0))


def trace() -> PressureTrace:
    """Return the gas force as a pressure, with a point wherever the loads are sampled."""
    angles = 2.0 * math.tau * np.arange(TRACE_POINTS) / TRACE_POINTS
    area = 0.25 * math.pi * BORE**2
    pressures = tuple(CRANKCASE + gas_force(0.0, angle) / area for angle in angles)
    return PressureTrace(tuple(angles.tolist()), pressures, CRANKCASE)


def fired(case: Case) -> Case:
    """Return the case with gas in its cylinders."""
    pairs = zip(case.machine.cylinders, case.engine.slider_cranks, strict=True)
    cylinders = tuple(replace(part, gas=partial(gas_force, crank.firing_angle)) for part, crank in pairs)
    return described(replace(case.machine, cylinders=cylinders), pressure=trace(), parts=case.engine.rotors)


CASES: dict[str, Callable[[], Case]] = {
    "single": single,
    "single with counterweight": single_with_counterweight,
    "three-cylinder": three_cylinder,
    "four-cylinder": four_cylinder,
    "four uneven throws": uneven_four_with_counterweights,
    "90 degree vee-twin": vee_twin,
    "offset +0.10 l": lambda: offset_crank(0.10 * LENGTH),
    "offset -0.05 l": lambda: offset_crank(-0.05 * LENGTH),
    "four-cylinder with a pair at +2 and -2": balancer_pair,
    "geared twin crank": geared_twin_crank,
    "single, fired": lambda: fired(single()),
    "vee-twin, fired": lambda: fired(vee_twin()),
    "offset +0.10 l, fired": lambda: fired(offset_crank(0.10 * LENGTH)),
    "geared twin crank, fired": lambda: fired(geared_twin_crank()),
}


# errors


@cache
def case_of(name: str) -> Case:
    return CASES[name]()


@cache
def simulated(name: str, steps: int) -> Loads:
    case = case_of(name)
    return multibody.simulate(case.machine, steps, case.turns)


def analytic(case: Case, steps: int) -> FloatArray:
    angles = math.tau * np.arange(case.turns * steps) / steps
    return shaking_loads(case.engine, case.point).values(angles)


@cache
def unit_loads(name: str) -> FloatArray:
    """Return the wrench that errors are counted in."""
    machine = case_of(name).machine
    throws = [(abs(part.pin), machine.turning[part.throw]) for part in machine.cylinders]
    pistons = [(PISTON + ROD.mass) * radius for radius, _ in throws]
    rotors = [body.mass * abs(body.centre) * body.ratio**2 for body in machine.turning]
    force = SPEED**2 * (sum(pistons) + sum(rotors))
    across = max(max(radius for radius, _ in throws), max(abs(body.axis) for body in machine.turning))
    along = max(abs(body.x) for body in machine.turning) or across
    in_phase = force * np.array([1.0, 1.0, 1.0, across, along, along])
    return np.maximum(in_phase, np.abs(simulated(name, FINE).reactions).max(axis=0))


def error(name: str, got: FloatArray, expected: FloatArray) -> float:
    return float((np.abs(got - expected) / unit_loads(name)).max())


def own_error(name: str) -> float:
    """Return the error of the finer simulation, estimated from the two alone."""
    return error(name, simulated(name, COARSE).reactions, simulated(name, FINE).reactions[::2]) / 3.0


@pytest.mark.parametrize("name", CASES)
def test_forces_of_the_joints_and_accelerations_of_the_bodies_agree(name: str) -> None:
    """Check the simulation against itself: each load that reaches the block counts once."""
    for steps in (COARSE, FINE):
        loads = simulated(name, steps)
        assert error(name, loads.reactions, loads.momentum) < 1e-10


@pytest.mark.parametrize("name", CASES)
def test_loads_agree_within_the_error_of_the_simulation(name: str) -> None:
    assert own_error(name) < 1e-5
    assert error(name, analytic(case_of(name), FINE), simulated(name, FINE).reactions) <= own_error(name) + ROUNDING


@pytest.mark.parametrize("name", CASES)
def test_difference_falls_with_the_square_of_the_step(name: str) -> None:
    coarse, fine = (error(name, analytic(case_of(name), n), simulated(name, n).reactions) for n in (COARSE, FINE))
    assert 3.9 < coarse / fine < 4.1


@pytest.mark.parametrize("name", CASES)
def test_simulation_extrapolated_to_no_step_agrees(name: str) -> None:
    coarse, fine = simulated(name, COARSE).reactions, simulated(name, FINE).reactions[::2]
    assert error(name, analytic(case_of(name), COARSE), (4.0 * fine - coarse) / 3.0) < ROUNDING


@pytest.mark.parametrize(("name", "share"), [("single", 0.40), ("four-cylinder", 0.08)])
def test_rod_of_two_masses_gets_the_roll_moment_wrong(name: str, share: float) -> None:
    """Check that without the inertia deficit the roll moment alone is wrong, by tens of percent."""
    case, reference = case_of(name), simulated(name, FINE).reactions
    bare = tuple(replace(part, rod_inertia_deficit=0.0) for part in case.engine.slider_cranks)
    without = replace(case, engine=replace(case.engine, slider_cranks=bare))
    wrong = np.abs(analytic(without, FINE) - reference).max(axis=0)
    assert wrong[3] > share * np.abs(reference[:, 3]).max()
    others = [0, 1, 2, 4, 5]
    assert np.all(wrong[others] < 1e-5 * unit_loads(name)[others])


def in_bearings(case: Case, steps: int) -> NDArray[np.complex128]:
    """Return the force of every turning body on its bearing, z + i y: the shaft held on both sides of each throw."""
    forces = []
    angles = math.tau * np.arange(case.turns * steps) / steps
    for k, body in enumerate(case.machine.turning):
        shaft = _shaft(k, body)
        here = [part for part in case.engine.slider_cranks if (part.shaft, part.x) == (shaft, body.x)]
        rotors = tuple(r for r in case.engine.rotors if (r.shaft, r.x) == (shaft, body.x))
        bearings = tuple(Bearing(str(side), body.x + 0.03 * side, shaft=shaft) for side in (-1, 1))
        alone = replace(case.engine, slider_cranks=tuple(here), rotors=rotors).with_extra(MainBearings(bearings))
        values = main_bearing_forces(alone, case.point).values(angles).sum(axis=1)
        forces.append(values[:, 2] + 1j * values[:, 1])
    return np.stack(forces, axis=1)


@pytest.mark.parametrize("name", CASES)
def test_bearing_forces_agree_within_the_error_of_the_simulation(name: str) -> None:
    """Compare joint forces of crank and block one at a time."""
    case, coarse, fine = case_of(name), simulated(name, COARSE).bearings, simulated(name, FINE).bearings
    size = np.abs(fine).max()
    assert np.abs(in_bearings(case, FINE) - fine).max() < np.abs(coarse - fine[::2]).max() / 3.0 + ROUNDING * size
    extrapolated = (4.0 * fine[::2] - coarse) / 3.0
    assert np.abs(in_bearings(case, COARSE) - extrapolated).max() < 3.0 * ROUNDING * size
    # the loads of the cylinders alone are far from it
    assert size > 1e3
