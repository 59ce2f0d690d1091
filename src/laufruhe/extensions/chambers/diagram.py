"""Indicator diagrams of cylinders with chambers on both sides of their pistons (G14)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.chambers.gas import Chambers
from laufruhe.machine import Cycle, OperatingPoint, SliderCrank
from laufruhe.machine.gas.charge import swept_volume
from laufruhe.numerics.arrays import Array
from laufruhe.present.measures import has_loads
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.problem.curves import STEPS
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

PICTURE = ResultPicture(
    "indicator",
    "Indicator diagrams of steam cylinders and pumps, and the force on each rod over its stroke.",
    "laufruhe.extensions.chambers.picture",
)
_TURN = math.tau * np.arange(STEPS) / STEPS


def points_with_chambers(result: Result) -> list[tuple[OperatingPoint, Chambers]]:
    """Return operating points with chambers on both sides of pistons."""
    if not has_loads(result):
        return []
    return [(point, point.gas) for point in result.problem.points if isinstance(point.gas, Chambers)]


@dataclass(frozen=True)
class Indicator:
    """Indicator diagram of one cylinder: absolute pressure [Pa] of its chambers by name over the travel.

    The travel is a part of the stroke from the head end. The chambers exert a force on the rod towards the crank [N];
    another force is needed to accelerate the reciprocating mass.
    """

    travel: Array
    pressures: dict[str, Array]
    force: Array
    needed: Array


def indicator_of(gas: Chambers, part: SliderCrank, point: OperatingPoint, angles: Array) -> Indicator:
    """Return volume, pressures and forces of a cylinder at crank angles from its dead centre [rad] (G14)."""
    mass, (_, _, acceleration) = part.motion(np, part.fires_at + part.shaft.ratio * angles).points[0]
    return Indicator(
        swept_volume(part, angles),
        {chamber.name: chamber.pressure(part, angles) for chamber in gas.of(part)},
        -gas.thrust(part, Cycle.TWO_STROKE, angles),
        np.asarray(-mass * (part.shaft.ratio * point.speed) ** 2 * acceleration.real),
    )


def _indicator(result: Result) -> Table:
    parts, rows, chamber_names = result.final.engine.slider_cranks, [], dict[str, None]()
    diagrams = [
        (point.name, part.name, indicator_of(gas, part, point, _TURN))
        for point, gas in points_with_chambers(result)
        for part in parts
        if gas.of(part)
    ]
    for _, _, diagram in diagrams:
        chamber_names |= dict.fromkeys(diagram.pressures)
    for point, part, diagram in diagrams:
        # a cylinder may lack a chamber
        pressures = (diagram.pressures.get(name, np.full(STEPS, math.nan)) for name in chamber_names)
        columns = np.column_stack([np.degrees(_TURN), diagram.travel, diagram.force, diagram.needed, *pressures])
        rows += [[point, part, *row] for row in columns.tolist()]
    head = ["point", "cylinder", "angle from its dead centre [deg]", "part of the stroke", "force of the chambers [N]",
            "force that accelerates the rod [N]", *(f"pressure in {name} [Pa]" for name in chamber_names)]  # fmt: skip
    return Table(head, rows)


SECTION = Section(
    "indicator_diagrams",
    lambda result: bool(points_with_chambers(result)),
    number_tables={"indicator": (points_with_chambers, _indicator)},
)
