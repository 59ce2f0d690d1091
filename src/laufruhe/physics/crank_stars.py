"""Crank stars, their enumeration, and their force and couple of every order (S1-S3).

A star puts every throw on one of P equal steps of a turn. Of identical throws it fixes
everything that inertia does to the block by two complex numbers an order,

    F_h = sum_k e^{i h theta_k}        C_h = sum_k x_k e^{i h theta_k},

so millions of stars are compared without a load being computed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import ComplexArray
from laufruhe.numerics.exact_angles import phasors

Stars = NDArray[np.uint8]

# a table of joined throws with so many rows fits into the second-level cache
_TABLE_ROWS = 300
_CHUNK = 1 << 15


def star_sums(stars: Stars, phases: int, places: Sequence[float], orders: Sequence[int]) -> ComplexArray:
    """Return free force F_h and couple C_h of many crank stars, for one unit force a throw, (n, orders, 2) (S1).

    A star (throws,) has the step of every throw, 0 to phases - 1.
    """
    waves = phase_waves(phases, orders).T
    single = [np.stack([waves, x * waves], axis=-1).reshape(phases, -1).view(float) for x in places]
    width = 1
    while width < len(places) and phases ** (width + 1) <= _TABLE_ROWS:
        width += 1
    # sums of F_h and C_h over groups of throws, a row for each combination of steps
    groups = [tuple(range(k, min(k + width, len(places)))) for k in range(0, len(places), width)]
    tables = []
    for group in groups:
        joined = single[group[0]]
        for k in group[1:]:
            joined = (joined[:, None, :] + single[k][None, :, :]).reshape(len(joined) * phases, -1)
        tables.append(np.ascontiguousarray(joined))
    out = np.empty((len(stars), 4 * len(orders)))
    for start in range(0, len(stars), _CHUNK):
        block = stars[start : start + _CHUNK]
        total = out[start : start + _CHUNK]
        for number, (table, group) in enumerate(zip(tables, groups, strict=True)):
            index = block[:, group[0]].astype(np.intp)
            for column in group[1:]:
                index *= phases
                index += block[:, column]
            if number == 0:
                np.take(table, index, axis=0, out=total)
            else:
                total += table[index]
    return out.view(complex).reshape(len(stars), len(orders), 2)


def phase_waves(phases: int, orders: Sequence[int]) -> ComplexArray:
    """Return e^{i h theta} of every step, shape (orders, phases), with the symmetries of the circle."""
    return phasors([Fraction(p, phases) for p in range(phases)], np.array(orders, dtype=np.int64))


BLOCK = 1 << 14


@dataclass(frozen=True)
class StarSpace:
    """Stars of identical throws on equal steps of a turn.

    Attributes
    ----------
    phases
        Steps P of a turn.
    patterns
        How many throws stand on each step, shape (patterns, P); the first throw is on step 0.
    places
        Of the throws along x [m].
    mirror, reflect
        Whether a star equals its front-back mirror image, and the star that turns the
        other way round, in all measures of the problem (S2).
    """

    phases: int
    patterns: tuple[tuple[int, ...], ...]
    places: tuple[float, ...]
    mirror: bool = False
    reflect: bool = False

    @property
    def throws(self) -> int:
        """Number of throws."""
        return len(self.places)

    @property
    def first(self) -> tuple[int, ...]:
        """First star: throws on the steps in their order."""
        return tuple(step for step, times in enumerate(self.patterns[0]) for _ in range(times))

    @property
    def size(self) -> int:
        """Number of stars with the first throw on step 0, images counted."""
        total = 0
        for pattern in self.patterns:
            rest = [pattern[0] - 1, *pattern[1:]]
            total += math.factorial(sum(rest)) // math.prod(math.factorial(count) for count in rest)
        return total

    def images(self, stars: Stars) -> list[Stars]:
        """Return crank stars and their equivalent images: front and back swapped, and turned the other way round (S2).

        Every image is turned so that its first throw stands at step 0.
        """
        block = np.asarray(stars, dtype=np.int16)
        out = [block]
        if self.mirror:
            out.append(block[:, ::-1])
        if self.reflect:
            out += [-image for image in out]
        return [((image - image[:, :1]) % self.phases).astype(np.uint8) for image in out]

    def canonical(self, stars: Stars) -> Stars:
        """Return one representative of each crank star's images, the first in dictionary order, (n, throws) (S2)."""
        best, *others = self.images(stars)
        for other in others:
            differs = best != other
            first = np.argmax(differs, axis=1)
            rows = np.arange(len(best))
            smaller = differs.any(axis=1) & (other[rows, first] < best[rows, first])
            best = np.where(smaller[:, None], other, best)
        return best

    def blocks(self) -> Iterator[Stars]:
        """Yield all crank stars, one of each set of equivalent images, in blocks of shape (n, throws)."""
        for pattern in self.patterns:
            left = np.array([pattern], dtype=np.uint8)
            left[0, 0] -= 1
            # stars, the throws that each step still takes, and how many throws are placed; depth first, so that at
            # most a block for every throw and step waits
            waiting = [(np.zeros((1, self.throws), dtype=np.uint8), left, 1)]
            while waiting:
                stars, counts, placed = waiting.pop()
                if placed == self.throws:
                    is_canonical = np.all(self.canonical(stars) == stars, axis=1)
                    if is_canonical.any():
                        yield stars[is_canonical]
                    continue
                rows, steps = np.nonzero(counts)
                stars, counts = stars[rows], counts[rows]
                stars[:, placed] = steps
                counts[np.arange(len(rows)), steps] -= 1
                for start in range(0, len(stars), BLOCK):
                    part = slice(start, start + BLOCK)
                    waiting.append((stars[part], counts[part], placed + 1))
