"""Ranking of the best stars, and of the firing orders of each (S8, S9, S17)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import firing
from laufruhe.numerics.exact_angles import as_turn, star_sum
from laufruhe.problem.phasing import Candidate, Intervals, OrderCriterion
from laufruhe.problem.problem import Phasing, Problem

ORDERS = (1, 2, 4)
ORDERS_LISTED = 6


@dataclass(frozen=True)
class RankedOrder:
    """A firing order and the criteria that rank it.

    Attributes
    ----------
    order
        Cylinder numbers, cylinder 1 first.
    neighbours
        Firings in succession on one throw or on throws side by side.
    longest_gap
        Largest crank angle in which one bank does not fire [rad].
    roll_content
        Largest share of a roll-moment order below the firing order, 0 to 1.
    intervals
        Crank angles from firing to firing [rad].
    """

    order: tuple[int, ...]
    neighbours: int
    longest_gap: float
    roll_content: float
    intervals: tuple[float, ...]

    @property
    def is_even(self) -> bool:
        """True if all intervals are equal."""
        return max(self.intervals) - min(self.intervals) <= 1e-9 * math.tau

    def score(self, criterion: OrderCriterion) -> float:
        """Return the value of a criterion; small is good."""
        if criterion is OrderCriterion.NEIGHBOURS:
            return float(self.neighbours)
        exact = self.longest_gap if criterion is OrderCriterion.LONGEST_GAP else self.roll_content
        return round(exact, 9)


@dataclass(frozen=True)
class RankedStar:
    """Entry of a ranking.

    Attributes
    ----------
    throws
        Angles [rad] (C3).
    bank_angle, split_pin
        [rad]; None where the layout has none.
    shafts
        Optional shafts that are built.
    value, lower_bound
        Objective with everything else at its optimum, and its bound over all designs of this star [SI].
    proven
        Whether no design left out of the ranking before this one is better.
    forces, couples
        |F_h| in forces of one throw, and |C_h| in that force times the spacing of the
        throws, of every order in `orders`.
    orders
        Orders h.
    firing_orders
        The best ones first.
    order_count
        How many firing orders belong to the star.
    even
        Whether all firing intervals are equal.
    """

    throws: tuple[float, ...]
    bank_angle: float | None
    split_pin: float | None
    shafts: tuple[str, ...]
    value: float
    lower_bound: float
    proven: bool
    forces: tuple[float, ...]
    couples: tuple[float, ...]
    orders: tuple[int, ...]
    firing_orders: tuple[RankedOrder, ...]
    order_count: int
    even: bool = True


@dataclass(frozen=True)
class TradePoint:
    """Point on the trade of objective against unevenness [rad, SI].

    Attributes
    ----------
    allowed, deviation
        Largest deviation of an interval from even that was allowed, and that is used [rad].
    value, lower_bound
        Objective, and its bound over all designs with this freedom [SI].
    throws
        Angles [rad].
    kkt_residual
        Residual of the nonlinear program.
    """

    allowed: float
    deviation: float
    value: float
    throws: tuple[float, ...]
    kkt_residual: float
    lower_bound: float = 0.0


@dataclass(frozen=True)
class PhasingResult:
    """Stars and firing orders that were decided, and how.

    Attributes
    ----------
    ranking
        Best first; the first one is the design of the result.
    places, banks
        Places of the throws along x [m], and banks of the cylinders [rad], for pictures.
    designs
        Number of stars, times sets of shafts, to choose from.
    looked_at
        Partial and whole stars that the search looked at, or cone programs solved.
    method
        Method in words.
    trade
        Objective against the largest deviation from even firing.
    even_value
        Objective of the best even star, where the design is uneven [SI].
    """

    ranking: tuple[RankedStar, ...]
    places: tuple[float, ...]
    banks: tuple[float, ...]
    designs: int
    looked_at: int
    method: str
    trade: tuple[TradePoint, ...] = ()
    even_value: float | None = None


def ranked_orders(
    phasing: Phasing, candidate: Candidate, steps: Sequence[int] | None = None
) -> tuple[RankedOrder, ...]:
    """Return firing orders of a star that keep the intervals, best first (S8).

    Parameters
    ----------
    steps
        Steps of an even star; None for throws at any angle.
    """
    layout, throws = phasing.layout_of(candidate), candidate.throws
    orders: Iterable[tuple[int, ...]]
    if phasing.firing_order is not None:
        orders = [phasing.firing_order]
    elif steps is not None:
        orders = firing.even_orders(phasing.cycle, layout, steps)
    else:
        orders = firing.lap_orders(phasing.cycle, layout, throws)
    ranked = []
    for order in itertools.islice(orders, firing.MOST_ORDERS):
        turns = firing.firing_turns(layout, throws, order)
        intervals = firing.intervals_of(phasing.cycle, turns)
        if phasing.intervals.holds(intervals, 1e-6):
            gap = firing.longest_bank_gap(phasing.cycle, layout, order, turns)
            content = firing.order_content(phasing.cycle, turns)
            ranked.append(RankedOrder(order, firing.successive_neighbours(layout, order), gap, content, intervals))
    ranked.sort(key=lambda o: (*(o.score(criterion) for criterion in phasing.criteria), o.order))
    return tuple(ranked)


def why_no_order(phasing: Phasing, throws: Sequence[float]) -> str:
    """Return why throws as given [rad] have no firing order; empty where they have one."""
    candidate = Candidate(tuple(throws), phasing.firing_order, *phasing.minimum_geometry)
    if ranked_orders(phasing, candidate):
        return ""
    orders = ranked_orders(replace(phasing, intervals=Intervals(0.0, math.inf)), candidate)
    angles = ", ".join(f"{math.degrees(angle):g}" for angle in throws)
    if not orders:
        return f"throws [{angles}] deg let cylinders fire at once, and in a firing order each has its turn"
    nearest = min(orders, key=lambda o: max(o.intervals) - min(o.intervals))
    text = f"throws [{angles}] deg contradict the firing intervals allowed, {phasing.intervals.text}"
    return f"{text}; the most even order of these throws has intervals {interval_range(nearest.intervals)}"


def interval_range(intervals: Sequence[float]) -> str:
    """Return the shortest and longest of some firing intervals [rad], in words."""
    return f"from {abs(math.degrees(min(intervals))):.6g} to {math.degrees(max(intervals)):.6g} deg"


def distinct_orders(
    problem: Problem, phasing: Phasing, candidate: Candidate, steps: Sequence[int] | None = None
) -> tuple[RankedOrder, ...]:
    """Return firing orders of a star that the loads tell apart: one, unless gas is felt and they are uneven (S8).

    Each of them twists the crankshaft in a way of its own (V6).
    """
    orders = ranked_orders(phasing, candidate, steps)
    if problem.depends_on_firing_order:
        return orders
    return orders if problem.depends_on_gas and not all(order.is_even for order in orders) else orders[:1]


def free_balance(places: Sequence[float], throws: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return |F_h| and |C_h| of the orders of a ranking, for one force a throw and unit spacing (S1)."""
    x = np.array(places)
    spacing = float(np.abs(np.diff(x)).max()) if len(x) > 1 else 1.0
    weights = np.stack([np.ones_like(x), x / spacing], axis=1)
    sums = np.abs(star_sum(weights, [as_turn(angle) for angle in throws], np.array(ORDERS)))
    return tuple(float(v) for v in sums[:, 0]), tuple(float(v) for v in sums[:, 1])


