"""What goes on in working chambers, as pictures and tables show it: indicator diagrams, and chambers of a rotor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.machine import Chambers, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import chamber_volume, swept_volume
from laufruhe.physics.gas_cycle import thrust_at
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.physics.working_chambers import chamber_pressure, chambers_thrust
from laufruhe.present.measures import has_loads
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result


def points_with_chambers(result: Result) -> list[tuple[OperatingPoint, Chambers]]:
    """Operating points whose chambers on both sides of pistons are told."""
    if not has_loads(result):
        return []
    return [(point, point.gas) for point in result.problem.points if isinstance(point.gas, Chambers)]


@dataclass(frozen=True)
class Indicator:
    """What an indicator draws of one cylinder.

    Attributes
    ----------
    travel
        Part of the stroke from the head end.
    pressures
        Absolute, by the name of the chamber [Pa].
    force, needed
        Of the chambers on the rod, towards the crank; and what accelerates the reciprocating mass [N].
    """

    travel: Array
    pressures: dict[str, Array]
    force: Array
    needed: Array


def indicator_of(gas: Chambers, part: SliderCrank, point: OperatingPoint, angles: Array) -> Indicator:
    """Diagrams of a cylinder, at crank angles from its dead centre [rad] (G14)."""
    mass, (_, _, acceleration) = part.motion(np, part.fires_at + part.shaft.ratio * angles).points[0]
    return Indicator(
        swept_volume(part, angles),
        {chamber.name: chamber_pressure(chamber, part, angles) for chamber in gas.of(part)},
        -chambers_thrust(gas, part, angles),
        np.asarray(-mass * (part.shaft.ratio * point.speed) ** 2 * acceleration.real),
    )


def rotors_of(engine: Engine) -> Sequence[SliderCrank]:
    """Rotors whose chambers work one after the other."""
    return [part for part in engine.slider_cranks if len(part.swept.lags) > 1]


@dataclass(frozen=True)
class RotorChambers:
    """The chambers of a rotor, a row each, at angles of the shaft over the turns in which each works once.

    Attributes
    ----------
    volume
        Over the least [m3].
    pressure, torque
        Over the crankcase [Pa], and on the shaft [N m]; None without gas.
    """

    angles: Array
    volume: Array
    pressure: Array | None
    torque: Array | None


def rotor_chambers(problem: Problem, part: SliderCrank, point: OperatingPoint, count: int) -> RotorChambers:
    """Volume, pressure and torque of every chamber of a rotor (Y3, Y4)."""
    gas, lags = problem.fidelity.gas_of(point), part.swept.lags
    turns = math.tau * len(lags)
    angles = np.linspace(0.0, turns, count)
    since = [np.mod(angles - lag, turns) for lag in lags]
    volume = np.array([chamber_volume(part, each) for each in since])
    if gas is None:
        return RotorChambers(angles, volume, None, None)
    cycle = problem.engine.cycle
    pressure = np.array([-thrust_at(gas, part, cycle, each) / part.piston_area for each in since])
    return RotorChambers(angles, volume, pressure, np.array([chamber_torque(gas, part, cycle, each) for each in since]))
