"""Least sum of numbers that go one way with each open number, some of them limited (T9).

On a box such a number is least at one corner. Boxes whose least sum is not under the design found, or on which a
limit is broken everywhere, are dropped; the sides of the others are cut where that shows, and they are halved: the
least sum on what is left bounds every design allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import parted
from laufruhe.prove.best_first import Box, Division, Parts, Waiting, halves, widest

MOST_BOXES = 4000
# halvings of a side that is cut, and of a line through a box on the way to a design
CUTS, HALVINGS = 10, 30
# of the gap that counts as proven, what is left for roundings
NEARLY = 0.5


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

    def keeps(self, x: Array) -> bool:
        """Whether all limits hold."""
        return all(number.value(x) <= maximum for maximum, number in self.limits)

    @property
    def goes_one_way(self) -> bool:
        """Whether the whole sum does."""
        return all(np.array_equal(term.ways, self.terms[0][1].ways) for _, term in self.terms)

    def under(self, best: float) -> OneWayProblem:
        """With what is as good as a design for a further limit, where the whole sum goes one way."""
        if not self.terms or not self.goes_one_way or not math.isfinite(best):
            return self
        return replace(self, limits=(*self.limits, (best, OneWay(self.value, self.terms[0][1].ways))))


@dataclass(frozen=True, eq=False)
class Divided:
    """What dividing the bounds has shown.

    Attributes
    ----------
    x
        The best design found; None where no design keeps the limits.
    bound
        No design allowed has a smaller sum.
    boxes
        That were looked at.
    complete
        Whether nothing is left that could be better than the tolerance tells apart.
    """

    x: Array | None
    bound: float
    boxes: int
    complete: bool


class _OneWayBoxes(Division[Box]):
    """Boxes of what is open, and the best design found in them."""

    what = "boxes"

    def __init__(self, problem: OneWayProblem, tolerance: float) -> None:
        self._problem, self._tolerance = problem, tolerance
        self.best: Array | None = None

    def look(self, part: Box) -> None:
        """Designs on lines through a box."""
        for x in _designs(self._problem, part.lower, part.upper):
            if self._problem.value(x) < self.value:
                self.value, self.best = self._problem.value(x), x

    def is_done(self, one: Waiting[Box]) -> bool:
        """Whether nothing in it is better by what the tolerance tells apart."""
        return one.bound >= self.value - NEARLY * self._tolerance * abs(self.value)

    def box(self, problem: OneWayProblem, lower: Array, upper: Array) -> tuple[float, Box] | None:
        """A box without what breaks limits, and its least sum."""
        kept = _cut(problem, lower, upper)
        if kept is None:
            return None
        return self._problem.least(*kept), Box(*kept, widest(*kept, self._problem.upper - self._problem.lower))

    def parts(self, taken: Sequence[Waiting[Box]]) -> Parts[Box]:
        """Halves by the middle of the side that is longest beside its bounds."""
        for half in halves(taken[0].part):
            found = self.box(self._problem.under(self.value), *half)
            yield found if found is not None and found[0] < self.value else None


def divided(problem: OneWayProblem, tolerance: float, most: int = MOST_BOXES) -> Divided:
    """The best design to a relative tolerance, and the bound that shows it (T9)."""
    boxes = _OneWayBoxes(problem, tolerance)
    bound = boxes.divide(boxes.box(problem, problem.lower, problem.upper), most)
    return Divided(boxes.best, min(bound, boxes.value), boxes.seen, boxes.complete)


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


def _designs(problem: OneWayProblem, lower: Array, upper: Array) -> Sequence[Array]:
    """Designs of a box that keep the limits: on lines along the last open number the ends of what is allowed."""
    found = []
    for share in (0.0, 0.5, 1.0):
        at = lower + share * (upper - lower) if share < 1.0 else upper
        line = lower[-1], upper[-1]
        first = _edge(_kept(problem, at, -1.0), *line)
        last = _edge(_kept(problem, at, 1.0), *line[::-1])
        if first is not None and last is not None and first <= last:
            found += [_with(at, -1, value) for value in (first, 0.5 * (first + last), last)]
    return [x for x in found if problem.keeps(x)]


def _kept(problem: OneWayProblem, x: Array, way: float) -> Callable[[float], bool]:
    """Whether the limits that go one way with the last open number hold where it stands."""
    told = [(most, number) for most, number in problem.limits if number.ways[-1] == way]
    return lambda at: all(number.value(_with(x, -1, at)) <= most for most, number in told)


def _edge(holds: Callable[[float], bool], start: float, end: float) -> float | None:
    """The place nearest to the start at which what holds from somewhere on to the end holds, by halving."""
    if holds(start):
        return start
    if not holds(end):
        return None
    return parted(lambda x: not holds(x), start, end, HALVINGS)[1]
