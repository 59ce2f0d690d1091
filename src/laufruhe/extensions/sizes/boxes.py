"""Bounds of what sizes can reach, and unbalances with them, on boxes of sizes (Z12, Z14).

In a box every factor of a load is least at one corner, for it goes one way with each size; the masses lie between those
of two corners, for so do they. A norm of rows that are affine in masses and unbalances is nowhere under <Z, V>, Z its
subgradient anywhere: its least value over that interval, and over the sets of the unbalances, bounds the norm. Over
lengths of the rod <Z, V> is a short series (Z13). Where unbalances are open a cone program with the masses as decisions
proposes dual rows of all that is asked together, which bound the box and every part of it (Z14). Sides of a box on
which a limit is broken everywhere, or nothing is better than a design known, are cut off; what is left is halved.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from laufruhe.extensions.sizes.bundles import Bundle, SizeNumber, SizeReach, Ways, corner
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.programs import Ask, SizePrograms, Together
from laufruhe.extensions.sizes.rod_series import RodSeries, rod_series
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.branch_and_bound import Box, BoxBisection, BoxResult, FathomedPart, halves, widest
from laufruhe.prove.witness import Witness, check_near_witness, thin_box

MOST_BOXES = 3000
# a limit counts as broken beyond so much of it; halvings of a side that is cut, rounds of that, and bounds of a load
SLACK, HALVINGS, ROUNDS, MOST_TOUCHED = 1e-9, 10, 3, 200
# of a load by itself, where dual rows of all together tell more
FEW_TOUCHED = 4
# dual rows of the last boxes that are kept, and the share of what is to be shown that halving a side has to gain
MOST_KNOWN, WORTH = 2, 0.1
# share of what is to be shown from which dual rows are asked for at all angles
NEAR = 2e-3


class SizeCut(NamedTuple):
    """Rest of a box, its bound, the side worth halving, and the dual rows that gave the bound."""

    lower: Array
    upper: Array
    bound: float
    side: int
    known: tuple[Together, ...]


class SizeBoxes:
    """Bounds of the objective on boxes of sizes.

    Raises
    ------
    ValueError
        If a measure does not go one way with a size, or a bend of a load moves with the length of the rod.

    Parameters
    ----------
    ask
        Function that proposes dual rows where unbalances are open.
    """

    def __init__(self, model: SizeModel, ask: Ask | None = None) -> None:
        # means at a few angles may be more than over the cycle, and would prove too much
        self.model, problem = model.averaging(), model.problem
        # no row is left out for a bend that passes it
        self.is_whole = True
        # for each size whether masses grow with it or fall
        self._light = self._mass_ways()
        self.terms = [(term.weight, self._number(term.measure, 1.0)) for term in problem.objective]
        self.limits: list[tuple[float, SizeNumber, Limit]] = []
        for limit in problem.limits:
            for edge, sense in ((limit.maximum, 1.0), (limit.minimum, -1.0)):
                if math.isfinite(edge):
                    maximum = sense * edge + SLACK * abs(edge)
                    self.limits.append((maximum, self._number(limit.measure, sense), limit))
        self._ask, self._together = ask, self._programs(ask)
        self.touch(model.lower, model.upper)

    def _programs(self, ask: Ask | None) -> SizePrograms | None:
        if ask is None or not self.model.domains:
            return None
        terms = [(weight, number) for weight, number in self.terms if number.pieces]
        return SizePrograms(self.model, terms, [x[:2] for x in self.limits if x[1].pieces], ask)

    def _number(self, measure: Measure, sense: float) -> SizeNumber:
        if measure.channel.of_engine is not None:
            return SizeNumber(measure, sense, self._ways(lambda x: np.array([sense * self.model.value(measure, x)])))
        if not measure.norm.of_row_lengths or sense < 0.0:
            raise ValueError(f"{measure.name} is not bounded on boxes of sizes")
        pieces = self.model.pieces(measure)

        def factors(x: Array) -> Array:
            engine = self.model.engine(x)
            arrays = [array.ravel() for piece in pieces for array in self.model.factors(piece, measure, engine)]
            return np.concatenate(arrays) if arrays else np.zeros(1)

        if not self.model.moves_rod:
            bundles = tuple(Bundle(RodSeries.fixed(piece, self.model.rod_span[0])) for piece in pieces)
            return SizeNumber(measure, sense, self._ways(factors), bundles)
        start = self.model.problem.engine.slider_cranks[0].rod_length
        masks = self.model.fixed_rows(measure)
        self.is_whole = self.is_whole and all(rows.all() for rows in masks)
        series = rod_series(self.model.pieces_over_length(measure), start, *self.model.rod_span, masks)
        return SizeNumber(measure, sense, self._ways(factors), tuple(map(Bundle, series)))

    def _ways(self, numbers: Callable[[Array], Array]) -> Ways:
        """Return for each size if all numbers rise (1) or fall (-1) with it; zero if none changes."""
        lower, upper = self.model.lower, self.model.upper
        ways = np.zeros(len(lower))
        for start in (lower, upper):
            for k in range(len(lower)):
                ends = [np.where(np.arange(len(lower)) == k, edge, start) for edge in (lower, upper)]
                change = numbers(ends[1]) - numbers(ends[0])
                rises, falls = bool(np.any(change > 0.0)), bool(np.any(change < 0.0))
                way = float(rises) - float(falls)
                if (rises and falls) or way * ways[k] < 0.0:
                    raise ValueError(f"a measure does not go one way with {self.model.problem.decisions[k].name}")
                ways[k] = way or ways[k]
        return ways

    def _mass_ways(self) -> Ways:
        """Return for each size if all masses grow (1) or fall (-1) with it."""
        corners = self.model.mass_corners
        low, high = self.model.mass_box
        if np.any((low < 0.0) & (high > 0.0)):
            raise ValueError("a mass of the running gear passes zero")
        ways = np.zeros(corners.ndim - 1)
        for k, decision in enumerate(self.model.sizes):
            change = np.diff(np.abs(corners), axis=k)
            rises, falls = bool(np.any(change > 0.0)), bool(np.any(change < 0.0))
            if rises and falls:
                raise ValueError(f"masses do not go one way with {decision.name}")
            ways[k] = float(rises) - float(falls)
        return ways

    def keeping(self, limits: Sequence[Limit]) -> SizeBoxes:
        """Return the same with some of the limits alone, and no objective."""
        other = copy.copy(self)
        other.terms, other.limits = [], [limit for limit in self.limits if limit[2] in limits]
        other._together = other._programs(self._ask)
        return other

    def reach(self, lower: Array, upper: Array) -> SizeReach:
        """Return the ranges of masses and rod length on a box."""
        ends = (self.model.masses(corner(way * self._light, lower, upper)) for way in (1.0, -1.0))
        light, heavy = ends
        rod = self.model.rod_length(lower), self.model.rod_length(upper)
        return SizeReach(np.minimum(light, heavy), np.maximum(light, heavy), rod, self.model.domains)

    def touch(self, lower: Array, upper: Array) -> None:
        """Add affine functions that loads meet at masses of a box."""
        reach, maximum = self.reach(lower, upper), MOST_TOUCHED if self._together is None else FEW_TOUCHED
        (middle, length), unbalances = reach.middle, self.model.start
        for number in (*(number for _, number in self.terms), *(number for _, number, _ in self.limits)):
            for bundle in number.pieces:
                for masses in (reach.low, middle) if bundle.count < maximum else ():
                    bundle.touch(np.append(masses, unbalances), length)

    def minimum(self, number: SizeNumber, lower: Array, upper: Array, reach: SizeReach) -> float:
        """Return a lower bound of a measure on a box."""
        at = corner(number.ways, lower, upper)
        if not number.pieces:
            return number.sense * self.model.value(number.measure, at)
        engine = self.model.engine(at) if np.any(number.ways) else self.model.problem.engine
        return max(self._piece(bundle, number.measure, engine, reach) for bundle in number.pieces)

    def _piece(self, bundle: Bundle, measure: Measure, engine: Engine, reach: SizeReach) -> float:
        factors = self.model.factors(bundle.piece, measure, engine)
        ratio = bundle.piece.ratio(factors)
        if ratio is not None:
            return ratio * bundle.minimum(reach)
        scaled, (masses, length) = bundle.scaled(factors), reach.middle
        scaled.touch(np.append(masses, self.model.start), length)
        return scaled.minimum(reach)

    def objective(self, lower: Array, upper: Array, known: Sequence[Together] = ()) -> float:
        """Return a lower bound of the objective on a box, infinite where known dual rows exclude it."""
        reach = self.reach(lower, upper)
        # what is known of all loads together is no less than what each tells
        numbers = [(w, number) for w, number in self.terms if not (known and number.pieces)]
        bound = sum(weight * self.minimum(number, lower, upper, reach) for weight, number in numbers)
        if self._together is None or not known:
            return bound
        return bound + max(*(self._together.minimum(rows, lower, upper, reach) for rows in known), 0.0)

    def breaks(self, lower: Array, upper: Array, k: int | None = None, way: float = 0.0) -> bool:
        """Return whether a limit is broken all over a box; with k, of limits that go one `way` with size k."""
        reach = self.reach(lower, upper)
        return any(
            self.minimum(number, lower, upper, reach) > maximum
            for maximum, number, _ in self.limits
            if k is None or number.ways[k] == way
        )

    def cut(self, lower: Array, upper: Array, target: float, known: tuple[Together, ...] = ()) -> SizeCut | None:
        """Return a box without sides that hold no better design; None where nothing is left."""
        self.touch(lower, upper)
        if self.breaks(lower, upper) or self.objective(lower, upper, known) >= target:
            return None
        for _ in range(ROUNDS):
            before = (upper - lower).sum()
            known = self.learned(lower, upper, target, known)
            if self.objective(lower, upper, known) >= target:
                return None
            for k in range(len(lower)):
                lower, upper = self._shaved(lower, upper, k, target, known)
            if (upper - lower).sum() > 0.9 * before:
                break
        bound = self.objective(lower, upper, known)
        if bound >= target:
            return None
        return SizeCut(lower, upper, bound, self._side(lower, upper, known, bound, target), known)

    def learned(self, lower: Array, upper: Array, target: float, known: tuple[Together, ...]) -> tuple[Together, ...]:
        """Return the dual rows of the box and those of the last one; exact ones where the bound is near."""
        if self._together is None:
            return ()
        near = bool(known) and self.objective(lower, upper, known) >= (1.0 - NEAR) * target
        rows = self._together.learned(lower, upper, self.reach(lower, upper), near)
        return known if rows is None else (rows, *known[: MOST_KNOWN - 1])

    def _side(self, lower: Array, upper: Array, known: Sequence[Together], bound: float, target: float) -> int:
        middle, gained = 0.5 * (lower + upper), np.zeros(len(lower))
        for k, here in enumerate(np.eye(len(lower), dtype=bool) if known and target < math.inf else ()):
            first = self.objective(lower, np.where(here, middle, upper), known)
            second = self.objective(np.where(here, middle, lower), upper, known)
            gained[k] = min(first, target) + min(second, target) - 2.0 * bound
        if gained.max() > WORTH * (target - bound):
            return int(np.argmax(gained))
        return widest(lower, upper, self.model.upper - self.model.lower)

    def _shaved(
        self, lower: Array, upper: Array, k: int, target: float, known: Sequence[Together]
    ) -> tuple[Array, Array]:
        """Return the box without as much of both ends of one side as is shown to hold nothing."""
        here = np.arange(len(lower)) == k

        def low_empty(edge: float) -> bool:
            part = lower, np.where(here, edge, upper)
            return self.breaks(*part, k, -1.0) or (bool(known) and self.objective(*part, known) >= target)

        first = _last_empty(low_empty, lower[k], upper[k])
        lower = np.where(here, first, lower)

        def high_empty(edge: float) -> bool:
            part = np.where(here, edge, lower), upper
            return self.objective(*part, known) >= target or self.breaks(*part, k, 1.0)

        return lower, np.where(here, _last_empty(high_empty, upper[k], lower[k]), upper)


def _last_empty(empty: Callable[[float], bool], start: float, end: float) -> float:
    # end of the stretch from `start` that is shown to be empty, by halving
    done, far = start, end
    for _ in range(HALVINGS if start != end else 0):
        middle = 0.5 * (done + far)
        if empty(middle):
            done = middle
        elif done == start and abs(middle - start) < 0.02 * abs(end - start):
            break
        else:
            far = middle
    return done


class _SizeBox(Box):
    """A box, and the dual rows that told of it."""

    known: tuple[Together, ...] = ()


class _Sizes(BoxBisection):
    """Halves of a side, each cut."""

    what = "boxes of sizes"

    def __init__(self, boxes: SizeBoxes, value: float, room: float, known: Witness | None = None) -> None:
        super().__init__(value, room, known)
        self._boxes = boxes

    @property
    def level(self) -> float:
        """Level to which boxes are cut: no design in what is cut off is better."""
        return self.cutoff

    def bound_box(
        self, lower: Array, upper: Array, known: tuple[Together, ...] = ()
    ) -> tuple[float, Box] | FathomedPart:
        """Return the bound of a box and its rest."""
        cut = self._boxes.cut(lower, upper, self.cutoff, known)
        if cut is None:
            return FathomedPart(self.level)
        box = _SizeBox(cut.lower, cut.upper, cut.side)
        box.known = cut.known
        return cut.bound, box

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Return the bounds of each half."""
        return [self.bound_box(*half, getattr(box, "known", ())) for box in boxes for half in halves(box)]


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin boxes."""

    boxes: SizeBoxes
    known: Witness
    what: str = _Sizes.what

    def around(self, place: Array) -> tuple[Array, Array]:
        """Return a thin box around sizes."""
        return thin_box(place, self.boxes.model.lower, self.boxes.model.upper)

    def bound(self, box: tuple[Array, Array]) -> float:
        """Return the bound of a box by the dual rows that it suggests, infinite where it breaks a limit."""
        self.boxes.touch(*box)
        if self.boxes.breaks(*box):
            return math.inf
        return self.boxes.objective(*box, self.boxes.learned(*box, self.known.value, ()))


def divided_sizes(
    boxes: SizeBoxes, value: float, room: float, maximum: int = MOST_BOXES, known: Witness | None = None
) -> BoxResult:  # fmt: skip
    """Halve boxes, the least first, until none may hold a design that is `room` better than `value` (Z12)."""
    division = _Sizes(boxes, value, room, known)
    bound = division.run(division.bound_box(boxes.model.lower, boxes.model.upper), maximum)
    if known is not None:
        check_near_witness(_Around(boxes, known), known.place, known)
    return bound
