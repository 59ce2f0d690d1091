"""Minimum of a weighted sum of functions that are monotone in each open number, under limits on such functions (T9).

On a box such a function is minimal at one corner. A box is dropped if its minimum is not below the objective of the
incumbent, or if a limit is violated everywhere in it. Slices at the sides of a remaining box are cut off by the same
rule, and the box is halved. The minimum over the remaining boxes is a lower bound of the objective.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import bisect_property
from laufruhe.numerics.witness import EXCESS
from laufruhe.prove.branch_and_bound import Box, BoxBisection, BoxResult, FathomedPart, halves, widest
from laufruhe.prove.witness import Witness, thin_box

MAX_BOXES = 4000
# bisections of a side that is cut
CUTS = 10


@dataclass(frozen=True, eq=False)
class Monotone:
    """A function of the open numbers, and the sign of its slope along each of them, shape (n,)."""

    value: Callable[[Array], float]
    signs: Array

    def lowest_corner(self, lower: Array, upper: Array) -> Array:
        """Return the corner of a box at which the function is minimal, shape (n,)."""
        return np.where(self.signs > 0.0, lower, upper)

    def minimum_over(self, lower: Array, upper: Array) -> float:
        """Return the minimum of the function on a box."""
        return self.value(self.lowest_corner(lower, upper))


@dataclass(frozen=True, eq=False)
class MonotoneProblem:
    """Minimise a weighted sum of monotone functions under limits on others, between bounds of shape (n,).

    Terms are pairs of weight and function, and limits pairs of maximum and function.
    """

    terms: tuple[tuple[float, Monotone], ...]
    limits: tuple[tuple[float, Monotone], ...]
    lower: Array
    upper: Array

    def value(self, x: Array) -> float:
        """Return the weighted sum of the terms at open numbers x, shape (n,)."""
        return sum(weight * term.value(x) for weight, term in self.terms)

    def minimum_over(self, lower: Array, upper: Array) -> float:
        """Return a lower bound of the weighted sum on a box."""
        return sum(weight * term.minimum_over(lower, upper) for weight, term in self.terms)

    @property
    def is_monotone(self) -> bool:
        """Return True if all terms rise and fall together in each open number, so that their sum is monotone."""
        return all(np.array_equal(term.signs, self.terms[0][1].signs) for _, term in self.terms)

    def with_cutoff(self, cutoff: float) -> MonotoneProblem:
        """Return the problem with the objective limited to the cutoff, if it is monotone; else the problem itself."""
        if not self.terms or not self.is_monotone or not math.isfinite(cutoff):
            return self
        return replace(self, limits=(*self.limits, (cutoff, Monotone(self.value, self.terms[0][1].signs))))


class _MonotoneBoxes(BoxBisection):
    """Branch and bound over boxes without slices that violate a limit."""

    what = "boxes"

    def __init__(
        self, problem: MonotoneProblem, value: float, gap_tolerance: float, witness: Witness | None = None
    ) -> None:
        super().__init__(value, gap_tolerance, witness)
        self._uncut, self._problem = problem, problem.with_cutoff(self.cutoff)

    @property
    def level(self) -> float:
        """Lower bound of the objective of designs that cuts remove [SI]; infinite if only limits cut."""
        return self.cutoff if self._problem is not self._uncut else math.inf

    def bound_box(self, lower: Array, upper: Array) -> tuple[float, Box] | FathomedPart:
        """Return the lower bound of the objective on a box, and the box without infeasible slices at its ends."""
        problem, lower, upper = self._problem, lower.copy(), upper.copy()
        if any(function.minimum_over(lower, upper) > maximum for maximum, function in problem.limits):
            return FathomedPart(self.level)
        for k in range(len(lower)):
            # a falling function is large at the lower end, even with all other numbers where it is least
            lower[k] = _cut_side(problem, lower, upper, k, -1.0)
            upper[k] = _cut_side(problem, lower, upper, k, 1.0)
        side = widest(lower, upper, problem.upper - problem.lower)
        return problem.minimum_over(lower, upper), Box(lower, upper, side)

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Return the halves of boxes across their relatively longest side."""
        return [self.bound_box(*half) for box in boxes for half in halves(box)]


def bisect_monotone(
    problem: MonotoneProblem, value: float, gap_tolerance: float, max_boxes: int = MAX_BOXES,
    witness: Witness | None = None,
) -> BoxResult:  # fmt: skip
    """Prove a lower bound of a monotone objective by halving boxes of open numbers (T9).

    The search ends when no box can hold a design better than `value` by more than the gap tolerance.

    The objective `value` of the incumbent is infinite without one. Without a witness, bounds are not checked.
    """
    boxes = _MonotoneBoxes(problem, value, gap_tolerance, witness)
    if witness is not None:
        around = _MonotoneBoxes(problem, witness.value * (1.0 + EXCESS), 0.0)
        thin = around.bound_box(*thin_box(witness.place, problem.lower, problem.upper))
        witness.check_near(boxes.what, math.inf if isinstance(thin, FathomedPart) else thin[0])
    return boxes.run(boxes.bound_box(problem.lower, problem.upper), max_boxes)


def _cut_side(problem: MonotoneProblem, lower: Array, upper: Array, k: int, sign: float) -> float:
    """Return the new lower (sign -1) or upper (sign 1) end of side k of a box, moved inwards past infeasible slices.

    A slice is infeasible if a limited function that falls (sign -1) or rises (sign 1) with number k is violated on it.
    """
    limits = [(maximum, f, f.lowest_corner(lower, upper)) for maximum, f in problem.limits if f.signs[k] == sign]
    start, end = (lower[k], upper[k]) if sign < 0.0 else (upper[k], lower[k])

    def is_violated(position: float) -> bool:
        is_side = np.arange(len(lower)) == k
        return any(f.value(np.where(is_side, position, corner)) > maximum for maximum, f, corner in limits)

    return start if start == end or not is_violated(start) else bisect_property(is_violated, start, end, CUTS)[0]
