"""Least sum of numbers that go one way with each open number, some of them limited (T9).

On a box such a number is least at one corner. Boxes whose least sum is not under that of a design known, or on which
a limit is broken everywhere, are dropped; the sides of the others are cut where that shows, and they are halved: the
least sum on what is left bounds every design allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import parted
from laufruhe.numerics.witness import EXCESS
from laufruhe.prove.best_first import Box, Divided, Halving, Over, halves, widest
from laufruhe.prove.witness import Known, check_around, thin

MOST_BOXES = 4000
# halvings of a side that is cut
CUTS = 10


@dataclass(frozen=True, eq=False)
class OneWay:
    """A number, and for each open number whether it never falls (1) or never rises (-1) where that grows."""

    value: Callable[[Array], float]
    ways: Array

    def least_at(self, lower: Array, upper: Array) -> Array:
        """The corner of a box where it is least."""
        return np.where(self.ways > 0.0, lower, upper)

    def least(self, lower: Array, upper: Array) -> float:
        """On a box."""
        return self.value(self.least_at(lower, upper))


@dataclass(frozen=True, eq=False)
class OneWayProblem:
    """Least weighted sum of numbers, others kept under their maxima.

    Attributes
    ----------
    terms, limits
        (weight, number), (maximum, number) pairs.
    lower, upper
        Bounds of what is open, shape (n,).
    """

    terms: tuple[tuple[float, OneWay], ...]
    limits: tuple[tuple[float, OneWay], ...]
    lower: Array
    upper: Array

    def value(self, x: Array) -> float:
        """The sum."""
        return sum(weight * term.value(x) for weight, term in self.terms)

    def least(self, lower: Array, upper: Array) -> float:
        """That the sum is not under on a box."""
        return sum(weight * term.least(lower, upper) for weight, term in self.terms)

    @property
    def goes_one_way(self) -> bool:
        """Whether the whole sum does."""
        return all(np.array_equal(term.ways, self.terms[0][1].ways) for _, term in self.terms)

    def under(self, best: float) -> OneWayProblem:
        """With what is as good as a design for a further limit, where the whole sum goes one way."""
        if not self.terms or not self.goes_one_way or not math.isfinite(best):
            return self
        return replace(self, limits=(*self.limits, (best, OneWay(self.value, self.terms[0][1].ways))))


class _OneWayBoxes(Halving):
    """Boxes of what is open, each cut."""

    what = "boxes"

    def __init__(self, problem: OneWayProblem, value: float, room: float, known: Known | None = None) -> None:
        super().__init__(value, room, known)
        self._given, self._problem = problem, problem.under(self.enough)

    @property
    def level(self) -> float:
        """Boxes are cut as far as no design in what is cut off is better than enough."""
        return self.enough if self._problem is not self._given else math.inf

    def bounded(self, lower: Array, upper: Array) -> tuple[float, Box] | Over:
        """A box without what breaks limits, and its least sum."""
        kept = _cut(self._problem, lower, upper)
        if kept is None:
            return Over(self.level)
        return self._problem.least(*kept), Box(*kept, widest(*kept, self._problem.upper - self._problem.lower))

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | Over]:
        """Halves by the middle of the side that is longest beside its bounds."""
        return [self.bounded(*half) for box in boxes for half in halves(box)]


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin boxes, cut by designs that are no better than the known one."""

    problem: OneWayProblem
    known: Known
    what: str = _OneWayBoxes.what

    def around(self, place: Array) -> tuple[Array, Array]:
        """Return a thin box around a place."""
        return thin(place, self.problem.lower, self.problem.upper)

    def bound(self, box: tuple[Array, Array]) -> float:
        """Return the least sum of a box, infinite where limits cut off all of it."""
        found = _OneWayBoxes(self.problem, self.known.value * (1.0 + EXCESS), 0.0).bounded(*box)
        return math.inf if isinstance(found, Over) else found[0]


def divided(
    problem: OneWayProblem, value: float, room: float, most: int = MOST_BOXES, known: Known | None = None
) -> Divided:  # fmt: skip
    """Halve boxes, the least first, until none may hold a design that is `room` better than `value` (T9)."""
    boxes = _OneWayBoxes(problem, value, room, known)
    if known is not None:
        check_around(_Around(problem, known), known.place, known)
    return boxes.run(boxes.bounded(problem.lower, problem.upper), most)


def _with(x: Array, k: int, value: float) -> Array:
    out = x.copy()
    out[k] = value
    return out


def _cut(problem: OneWayProblem, lower: Array, upper: Array) -> tuple[Array, Array] | None:
    """A box without ends of its sides where a limit is broken all over; None where it is so everywhere."""
    if any(number.least(lower, upper) > maximum for maximum, number in problem.limits):
        return None
    for k in range(len(lower)):
        # a number that falls is large at the lower end, even with all others where it is least
        low = _last(_broken(problem, lower, upper, k, -1.0), lower[k], upper[k])
        high = _last(_broken(problem, lower, upper, k, 1.0), upper[k], low)
        lower, upper = _with(lower, k, low), _with(upper, k, high)
    return lower, upper


def _broken(problem: OneWayProblem, lower: Array, upper: Array, k: int, way: float) -> Callable[[float], bool]:
    """Whether a limit that goes one way with an open number is broken all over a slice of a box."""
    told = [(most, number, number.least_at(lower, upper)) for most, number in problem.limits if number.ways[k] == way]
    return lambda at: any(number.value(_with(corner, k, at)) > most for most, number, corner in told)


def _last(broken: Callable[[float], bool], start: float, end: float) -> float:
    """How far from its start a side may be cut: the last place known to be broken, or the start where nothing is."""
    if start == end or not broken(start):
        return start
    return parted(broken, start, end, CUTS)[0]
