"""Open throws, firing orders, banks and shafts (S6-S10)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Generic, NamedTuple, TypeVar

from laufruhe.errors import ModelError, counted
from laufruhe.machine import Cycle
from laufruhe.machine.firing import even_orders, firing_lattice, slot_order, slot_steps, star_throws
from laufruhe.machine.layouts import Layout, even_throws

P = TypeVar("P")

SOONEST = 1e-8
"""Firing interval below which two cylinders count as firing together [rad]."""
# largest number of cylinders whose firing orders are all tried for start cranks
_MAX_PERMUTED = 7
# largest number of evenly firing start cranks
_EVEN_STARS = 3


class OrderCriterion(StrEnum):
    """Criterion that ranks firing orders of one crank star."""

    ROLL_MOMENT = "roll moment"
    NEIGHBOURS = "neighbours"
    LONGEST_GAP = "longest gap"


@dataclass(frozen=True)
class Intervals:
    """Bounds on every firing interval [rad]."""

    minimum: float
    maximum: float

    def holds(self, intervals: Sequence[float], slack: float = 1e-7) -> bool:
        """Return True if all intervals lie within the bounds."""
        return min(intervals) >= self.minimum - slack and max(intervals) <= self.maximum + slack

    @property
    def text(self) -> str:
        """Text of the bounds."""
        return f"{math.degrees(self.minimum):g} to {math.degrees(self.maximum):g} deg"

    @property
    def forbid_unevenness(self) -> bool:
        """True if the bounds allow equal intervals only."""
        return self.maximum - self.minimum <= 1e-9


@dataclass(frozen=True)
class Candidate:
    """Choice of throws, firing order, bank angle and shafts; other open numbers stay open.

    Attributes
    ----------
    throws
        Angles of the throws [rad] (C3).
    firing_order
        Cylinder numbers; None lets each cylinder fire at its first dead centre.
    bank_angle, split_pin
        Angles [rad]; None if the layout has none.
    left_out
        Names of the optional shafts that are not built.
    without_gas
        True to leave out gas, for partial engines that could not run.
    """

    throws: tuple[float, ...]
    firing_order: tuple[int, ...] | None = None
    bank_angle: float | None = None
    split_pin: float | None = None
    left_out: tuple[str, ...] = ()
    without_gas: bool = False


class OpenAngles(NamedTuple):
    """Angles of the layout that are open: True for each."""

    bank: bool
    split: bool


NO_OPEN_ANGLES = OpenAngles(bank=False, split=False)


@dataclass(frozen=True)
class ShaftChoice:
    """Sets of optional shafts that may be built together (S10).

    Attributes
    ----------
    optional
        Sets of shaft names with coupled unbalances; each set is built completely or not at all.
    masses
        Mass of each set without its unbalances [kg].
    maximum
        Largest number of shafts; infinite without a limit.
    most_mass
        Largest mass of the shafts [kg].
    clashes
        Groups of indices of sets that collide if all are built.
    """

    optional: tuple[tuple[str, ...], ...] = ()
    masses: tuple[float, ...] = ()
    maximum: float = math.inf
    most_mass: float = math.inf
    clashes: tuple[tuple[int, ...], ...] = ()

    @property
    def allowed(self) -> tuple[tuple[int, ...], ...]:
        """Sets of optional shafts that may be built together, as tuples of indices.

        They satisfy the limits of number and mass, and their shafts do not collide.
        """
        count = len(self.optional)
        choices = (tuple(k for k in range(count) if code >> k & 1) for code in range(1 << count))
        return tuple(
            built
            for built in choices
            if sum(len(self.optional[k]) for k in built) <= self.maximum
            and sum(self.masses[k] for k in built) <= self.most_mass * (1.0 + 1e-12)
            and not any(set(clash) <= set(built) for clash in self.clashes)
        )

    @property
    def largest(self) -> tuple[tuple[int, ...], ...]:
        """Maximal allowed choices; smaller ones cannot be better, because a built shaft may have zero unbalance."""
        return tuple(b for b in self.allowed if not any(set(b) < set(other) for other in self.allowed))


@dataclass(frozen=True, eq=False)
class PhasingOf(Generic[P]):
    """Open throws, firing order, bank angles and shafts of an engine, with bounds and search settings.

    Attributes
    ----------
    layout
        Function that returns the layout of a bank angle [rad] and a split pin angle [rad].
    throws
        Given throws [rad]; None if the crank star is open.
    throw_bounds
        Bounds of every throw [rad] if these are open one by one, else None.
    firing_order
        Given order; None if it is open.
    bank, split
        Bounds [rad], equal for a given angle; None if the layout has none.
    steps
        Number of steps of a turn for throws; None for those of even firing.
    best
        Number of crank stars in the ranking.
    criteria
        Criteria that rank firing orders, the most important first.
    time_limit
        Time limit of the search [s].
    lists_all
        True if a search evaluates every crank star, so that the ranking is proven throughout.
    thorough
        True if throws are also searched by boxes, and with less unevenness than allowed to show its worth.
    problem_of
        Function that returns the problem of a candidate.
    """

    cycle: Cycle
    layout: Callable[[float | None, float | None], Layout]
    cylinders: int
    throws: tuple[float, ...] | None
    throw_bounds: tuple[tuple[float, float], ...] | None
    firing_order: tuple[int, ...] | None
    bank: tuple[float, float] | None
    split: tuple[float, float] | None
    intervals: Intervals
    problem_of: Callable[[Candidate], P]
    steps: int | None = None
    shafts: ShaftChoice = ShaftChoice()
    best: int = 10
    criteria: tuple[OrderCriterion, ...] = (OrderCriterion.NEIGHBOURS, OrderCriterion.LONGEST_GAP)
    time_limit: float = 600.0
    lists_all: bool = False
    thorough: bool = True

    def layout_of(self, candidate: Candidate) -> Layout:
        """Return the layout of a design."""
        return self.layout(candidate.bank_angle, candidate.split_pin)

    def without(self, built: Sequence[int]) -> tuple[str, ...]:
        """Return the names of optional shafts that are not built, from the indices of the built sets."""
        return tuple(name for k, names in enumerate(self.shafts.optional) if k not in built for name in names)

    def built(self, candidate: Candidate) -> tuple[str, ...]:
        """Return the names of the optional shafts that a candidate has."""
        return tuple(name for names in self.shafts.optional for name in names if name not in candidate.left_out)

    @property
    def shares_throws(self) -> bool:
        """True if several cylinders share a throw."""
        return len(self.layout(*self.minimum_geometry).throw_positions) < self.cylinders

    @property
    def minimum_geometry(self) -> tuple[float | None, float | None]:
        """Lower bounds of bank angle and split pin [rad]; None if the layout has none."""
        return (None if self.bank is None else self.bank[0]), (None if self.split is None else self.split[0])

    @property
    def even_interval(self) -> float:
        """Crank angle between firings at even firing [rad]."""
        return self.cycle.angle / self.cylinders

    @property
    def continuous(self) -> bool:
        """True if throws may leave the even steps."""
        return self.throw_bounds is not None or (self.throws is None and not self.intervals.forbid_unevenness)

    @property
    def is_geometry_open(self) -> OpenAngles:
        """True for an open bank angle, and for open split pins."""
        return OpenAngles(*(pair is not None and pair[0] < pair[1] for pair in (self.bank, self.split)))

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the open parts of the phasing: throws, firing order, bank angle, split pin or shafts."""
        names = (
            ("throws", self.throws is None),
            ("firing order", self.firing_order is None),
            ("bank angle", self.is_geometry_open.bank),
            ("split pin angle", self.is_geometry_open.split),
            (f"which of {counted(sum(map(len, self.shafts.optional)), 'shaft')} are built", bool(self.shafts.optional)),
        )
        return tuple(name for name, is_open in names if is_open)

    def star(
        self, steps: Sequence[int], phases: int, geometry: tuple[float | None, float | None],
        left_out: tuple[str, ...] = (),
    ) -> Candidate:  # fmt: skip
        """Return the candidate of a crank star with even firing, with the first of its firing orders.

        The angles of its throws are `steps`, of which one turn has `phases`. `geometry` has bank angle and split pin
        angle [rad], and `left_out` the shafts that are not built.
        """
        layout = self.layout(*geometry)
        order = self.firing_order or next(even_orders(self.cycle, layout, steps), None)
        return Candidate(star_throws(layout, steps, phases), order, *geometry, left_out)

    def fired(
        self, slots: Sequence[int], geometry: tuple[float | None, float | None], left_out: tuple[str, ...] = ()
    ) -> Candidate:
        """Return the candidate whose cylinders, each on its own throw, fire in these slots of the cycle (S6, V9).

        See `star` for `geometry` and `left_out`.
        """
        steps = slot_steps(self.cycle, slots)
        throws = star_throws(self.layout(*geometry), steps, firing_lattice(self.cycle, self.cylinders).steps)
        return Candidate(throws, slot_order(slots), *geometry, left_out)

    @property
    def geometries(self) -> tuple[tuple[float | None, float | None], ...]:
        """Pairs of bank angle and split pin angle within their bounds at which even firing is possible (S6) [rad].

        If both are open, three bank angles are tried: the bounds and the middle.
        """
        if self.bank is None:
            return ((None, None),)
        split = self.split or (0.0, 0.0)
        bank_open, split_open = self.is_geometry_open
        step = math.tau / (self.cylinders // math.gcd(self.cycle.turns, self.cylinders))

        def multiples(bounds: tuple[float, float], offset: float) -> list[float]:
            # values between bounds whose sums with `offset` are multiples of the step
            low = math.ceil((bounds[0] + offset) / step - 1e-9)
            high = math.floor((bounds[1] + offset) / step + 1e-9)
            return [m * step - offset for m in range(low, high + 1)]

        if bank_open and not split_open:
            return tuple((b, split[0]) for b in multiples(self.bank, split[0]))
        banks = sorted({*self.bank, 0.5 * (self.bank[0] + self.bank[1])}) if bank_open else [self.bank[0]]
        return tuple((b, s) for b in banks for s in (multiples(split, b) if split_open else [split[0]]))


def bounded_stars(phasing: PhasingOf[Any], layout: Layout) -> list[tuple[float, ...]]:
    """Return throw angles [rad] at which searches start: the middle of their bounds, then the nearest with even firing.

    For more than seven cylinders without a firing order, only the middle is returned.
    """
    bounds = phasing.throw_bounds or ()
    if phasing.firing_order is not None:
        orders = [phasing.firing_order]
    elif phasing.cylinders <= _MAX_PERMUTED:
        orders = [(1, *remaining) for remaining in itertools.permutations(range(2, phasing.cylinders + 1))]
    else:
        orders = []
    moves: dict[tuple[float, ...], float] = {}
    for order in orders:
        try:
            throws = even_throws(phasing.cycle, layout, order)
        except ModelError:
            continue
        bounded = tuple(
            min(max(angle + math.tau * round((0.5 * (low + high) - angle) / math.tau), low), high)
            for angle, (low, high) in zip(throws, bounds, strict=True)
        )
        moves[bounded] = sum(1.0 - math.cos(a - b) for a, b in zip(bounded, throws, strict=True))
    middle = tuple(0.5 * (low + high) for low, high in bounds)
    return [middle, *sorted(moves, key=lambda star: round(moves[star], 12))[:_EVEN_STARS]]
