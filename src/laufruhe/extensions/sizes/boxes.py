"""Lower bounds over boxes of sizes, with open unbalances (Z12, Z14).

In a box each factor of a load is smallest at one vertex, because it is monotonic in each size; so are the masses. A
norm of rows affine in masses and unbalances is at least <Z, V>, with Z any subgradient. The minimum of <Z, V> over the
range of masses and the sets of unbalances bounds the norm. Over rod lengths <Z, V> is a short series (Z13). If
unbalances are open, a cone program with the masses as decisions gives multipliers of the whole problem, which bound
the box and each part of it (Z14). Ends of a box without better or without feasible designs are cut off; then the box
is halved.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from laufruhe.extensions.sizes.bundles import Bundle, Monotonicity, SizeNumber, SizeReach, corner
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.programs import CombinedMultipliers, ProposeMultipliers, SizePrograms
from laufruhe.extensions.sizes.rod_series import RodSeries, rod_series
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.branch_and_bound import Box, BoxBisection, BoxResult, FathomedPart, halves, widest
from laufruhe.prove.witness import Witness, thin_box

MAX_BOXES = 3000
# relative tolerance of limits; halvings to find the end of a cut, rounds of cuts, and most tangents of a load
SLACK, HALVINGS, ROUNDS, MAX_TANGENTS = 1e-9, 10, 3, 200
# most tangents of a load if multipliers of the whole problem give better bounds
FEW_TANGENTS = 4
# sets of multipliers that a box inherits
MAX_KNOWN = 2
# relative gap below which programs have all samples
NEAR = 2e-3


class SizeCut(NamedTuple):
    """Part of a box of sizes that is left after cuts: its lower bound, the side to halve, and its multipliers."""

    lower: Array
    upper: Array
    bound: float
    side: int
    multipliers: tuple[CombinedMultipliers, ...]


class SizeBoxes:
    """Lower bounds of the objective over boxes of sizes; whole if no row was set to zero for a kink that passes it.

    The function `ask` proposes multipliers if unbalances are open. A measure that is not monotonic in a size, or a kink
    of a load that moves with the rod length, is a ValueError.
    """

    def __init__(self, model: SizeModel, ask: ProposeMultipliers | None = None) -> None:
        # sampled means may exceed those over the cycle and would not be lower bounds
        self.model, problem = model.averaging(), model.problem
        self.is_whole = True
        # monotonicity of the masses in each size
        self._mass_signs = self._mass_monotonicity()
        self.terms = [(term.weight, self._number(term.measure, 1.0)) for term in problem.objective]
        self.limits: list[tuple[float, SizeNumber, Limit]] = []
        for limit in problem.limits:
            for edge, sense in ((limit.maximum, 1.0), (limit.minimum, -1.0)):
                if math.isfinite(edge):
                    maximum = sense * edge + SLACK * abs(edge)
                    self.limits.append((maximum, self._number(limit.measure, sense), limit))
        self._propose, self._combined = ask, self._programs(ask)
        self.add_tangents(model.lower, model.upper)

    def _programs(self, ask: ProposeMultipliers | None) -> SizePrograms | None:
        if ask is None or not self.model.domains:
            return None
        terms = [(weight, number) for weight, number in self.terms if number.pieces]
        return SizePrograms(self.model, terms, [x[:2] for x in self.limits if x[1].pieces], ask)

    def _number(self, measure: Measure, sense: float) -> SizeNumber:
        if measure.channel.size_value is not None:
            return SizeNumber(
                measure, sense, self._monotonicity(lambda x: np.array([sense * self.model.value(measure, x)]))
            )
        if not measure.norm.is_monotone_in_lengths or sense < 0.0:
            raise ValueError(f"{measure.name} has no lower bound over ranges of open sizes of the running gear")
        pieces = self.model.pieces(measure)

        def factors(x: Array) -> Array:
            engine = self.model.engine(x)
            arrays = [x.ravel() for piece in pieces for x in self.model.factors(piece.positions, measure, engine)]
            return np.concatenate(arrays) if arrays else np.zeros(1)

        if not self.model.moves_rod:
            bundles = tuple(Bundle(RodSeries.fixed(piece, self.model.rod_span[0])) for piece in pieces)
            return SizeNumber(measure, sense, self._monotonicity(factors), bundles)
        start = self.model.problem.engine.slider_cranks[0].rod_length
        masks = self.model.fixed_rows(measure)
        self.is_whole = self.is_whole and all(rows.all() for rows in masks)
        series = rod_series(self.model.pieces_over_length(measure), start, *self.model.rod_span, masks)
        return SizeNumber(measure, sense, self._monotonicity(factors), tuple(map(Bundle, series)))

    def _monotonicity(self, numbers: Callable[[Array], Array]) -> Monotonicity:
        """Return how numbers follow each open size: 1 if all rise, -1 if all fall, 0 if none changes.

        Shape (sizes,).
        """
        lower, upper = self.model.lower, self.model.upper
        monotonicity = np.zeros(len(lower))
        for start in (lower, upper):
            for k in range(len(lower)):
                low, high = (np.where(np.arange(len(lower)) == k, edge, start) for edge in (lower, upper))
                name = f"a measure is not monotonic in {self.model.problem.decisions[k].name}"
                sign = _common_sign(numbers(high) - numbers(low), name)
                if sign * monotonicity[k] < 0.0:
                    raise ValueError(name)
                monotonicity[k] = sign or monotonicity[k]
        return monotonicity

    def _mass_monotonicity(self) -> Monotonicity:
        # 1 for each size if all masses rise with it, -1 if all fall
        corners = self.model.mass_corners
        low, high = self.model.mass_box
        if np.any((low < 0.0) & (high > 0.0)):
            raise ValueError("a mass of the running gear passes zero within the bounds of its sizes; narrow them")
        changes = (np.diff(np.abs(corners), axis=k) for k in range(corners.ndim - 1))
        names = (f"masses are not monotonic in {decision.name}" for decision in self.model.sizes)
        return np.array([_common_sign(*pair) for pair in zip(changes, names, strict=True)])

    def with_limits(self, limits: Sequence[Limit]) -> SizeBoxes:
        """Return the same search with some of the limits alone, and no objective."""
        boxes = copy.copy(self)
        boxes.terms, boxes.limits = [], [limit for limit in self.limits if limit[2] in limits]
        boxes._combined = boxes._programs(self._propose)
        return boxes

    def reach(self, lower: Array, upper: Array) -> SizeReach:
        """Return the ranges of masses and rod length over a box of sizes."""
        ends = (self.model.masses(corner(sign * self._mass_signs, lower, upper)) for sign in (1.0, -1.0))
        light, heavy = ends
        rod = self.model.rod_length(lower), self.model.rod_length(upper)
        return SizeReach(np.minimum(light, heavy), np.maximum(light, heavy), rod, self.model.domains)

    def add_tangents(self, lower: Array, upper: Array) -> None:
        """Add linear lower bounds (tangents) of loads at the masses of a box of sizes."""
        reach, maximum = self.reach(lower, upper), MAX_TANGENTS if self._combined is None else FEW_TANGENTS
        (middle, length), unbalances = reach.middle, self.model.start
        for number in (*(number for _, number in self.terms), *(number for _, number, _ in self.limits)):
            for bundle in number.pieces:
                for masses in (reach.low, middle) if len(bundle.nodes) < maximum else ():
                    bundle.add_tangents(np.append(masses, unbalances), length)

    def minimum(self, number: SizeNumber, lower: Array, upper: Array, reach: SizeReach) -> float:
        """Return a lower bound of a measure over a box of sizes."""
        vertex = corner(number.monotonicity, lower, upper)
        if not number.pieces:
            return number.sense * self.model.value(number.measure, vertex)
        engine = self.model.engine_at(vertex, number.monotonicity)
        return max(self._piece(bundle, number.measure, engine, reach) for bundle in number.pieces)

    def _piece(self, bundle: Bundle, measure: Measure, engine: Engine, reach: SizeReach) -> float:
        factors = self.model.factors(bundle.piece.positions, measure, engine)
        ratio = bundle.piece.ratio(factors)
        if ratio is not None:
            return ratio * bundle.minimum(reach)
        scaled, (masses, length) = Bundle(bundle.lengths.scaled(factors)), reach.middle
        scaled.add_tangents(np.append(masses, self.model.start), length)
        return scaled.minimum(reach)

    def objective(self, lower: Array, upper: Array, multipliers: Sequence[CombinedMultipliers] = ()) -> float:
        """Return a lower bound of the objective over a box of sizes; infinite if multipliers prove it infeasible."""
        reach = self.reach(lower, upper)
        # multipliers of the whole problem replace the bounds of single loads
        numbers = [(w, number) for w, number in self.terms if not (multipliers and number.pieces)]
        bound = sum(weight * self.minimum(number, lower, upper, reach) for weight, number in numbers)
        if self._combined is None or not multipliers:
            return bound
        return bound + max(*(self._combined.minimum(rows, lower, upper, reach) for rows in multipliers), 0.0)

    def violates_limit(self, lower: Array, upper: Array, k: int | None = None, sign: float = 0.0) -> bool:
        """Return True if a limit is violated in the whole box of sizes.

        With an index k, only limits count whose measure rises (sign 1) or falls (-1) with size k.
        """
        reach = self.reach(lower, upper)
        return any(
            self.minimum(number, lower, upper, reach) > maximum
            for maximum, number, _ in self.limits
            if k is None or number.monotonicity[k] == sign
        )

    def cut(
        self, lower: Array, upper: Array, target: float, multipliers: tuple[CombinedMultipliers, ...] = ()
    ) -> SizeCut | None:
        """Return a box of sizes without those ends that have no design below `target`; None if nothing remains."""
        self.add_tangents(lower, upper)
        if self.violates_limit(lower, upper) or self.objective(lower, upper, multipliers) >= target:
            return None
        for _ in range(ROUNDS):
            previous_width = (upper - lower).sum()
            multipliers = self.multipliers_of(lower, upper, target, multipliers)
            if self.objective(lower, upper, multipliers) >= target:
                return None
            for k in range(len(lower)):
                lower, upper = self._without_empty_ends(lower, upper, k, target, multipliers)
            if (upper - lower).sum() > 0.9 * previous_width:
                break
        bound = self.objective(lower, upper, multipliers)
        if bound >= target:
            return None
        side = widest(lower, upper, self.model.upper - self.model.lower)
        return SizeCut(lower, upper, bound, side, multipliers)

    def multipliers_of(
        self, lower: Array, upper: Array, target: float, multipliers: tuple[CombinedMultipliers, ...]
    ) -> tuple[CombinedMultipliers, ...]:
        """Return multipliers of a box of sizes, then those of its parent box.

        They are for all samples if the box's bound is near `target`.
        """
        if self._combined is None:
            return ()
        is_near = bool(multipliers) and self.objective(lower, upper, multipliers) >= (1.0 - NEAR) * target
        rows = self._combined.multipliers_of(lower, upper, self.reach(lower, upper), is_near)
        return multipliers if rows is None else (rows, *multipliers[: MAX_KNOWN - 1])

    def _without_empty_ends(
        self, lower: Array, upper: Array, k: int, target: float, multipliers: Sequence[CombinedMultipliers]
    ) -> tuple[Array, Array]:
        """Return the box of sizes without the ends of side k that are proven to have no better design."""
        is_side = np.arange(len(lower)) == k

        def low_empty(edge: float) -> bool:
            part = lower, np.where(is_side, edge, upper)
            return self.violates_limit(*part, k, -1.0) or (
                bool(multipliers) and self.objective(*part, multipliers) >= target
            )

        first = _end_of_empty_range(low_empty, lower[k], upper[k])
        lower = np.where(is_side, first, lower)

        def high_empty(edge: float) -> bool:
            part = np.where(is_side, edge, lower), upper
            return self.objective(*part, multipliers) >= target or self.violates_limit(*part, k, 1.0)

        return lower, np.where(is_side, _end_of_empty_range(high_empty, upper[k], lower[k]), upper)


def _common_sign(changes: Array, reason: str) -> float:
    rises, falls = bool(np.any(changes > 0.0)), bool(np.any(changes < 0.0))
    if rises and falls:
        raise ValueError(reason)
    return float(rises) - float(falls)


def _end_of_empty_range(is_empty: Callable[[float], bool], start: float, end: float) -> float:
    # end of the range from `start` that is proven to be empty, by halving
    empty_end, open_end = start, end
    for _ in range(HALVINGS if start != end else 0):
        middle = 0.5 * (empty_end + open_end)
        if is_empty(middle):
            empty_end = middle
        elif empty_end == start and abs(middle - start) < 0.02 * abs(end - start):
            break
        else:
            open_end = middle
    return empty_end


class _SizeBox(Box):
    """Box with the multipliers of its bound."""

    multipliers: tuple[CombinedMultipliers, ...] = ()


class _Sizes(BoxBisection):
    """Bisection that cuts each half."""

    what = "boxes of sizes"

    def __init__(self, boxes: SizeBoxes, value: float, gap_tolerance: float, witness: Witness | None = None) -> None:
        super().__init__(value, gap_tolerance, witness)
        self._boxes = boxes

    @property
    def level(self) -> float:
        """Objective up to which bounds of cut boxes hold."""
        return self.cutoff

    def bound_box(
        self, lower: Array, upper: Array, multipliers: tuple[CombinedMultipliers, ...] = ()
    ) -> tuple[float, Box] | FathomedPart:
        """Return the lower bound of a box of sizes, and what remains of the box after its ends are cut off."""
        cut = self._boxes.cut(lower, upper, self.cutoff, multipliers)
        if cut is None:
            return FathomedPart(self.level)
        box = _SizeBox(cut.lower, cut.upper, cut.side)
        box.multipliers = cut.multipliers
        return cut.bound, box

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Return the bound and remainder of each half."""
        return [self.bound_box(*half, getattr(box, "multipliers", ())) for box in boxes for half in halves(box)]


def divided_sizes(
    boxes: SizeBoxes, value: float, gap_tolerance: float, maximum: int = MAX_BOXES, witness: Witness | None = None
) -> BoxResult:  # fmt: skip
    """Return a lower bound of the objective over all sizes, by bisection of boxes (Z12).

    The search ends when no design is better than `value` by more than `gap_tolerance` [SI].
    """
    bisection = _Sizes(boxes, value, gap_tolerance, witness)
    result = bisection.run(bisection.bound_box(boxes.model.lower, boxes.model.upper), maximum)
    if witness is not None:
        thin = thin_box(witness.place, boxes.model.lower, boxes.model.upper)
        boxes.add_tangents(*thin)
        violates = boxes.violates_limit(*thin)
        multipliers = () if violates else boxes.multipliers_of(*thin, witness.value, ())
        witness.check_near(bisection.what, math.inf if violates else boxes.objective(*thin, multipliers))
    return result
