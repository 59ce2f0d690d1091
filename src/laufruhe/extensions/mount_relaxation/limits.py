"""Limits of norms of force and travel, and of transmissibility, in the relaxation (E61).

A norm is at least its epigraph variables (E45, E54), so that its limit bounds them above. A limit of transmissibility
is an inequality between the squares of forces in an order and of the forces at rest under the same load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.orders import (
    MAX_ORDERS,
    EpigraphVariable,
    MeasureOrders,
    Order,
    epigraph_variables,
)
from laufruhe.extensions.mount_relaxation.response import ResponseBound
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.norms import RMS
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK

# a limit enters only if the best design has more than this share of it
NEAR_LIMIT = 0.7
# bound that excludes no response
UNBOUNDED = ResponseBound((), math.inf, False)


@dataclass(frozen=True, eq=False)
class NormLimit:
    """Upper bound of a norm of mount force or travel, and so of the epigraph variables that bound it below."""

    query: MeasureOrders
    variables: tuple[EpigraphVariable, ...]
    upper: float


@dataclass(frozen=True, eq=False)
class RatioLimit:
    """Upper bound of transmissibility: root sum of squares of mount forces in some orders, over the same at rest."""

    orders: tuple[Order, ...]
    upper: float

    @cached_property
    def orders_at_rest(self) -> tuple[Order, ...]:
        """The same loads at rest, with angular frequency zero."""
        return tuple(replace(order, omega=0.0) for order in self.orders)


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits that the best design comes near."""

    norms: tuple[NormLimit, ...]
    ratios: tuple[RatioLimit, ...]

    @property
    def loads(self) -> list[ComplexArray]:
        """Change of the load of each order by each column of the unbalances, shape (columns, k) each."""
        orders = [order for limit in self.norms for order in limit.query.orders]
        orders += [order for limit in self.ratios for order in limit.orders]
        return [order.loads[1:] for order in orders]

    def in_basis(self, basis: Array, parts: Sequence[OpenMounts]) -> Limits:
        """Return the same limits as functions of fewer unbalance coordinates.

        `basis` has the shape (fewer, columns). `parts` are those of `limits_of`: mounts for all motions, or for each
        symmetry.
        """
        norms = []
        for limit in self.norms:
            query = limit.query.in_basis(basis)
            norms.append(NormLimit(query, tuple(epigraph_variables(query, parts)), limit.upper))
        ratios = (
            RatioLimit(tuple(order.in_basis(basis) for order in ratio.orders), ratio.upper) for ratio in self.ratios
        )
        return Limits(tuple(norms), tuple(ratios))


def limits_of(
    problem: Problem, evaluation: Evaluation,
    orders_of: Callable[[Measure, Sequence[OpenMounts]], MeasureOrders], parts: Sequence[OpenMounts],
) -> Limits:  # fmt: skip
    """Return the limits to include in the relaxation: those that the best design nearly reaches.

    Transmissibility is limited in all motions together, without a split by symmetry (E57).

    Parameters
    ----------
    evaluation
        The best design.
    orders_of
        Function that returns the orders of a measure, given the mounts for some motions.
    parts
        Mounts for all motions; if they are symmetric, then for symmetric and for antisymmetric motions.
    """
    norms: list[NormLimit] = []
    for limit in problem.limits:
        if limit.measure.on_mounts and NEAR_LIMIT * limit.maximum <= evaluation.value(limit.measure) < math.inf:
            query = orders_of(limit.measure, parts)
            if query.orders and query.is_sampled_fully:
                norms.append(NormLimit(query, (), limit.maximum * (1.0 + SLACK)))
    ratios: list[RatioLimit] = []
    for limit in problem.mount_limits:
        measure = limit.measure
        if not measure.channel.depends_on_loads or evaluation.value(measure) < NEAR_LIMIT * limit.maximum:
            continue
        force = Measure(channels.MOUNT_FORCE, RMS, points=measure.points, orders=measure.orders)
        query = orders_of(force, parts[:1])
        for point in query.points:
            speed, orders = problem.points[point].speed, [o for o in query.orders if o.point == point]
            groups = [tuple(orders)]
            if measure.orders is not None:
                groups = [tuple(o for o in orders if orders_equal(o.omega / speed, h)) for h in measure.orders]
            upper = limit.maximum * (1.0 + SLACK)
            ratios += [RatioLimit(group, upper) for group in groups if 0 < len(group) <= MAX_ORDERS]
    return Limits(tuple(norms), tuple(ratios))
