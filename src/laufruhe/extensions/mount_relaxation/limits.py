"""Limits of forces, travel and transmissibility of a running engine, beside what is minimised (E61).

A norm that is limited is at least its heads (E45, E54), each of which then is not over a number. Transmissibility
of an order is one inequality between the squares of its forces, and of those at rest under the same load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.mount_relaxation.bound import Budget, Cap
from laufruhe.extensions.mount_relaxation.conditions import Held
from laufruhe.extensions.mount_relaxation.lines import Felt, Line, squared
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.orders import MOST_ORDERS, Asked, Head, Order, heads_of
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.norms import RMS
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK

# share of a limit that the best design comes near, so that it may hold others back
FELT = 0.7
ANYTHING = Felt((), math.inf, False)

Stated: TypeAlias = tuple[Line, list[Held]]
Key: TypeAlias = tuple[int, int, int, bool]


@dataclass(frozen=True, eq=False)
class Limited:
    """A norm that is not over a number."""

    asked: Asked
    heads: tuple[Head, ...]
    most: float


@dataclass(frozen=True, eq=False)
class Ratio:
    """Forces of some orders, whose root of squares is not over a number times those at rest."""

    orders: tuple[Order, ...]
    most: float


@dataclass(eq=False)
class Added:
    """Lines of limits that nothing else has, and conditions on all of them."""

    lines: list[Line] = field(default_factory=list)
    held: list[Held] = field(default_factory=list)
    caps: list[Cap] = field(default_factory=list)
    tops: list[float] = field(default_factory=list)
    budgets: list[Budget] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Limits:
    """All that count."""

    norms: tuple[Limited, ...]
    ratios: tuple[Ratio, ...]

    @property
    def loads(self) -> list[ComplexArray]:
        """Of all orders, what columns of the unbalances add."""
        orders = [order for each in self.norms for order in each.asked.orders]
        return [order.loads[1:] for order in (*orders, *(order for each in self.ratios for order in each.orders))]

    def of_columns(self, fewer: Array, parts: Sequence[OpenMounts]) -> Limits:
        """With columns of unbalances that are sums of these."""

        def with_heads(each: Limited) -> Limited:
            asked = each.asked.of_columns(fewer)
            return Limited(asked, tuple(heads_of(asked, parts)), each.most)

        def less(order: Order) -> Order:
            return replace(order, loads=np.concatenate([order.loads[:1], fewer @ order.loads[1:]]))

        ratios = (Ratio(tuple(map(less, each.orders)), each.most) for each in self.ratios)
        return Limits(tuple(map(with_heads, self.norms)), tuple(ratios))

    def added(
        self, heads: Sequence[Head], count: int, line: Callable[[Order, Felt], Stated], lines: Sequence[Line]
    ) -> Added:
        """To the orders of some heads, whose lines are known.

        Parameters
        ----------
        count
            Of heads so far.
        """
        found, known = Added(), {_key(o): k for k, o in enumerate(o for head in heads for o in head.orders)}
        whole = list(lines)

        def number(order: Order, felt: Felt) -> int:
            if _key(order) not in known:
                own, held = line(order, felt)
                known[_key(order)] = len(whole)
                found.held += [replace(limit, order=len(whole)) for limit in held]
                found.lines.append(own)
                whole.append(own)
            return known[_key(order)]

        for each in self.norms:
            for head in each.heads:
                at = [number(order, each.asked.at_most(order, head, each.most)) for order in head.orders]
                found.caps += head.caps(count + len(found.tops), each.asked, [whole[k] for k in at], at)
                found.tops.append((head.at_most(each.most / head.share) / head.unit) ** 2)
        for ratio in self.ratios:
            moving = [number(order, ANYTHING) for order in ratio.orders]
            still = [number(replace(order, omega=0.0), ANYTHING) for order in ratio.orders]
            size = max(float(np.linalg.norm(whole[k].forces[..., 0])) * whole[k].unit for k in (*moving, *still)) or 1.0
            matrices = [(k, squared(whole[k].forces * (whole[k].unit / size))) for k in moving]
            matrices += [(k, -(ratio.most**2) * squared(whole[k].forces * (whole[k].unit / size))) for k in still]
            found.budgets.append(Budget(tuple(matrices), 0.0))
        return found


def _key(order: Order) -> Key:
    return order.point, order.place, order.part, order.omega > 0.0


def limits_of(
    problem: Problem, known: Evaluation, told: Callable[[Measure], Asked], whole: Callable[[Measure], Asked]
) -> Limits:
    """Those that the best design comes near.

    Parameters
    ----------
    told, whole
        Orders of a measure, by halves of the motions where there are such, and of all motions (E57).
    """
    norms: list[Limited] = []
    for limit in problem.limits:
        if limit.measure.on_mounts and FELT * limit.maximum <= known.value(limit.measure) < math.inf:
            own = told(limit.measure)
            norms += [Limited(own, (), limit.maximum * (1.0 + SLACK))] if own.orders and own.is_sampled_fully else []
    ratios: list[Ratio] = []
    for limit in problem.mount_limits:
        measure = limit.measure
        if not measure.channel.of_loads or known.value(measure) < FELT * limit.maximum:
            continue
        own = whole(Measure(channels.MOUNT_FORCE, RMS, points=measure.points, orders=measure.orders))
        for point in own.points:
            speed, orders = problem.points[point].speed, own.of_point(point)
            groups = [tuple(orders)]
            if measure.orders is not None:
                groups = [tuple(o for o in orders if orders_equal(o.omega / speed, h)) for h in measure.orders]
            ratios += [Ratio(g, limit.maximum * (1.0 + SLACK)) for g in groups if 0 < len(g) <= MOST_ORDERS]
    return Limits(tuple(norms), tuple(ratios))
