"""Curves of transmissibility over speed, which pictures and tables share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.physics.speed_map import speed_map, split_loads
from laufruhe.present.mounting import critical_speed, excited_frequencies, facts_of, main_order
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

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
