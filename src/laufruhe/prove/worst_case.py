"""The worst errors of a design, and a bound that no errors exceed (R4 to R7).

The objective is convex in the errors, so its largest value stands at a corner of every interval and on the circle of
every disc. Which one is found by branch and bound: an error is held at one end or the other, a circle is parted into
arcs, and what is left free is bounded from above. Every bound comes from rows of the exact model.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.budget import passed
from laufruhe.numerics.progress import tell
from laufruhe.prove.error_parts import ROUNDING, Block, Known, Terms, bounded

Array = NDArray[np.float64]

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
        Of all errors allowed; never under the value.
    nodes
        Parts that the errors were divided into.
    """

    errors: Array
    value: float
    bound: float
    nodes: int


def value_at(terms: Terms, errors: Array) -> float:
    """Weighted sum of the norms at these errors."""
    return sum(weight * norm.value(errors) for weight, norm in terms)


def worst_case(
    terms: Terms, columns: Sequence[slice], tolerance: float, seed: int = 0, most: int = MOST_NODES
) -> WorstCase:
    """The largest weighted sum of norms N(V0 + E z) over intervals and discs.

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
    start = np.zeros(count)
    best = max((_climbed(terms, columns, z) for z in _starts(columns, count, seed)), key=lambda found: found[0])
    if not count:
        return WorstCase(start, best[0], best[0], 0)
    whole = [Block(own, np.eye(own.stop - own.start)) for own in columns]
    order = itertools.count()
    known: Known = [{} for _ in terms]
    first = bounded(terms, start, whole, best[0], known)
    best = max(best, _climbed(terms, columns, first.errors), key=lambda found: found[0])
    queue = [(-first.bound, next(order), start, whole, first.split)]
    nodes = 1
    while queue and -queue[0][0] > best[0] * (1.0 + tolerance) and nodes < most and not passed():
        tell("boxes of errors", nodes)
        above, _, centre, blocks, split = heapq.heappop(queue)
        rest = [block for k, block in enumerate(blocks) if k != split]
        for middle, free in blocks[split].parts(centre):
            own = rest if free is None else [*rest, free]
            part = bounded(terms, middle, own, best[0] * (1.0 + tolerance), known)
            nodes += 1
            best = max(best, (value_at(terms, part.errors), part.errors), key=lambda found: found[0])
            # a part is never worse than the whole
            bound = min(part.bound, -above)
            if own and bound > best[0] * (1.0 + ROUNDING):
                heapq.heappush(queue, (-bound, next(order), middle, own, part.split))
    bound = max(best[0], -queue[0][0] if queue else best[0])
    return WorstCase(best[1], best[0], bound, nodes)


def _starts(columns: Sequence[slice], count: int, seed: int) -> Array:
    """No errors, and random ones that are allowed: a point of the square may lie outside the disc in it."""
    starts = np.random.default_rng(seed).uniform(-1.0, 1.0, (STARTS + 1, count))
    starts[0] = 0.0
    for disc in columns:
        starts[:, disc] /= np.maximum(np.hypot.reduce(starts[:, disc], axis=1), 1.0)[:, None]
    return starts


def _climbed(terms: Terms, columns: Sequence[slice], errors: Array) -> tuple[float, Array]:
    """From some errors to ones that no step along their own slope betters: each step takes the farthest point."""
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
