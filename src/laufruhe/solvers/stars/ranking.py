"""Rank the best crank stars, and the firing orders of each (S8, S9, S17)."""

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
"""Load orders that a ranking shows."""
ORDERS_LISTED = 6
"""Largest number of firing orders that a ranking lists for a crank star."""


@dataclass(frozen=True)
class RankedOrder:
    """A firing order and the criteria that rank it.

    Attributes
    ----------
    order
        Cylinder numbers, cylinder 1 first.
    neighbours
        Number of successive firings on one throw or on adjacent throws.
    longest_gap
        Largest crank angle between firings of one bank [rad].
    roll_content
        Largest relative amplitude of a roll-moment order below the firing order, 0 to 1.
    intervals
        Firing intervals [rad].
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
        """Return the value of a firing order by a criterion of the ranking, such as neighbours that fire in turn.

        Smaller is better.
        """
        if criterion is OrderCriterion.NEIGHBOURS:
            return float(self.neighbours)
        exact = self.longest_gap if criterion is OrderCriterion.LONGEST_GAP else self.roll_content
        return round(exact, 9)


@dataclass(frozen=True)
class RankedStar:
    """Entry of a ranking of crank stars.

    Attributes
    ----------
    throws
        Throw angles [rad] (C3).
    bank_angle, split_pin
        Bank angle and split pin angle [rad]; None if the layout has none.
    shafts
        Names of the optional shafts that are built.
    value, lower_bound
        Objective with all other decisions at their optimum, and its lower bound over all designs of this star [SI].
    proven
        True if no design outside the ranking is better.
    forces, couples
        |F_h| relative to the force of one throw, and |C_h| relative to that force times the throw spacing, for every
        order in `orders`.
    orders
        Orders h of the loads.
    firing_orders
        Best firing orders of the star, best first.
    order_count
        Number of firing orders of the star.
    even
        True if all firing intervals are equal.
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
    """Point on the trade-off between objective and uneven firing.

    Attributes
    ----------
    allowed, deviation
        Largest deviation of a firing interval from even firing: the limit, and the value of the design [rad].
    value, lower_bound
        Objective, and its lower bound over all designs within the limit [SI].
    throws
        Throw angles [rad].
    kkt_residual
        KKT residual of the nonlinear program.
    """

    allowed: float
    deviation: float
    value: float
    throws: tuple[float, ...]
    kkt_residual: float
    lower_bound: float = 0.0


@dataclass(frozen=True)
class PhasingResult:
    """Ranking of crank stars and firing orders, and the method of the search.

    Attributes
    ----------
    ranking
        Best crank stars, best first; the first is the design of the result.
    places, banks
        Axial positions of the throws [m], and bank angles of the cylinders [rad], for pictures.
    designs
        Number of crank stars times number of sets of shafts.
    looked_at
        Number of partial and complete stars that the search evaluated, or of cone programs.
    trade
        Objective as a function of the largest deviation from even firing.
    even_value
        Objective of the best even star if the design fires unevenly [SI], else None.
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
    """Return the firing orders of a crank star that keep the limits of firing intervals, best first (S8).

    Parameters
    ----------
    phasing
        Limits of intervals, criteria, and the firing order if it is fixed.
    candidate
        Throws and geometry of the star.
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
    entries = []
    for order in itertools.islice(orders, firing.MAX_ORDERS):
        turns = firing.firing_turns(layout, throws, order)
        intervals = firing.intervals_of(phasing.cycle, turns)
        if phasing.intervals.holds(intervals, 1e-6):
            gap = firing.longest_bank_gap(phasing.cycle, layout, order, turns)
            content = firing.order_content(phasing.cycle, turns)
            entries.append(RankedOrder(order, firing.successive_neighbours(layout, order), gap, content, intervals))
    entries.sort(key=lambda o: (*(o.score(criterion) for criterion in phasing.criteria), o.order))
    return tuple(entries)


def why_no_order(phasing: Phasing, throws: Sequence[float]) -> str:
    """Return the reason if fixed throws [rad] have no firing order, in words; empty if they have one."""
    candidate = Candidate(tuple(throws), phasing.firing_order, *phasing.minimum_geometry)
    if ranked_orders(phasing, candidate):
        return ""
    orders = ranked_orders(replace(phasing, intervals=Intervals(0.0, math.inf)), candidate)
    angles = ", ".join(f"{math.degrees(angle):g}" for angle in throws)
    if not orders:
        return f"throws [{angles}] deg let several cylinders fire at once, so they have no firing order"
    nearest = min(orders, key=lambda o: max(o.intervals) - min(o.intervals))
    text = f"throws [{angles}] deg contradict the firing intervals allowed, {phasing.intervals.text}"
    return f"{text}; the most even order of these throws has intervals {interval_range(nearest.intervals)}"


def interval_range(intervals: Sequence[float]) -> str:
    """Return shortest and longest firing interval in words [deg], from intervals [rad]."""
    return f"from {abs(math.degrees(min(intervals))):.6g} to {math.degrees(max(intervals)):.6g} deg"


def distinct_orders(
    problem: Problem, phasing: Phasing, candidate: Candidate, steps: Sequence[int] | None = None
) -> tuple[RankedOrder, ...]:
    """Return the firing orders of a crank star that have different loads, best first (S8).

    All orders are returned if a measure depends on the firing order, such as torsion (V6), or if gas acts and firing
    is uneven. Otherwise, only the first is returned. See `ranked_orders`.
    """
    orders = ranked_orders(phasing, candidate, steps)
    if problem.depends_on_firing_order:
        return orders
    return orders if problem.depends_on_gas and not all(order.is_even for order in orders) else orders[:1]


def ranked_star(
    phasing: Phasing, candidate: Candidate, steps: Sequence[int] | None, value: float, bound: float, proven: bool
) -> RankedStar:
    """Return the entry of a crank star in a ranking, with its firing orders. See `RankedStar`."""
    orders = ranked_orders(phasing, candidate, steps)
    places = np.array(phasing.layout_of(candidate).throw_positions)
    # unit force per throw, and unit throw spacing (S1)
    spacing = float(np.abs(np.diff(places)).max()) if len(places) > 1 else 1.0
    weights = np.stack([np.ones_like(places), places / spacing], axis=1)
    sums = np.abs(star_sum(weights, [as_turn(angle) for angle in candidate.throws], np.array(ORDERS)))
    forces, couples = (tuple(map(float, column)) for column in sums.T)
    return RankedStar(
        candidate.throws, candidate.bank_angle, candidate.split_pin, phasing.built(candidate), value, bound, proven,
        forces, couples, ORDERS, orders[:ORDERS_LISTED], len(orders), bool(orders) and orders[0].is_even,
    )  # fmt: skip


def candidates_of(phasing: Phasing, ranking: Sequence[RankedStar], orders: int = 1) -> list[Candidate]:
    """Return the candidates of a ranking: each crank star with its first `orders` firing orders."""
    return [
        Candidate(
            star.throws, firing.order, star.bank_angle, star.split_pin,
            tuple(name for names in phasing.shafts.optional for name in names if name not in star.shafts),
        )
        for star in ranking
        for firing in star.firing_orders[:orders]
    ]  # fmt: skip


def ranking_result(
    phasing: Phasing, best: Candidate, ranking: Sequence[RankedStar], designs: int, looked_at: int, method: str
) -> PhasingResult:
    """Build the result of a search over crank stars whose best design is `best`. See `PhasingResult`."""
    layout = phasing.layout_of(best)
    return PhasingResult(tuple(ranking), layout.throw_positions, layout.banks, designs, looked_at, method)
