"""Indicator diagrams of working chambers, as pictures and tables show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.machine import Chambers, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import swept_volume
from laufruhe.physics.working_chambers import chamber_pressure, chambers_thrust
from laufruhe.present.measures import has_loads
from laufruhe.solvers.result import Result


def points_with_chambers(result: Result) -> list[tuple[OperatingPoint, Chambers]]:
    """Return operating points with chambers on both sides of pistons."""
    if not has_loads(result):
        return []
    return [(point, point.gas) for point in result.problem.points if isinstance(point.gas, Chambers)]


@dataclass(frozen=True)
class Indicator:
    """Indicator diagram of one cylinder.

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
    """Return the diagram of a cylinder at crank angles from its dead centre [rad] (G14)."""
    mass, (_, _, acceleration) = part.motion(np, part.fires_at + part.shaft.ratio * angles).points[0]
    return Indicator(
        swept_volume(part, angles),
        {chamber.name: chamber_pressure(chamber, part, angles) for chamber in gas.of(part)},
        -chambers_thrust(gas, part, angles),
        np.asarray(-mass * (part.shaft.ratio * point.speed) ** 2 * acceleration.real),
    )
