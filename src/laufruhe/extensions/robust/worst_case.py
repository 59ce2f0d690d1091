"""The worst errors of a design, and a bound that no errors exceed (R4 to R7).

The objective is convex in the errors, so its largest value stands at a corner of every interval and on the circle of
every disc. Which one is found by branch and bound: an error is held at one end or the other, a circle is parted into
arcs, and what is left free is bounded from above. Every bound comes from rows of the exact model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import BoundError
from laufruhe.extensions.robust.error_parts import ROUNDING, Block, Terms, bounded
from laufruhe.extensions.robust.error_parts import Known as Told
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import is_over, report
from laufruhe.prove.best_first import Division, Over, Parts, Waiting
from laufruhe.prove.witness import THIN, Known, check_around

MOST_NODES = 5000
STARTS, CLIMBS = 12, 30
"""Random errors that a climb starts from, and its steps."""


@dataclass(frozen=True, eq=False)
class WorstCase:
    """The worst errors found, what they make, and what no errors exceed.

    Attributes
    ----------
    errors
        Shape (columns,).
    value
        At these errors.
    bound
        Of all errors allowed, raw.
    nodes
        Parts that the errors were divided into.
    """

    errors: Array
    value: float
    bound: float
    nodes: int


def value_at(terms: Terms, errors: Array) -> float:
    """Return the weighted sum of the norms at these errors."""
    return sum(weight * norm.value(errors) for weight, norm in terms)


def worst_case(terms: Terms, columns: Sequence[slice], tolerance: float, most: int = MOST_NODES) -> WorstCase:
    """Return the largest weighted sum of norms N(V0 + E z) over intervals and discs.

    Parameters
    ----------
    terms
        Their decision vector is that of the errors.
    columns
        Of every error: one for an interval of -1 to 1, two for the unit disc.
    tolerance
        Relative distance of bound and value at which the search ends.
    most
        Parts that the errors are divided into.
    """
    count = columns[-1].stop if columns else 0
    best = max((_climbed(terms, columns, z) for z in _starts(columns, count)), key=lambda found: found[0])
    if not count:
        return WorstCase(np.zeros(0), best[0], best[0], 0)
    search = _Errors(terms, tolerance, best)
    whole = [Block(own, np.eye(own.stop - own.start)) for own in columns]
    first = bounded(terms, np.zeros(count), whole, best[0], search.told)
    search.better(_climbed(terms, columns, first.errors))
    bound = search.divide((-first.bound, _Part(np.zeros(count), whole, first.split)), most)
    value, errors = search.best
    if is_over(bound, -value):
        report(BoundError("errors that no engine exceeds", -bound, value))
    return WorstCase(errors, value, -bound, search.seen)


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin parts of the errors; the largest sum is the least of its negative."""

    terms: Terms
    columns: Sequence[slice]
    what: str = "errors that no engine exceeds"

    def around(self, errors: Array) -> tuple[Array, list[Block]]:
        """Return a centre and blocks about it that reach some errors."""
        return (1.0 - THIN) * errors, [Block(own, THIN * np.eye(own.stop - own.start)) for own in self.columns]

    def bound(self, part: tuple[Array, list[Block]]) -> float:
        """Return the bound of a part."""
        return -bounded(self.terms, *part, -math.inf, [{} for _ in self.terms]).bound


def check_worst(terms: Terms, columns: Sequence[slice], found: WorstCase) -> None:
    """Report a bound of a part around the worst errors found that these exceed."""
    check_around(_Around(terms, columns), found.errors, Known(found.errors, -found.value))


@dataclass(frozen=True, eq=False)
class _Part:
    """Errors of which some are held: a centre, blocks that are free, and the one of them to part next."""

    centre: Array
    blocks: list[Block]
    split: int


class _Errors(Division[_Part]):
    """Parts of all errors; the largest bound is the least of what is sought here, its negative."""

    what, of_objective = "boxes of errors", False

    def __init__(self, terms: Terms, tolerance: float, best: tuple[float, Array]) -> None:
        self._terms, self._tolerance, self.best = terms, tolerance, best
        self.told: Told = [{} for _ in terms]

    def better(self, found: tuple[float, Array]) -> None:
        """Keep the worse of the worst errors so far and others."""
        self.best = max(self.best, found, key=lambda each: each[0])

    def is_done(self, one: Waiting[_Part]) -> bool:
        """Return whether no errors are worse by the tolerance."""
        return -one.bound <= self.best[0] * (1.0 + self._tolerance)

    def parts(self, taken: Sequence[Waiting[_Part]]) -> Parts[_Part]:
        """Yield parts with one block held at either end, or its circle parted."""
        ((above, _, own),) = taken
        rest = [block for k, block in enumerate(own.blocks) if k != own.split]
        for middle, free in own.blocks[own.split].parts(own.centre):
            blocks = rest if free is None else [*rest, free]
            part = bounded(self._terms, middle, blocks, self.best[0] * (1.0 + self._tolerance), self.told)
            self.better((value_at(self._terms, part.errors), part.errors))
            # a part is never worse than the whole
            bound = min(part.bound, -above)
            yield (-bound, _Part(middle, blocks, part.split)) if blocks else Over(-bound)


def _starts(columns: Sequence[slice], count: int) -> Array:
    """Return no errors, and random ones that are allowed: a point of the square may lie outside the disc in it."""
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (STARTS + 1, count))
    starts[0] = 0.0
    for disc in columns:
        starts[:, disc] /= np.maximum(np.hypot.reduce(starts[:, disc], axis=1), 1.0)[:, None]
    return starts


def _climbed(terms: Terms, columns: Sequence[slice], errors: Array) -> tuple[float, Array]:
    """Climb from some errors to ones that no step along their own slope betters: each step takes the farthest point."""
    value = value_at(terms, errors)
    for _ in range(CLIMBS):
        slope = np.zeros(len(errors))
        for weight, norm in terms:
            slope += weight * np.einsum("kd,kdn->n", norm.subgradient(errors), norm.slope)
        following = np.zeros(len(errors))
        for own in columns:
            size = float(np.hypot.reduce(slope[own]))
            following[own] = slope[own] / size if size > 0.0 else np.eye(own.stop - own.start)[0]
        found = value_at(terms, following)
        if found <= value * (1.0 + ROUNDING):
            return max((value, errors), (found, following), key=lambda each: each[0])
        value, errors = found, following
    return value, errors