def ranked_star(
    phasing: Phasing, candidate: Candidate, steps: Sequence[int] | None, value: float, bound: float, proven: bool
) -> RankedStar:
    """Return one entry of a ranking."""
    orders = ranked_orders(phasing, candidate, steps)
    forces, couples = free_balance(phasing.layout_of(candidate).throw_positions, candidate.throws)
    return RankedStar(
        candidate.throws, candidate.bank_angle, candidate.split_pin, phasing.built(candidate), value, bound, proven,
        forces, couples, ORDERS, orders[:ORDERS_LISTED], len(orders), bool(orders) and orders[0].is_even,
    )  # fmt: skip


def candidates_of(phasing: Phasing, ranking: Sequence[RankedStar], orders: int = 1) -> list[Candidate]:
    """Return the designs of a ranking, each star with the first few of its firing orders."""
    return [
        Candidate(
            s.throws, fired.order, s.bank_angle, s.split_pin,
            tuple(name for names in phasing.shafts.optional for name in names if name not in s.shafts),
        )
        for s in ranking
        for fired in s.firing_orders[:orders]
    ]  # fmt: skip


def ranking_result(
    phasing: Phasing, best: Candidate, ranking: Sequence[RankedStar], designs: int, looked_at: int, method: str
) -> PhasingResult:
    """Return the stars that were decided, the best design first."""
    layout = phasing.layout_of(best)
    return PhasingResult(tuple(ranking), layout.throw_positions, layout.banks, designs, looked_at, method)
