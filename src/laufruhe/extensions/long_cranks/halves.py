"""Every star whose couple of one order lies in a window, by halves that meet (S5).

The couple is a sum over throws, so that of a star is that of its front throws and that of the others. Which steps the
front takes is tried in every way; its arrangements are sorted by their couple, and each arrangement of the others
finds among them those that bring the sum into the window. Two halves of m throws cost m! each where whole stars are
(2 m)! (E. Horowitz, S. Sahni, Computing partitions with applications to the knapsack problem, Journal of the ACM 21,
1974, pages 277 to 292).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.physics.crank_stars import Stars, phase_waves
from laufruhe.physics.star_space import StarSpace

Counts = NDArray[np.uint8]
_AT_ONCE = 1 << 19
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Window:
    """Where the couple of an order may lie: between two corners of the plane [unit of the places].

    Attributes
    ----------
    order
        h of C_h (S1).
    low, high
        Least and largest real and imaginary part.
    """

    order: int
    low: complex
    high: complex


@dataclass(frozen=True, eq=False)
class Free:
    """Throws of a star that may take each other's steps, in two halves.

    Attributes
    ----------
    star
        Steps of the others, and of these as they are.
    front, back
        Throws of the halves.
    """

    star: Stars
    front: tuple[int, ...]
    back: tuple[int, ...]

    @classmethod
    def of(cls, star: Stars, throws: Sequence[int]) -> Free:
        """These throws of a star."""
        middle = len(throws) // 2
        return cls(star, tuple(map(int, throws[:middle])), tuple(map(int, throws[middle:])))

    @classmethod
    def whole(cls, pattern: Sequence[int]) -> Free:
        """All throws of a pattern but the first."""
        star = np.repeat(np.arange(len(pattern)), pattern).astype(np.uint8)
        return cls.of(star, range(1, len(star)))

    def counts(self, phases: int) -> Counts:
        """How many of them stand on every step."""
        own = self.star[[*self.front, *self.back]]
        return np.bincount(own, minlength=phases).astype(np.uint8)

    @property
    def each(self) -> int:
        """Arrangements of the halves of one share."""
        return math.factorial(len(self.front)) + math.factorial(len(self.back))


def shares_of(space: StarSpace, free: Free) -> Counts:
    """How the front may take its steps out of those of both, shape (n, P); images of whole stars are left out (S2)."""
    rest, front = free.counts(space.phases), len(free.front)
    found = np.zeros((1, 0), dtype=np.uint8)
    for step, most in enumerate(rest):
        after = int(rest[step + 1 :].sum())
        taken = found.sum(axis=1, dtype=np.int64)
        grown = [np.column_stack([found, np.full(len(found), k, dtype=np.uint8)]) for k in range(most + 1)]
        left = np.concatenate([front - taken - k for k in range(most + 1)])
        found = np.concatenate(grown)[(left >= 0) & (left <= after)]
    is_whole = len(free.star) == len(free.front) + len(free.back) + 1
    if space.reflect and is_whole and np.array_equal(rest, _turned(rest)):
        mirrored = _turned(found)
        differs = found != mirrored
        first, rows = np.argmax(differs, axis=1), np.arange(len(found))
        found = found[~differs.any(axis=1) | (found[rows, first] < mirrored[rows, first])]
    return found


def _turned(counts: Counts) -> Counts:
    """Throws on every step of the star that turns the other way."""
    return np.roll(counts[..., ::-1], 1, axis=-1)


def work_of(space: StarSpace) -> int:
    """Arrangements of halves that all stars are made of."""
    total = 0
    for pattern in space.patterns:
        free = Free.whole(pattern)
        # coefficients of the product of (1 + z + ... + z^count): in how many ways the front has so many throws
        ways = [1]
        for count in free.counts(space.phases):
            ways = [sum(ways[max(0, k - int(count)) : k + 1]) for k in range(len(free.front) + 1)]
        total += free.each * (ways[-1] // 2 + 1 if space.reflect else ways[-1])
    return total


def meeting(space: StarSpace, free: Free, share: Counts, window: Window) -> Iterator[Stars]:
    """Stars of a share whose couple lies in the window, in blocks; some of them more than once.

    Parameters
    ----------
    share
        Throws of the front on every step, shape (P,).
    """
    front, back, places = list(free.front), list(free.back), np.array(space.places)
    rest = free.counts(space.phases) - share
    own, other = (np.repeat(np.arange(space.phases), counts) for counts in (share, rest))
    waves = phase_waves(space.phases, (window.order,))[0]
    held = np.delete(np.arange(space.throws), [*front, *back])
    near = _sums(waves[own], places[front])
    far = _sums(waves[other], places[back]) + places[held] @ waves[free.star[held]]
    slack = 8.0 * (space.throws + 2) * _EPS * float(np.abs(places).sum()) * (1 + 1j)
    low, high = window.low - slack - far, window.high + slack - far
    order = np.argsort(near.real)
    sides, heights = near.real[order], near.imag[order]
    first = np.searchsorted(sides, low.real)
    last = np.searchsorted(sides, high.real, side="right")
    for left, right in _pairs(first, np.maximum(last - first, 0)):
        inside = (heights[left] >= low.imag[right]) & (heights[left] <= high.imag[right])
        if inside.any():
            stars = np.repeat(free.star[None], int(inside.sum()), axis=0)
            stars[:, front] = own[_permutations(len(front))[order[left[inside]]]]
            stars[:, back] = other[_permutations(len(back))[right[inside]]]
            yield stars


def _pairs(first: Indices, counts: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Of every one of the right so many of the left, from its first: both numbers, as many as memory is wanted for."""
    ends, start = np.cumsum(counts), 0
    while start < len(counts):
        before = int(ends[start - 1]) if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, before + _AT_ONCE, side="right")))
        part = counts[start:stop]
        right = np.repeat(np.arange(start, stop), part)
        yield np.arange(len(right)) + np.repeat(first[start:stop] - (ends[start:stop] - part - before), part), right
        start = stop


def _sums(waves: ComplexArray, places: Array) -> ComplexArray:
    """Couples of these throws on these steps in every order, those of `_permutations`."""
    total = np.zeros(1, dtype=complex)
    for throw, chosen in enumerate(_chosen(len(places))):
        total = np.repeat(total, len(places) - throw) + (places[throw] * waves)[chosen]
    return total


@lru_cache(maxsize=16)
def _chosen(count: int) -> tuple[NDArray[np.int8], ...]:
    """Which of what is left each throw takes, throw by throw, for every beginning of an order."""
    rest, out = np.arange(count, dtype=np.int8)[None, :], []
    for _ in range(count):
        out.append(rest.reshape(-1))
        many, left = rest.shape
        others = np.array([[k for k in range(left) if k != taken] for taken in range(left)], dtype=np.intp)
        rest = rest[:, others.reshape(left, left - 1)].reshape(many * left, left - 1)
    return tuple(out)


@lru_cache(maxsize=16)
def _permutations(count: int) -> NDArray[np.int8]:
    """All orders of so many, shape (count!, count)."""
    out = np.zeros((1, 0), dtype=np.int8)
    for throw, chosen in enumerate(_chosen(count)):
        out = np.column_stack([np.repeat(out, count - throw, axis=0), chosen])
    return out
