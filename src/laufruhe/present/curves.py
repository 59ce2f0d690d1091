"""Curves that pictures and tables share: indicator diagrams, and transmissibility over speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Chambers, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.physics.cylinder_volume import swept_volume
from laufruhe.physics.speed_map import speed_map, split_loads
from laufruhe.physics.working_chambers import chamber_pressure, chambers_thrust
from laufruhe.present.measures import has_loads
from laufruhe.present.mounting import critical_speed, excited_frequencies, facts_of, main_order
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result


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
        {chamber.name: chamber_pressure(chamber, part, angles) for chamber in gas.of(part)},
        -chambers_thrust(gas, part, angles),
        np.asarray(-mass * (part.shaft.ratio * point.speed) ** 2 * acceleration.real),
    )


REACH = 1.25
SPEEDS = 400


def highest_speed(result: Result) -> float:
    """Return the end of the speed axis, beyond operating points and isolation [rad/s]."""
    facts = facts_of(result.final)
    highest = max(point.speed for point in result.problem.points)
    return REACH * max(highest, 2.0 * critical_speed(max(excited_frequencies(facts)), main_order(facts)))


def transmissibility_speeds(result: Result) -> Array:
    """Return the speeds of transmissibility curves [rad/s]."""
    top = highest_speed(result)
    return np.linspace(top / SPEEDS, top, SPEEDS)


def transmissibility_of(
    design: Evaluation, point: OperatingPoint, speeds: Array, orders: tuple[float, ...]
) -> Iterator[tuple[int, Array]]:
    """Yield index and values of the transmissibility of every order that the loads have.

    Yield nothing for a design on an undamped resonance.
    """
    loads = split_loads(design.engine, point, design.fidelity)
    try:
        field = speed_map(mounting_in(design.engine), *loads, speeds, only_orders=orders)
    except ModelError:
        return
    curves = field.transmissibility
    for k, order in enumerate(orders):
        for column in np.flatnonzero(orders_equal(field.orders, order))[:1]:
            yield k, curves[:, column]
