"""Crank stars whose couple of one order lies in a window, by halves of their throws that meet in the middle (S5).

The couple of a crank star is the sum of the couples of its front half and its back half. For every way to share the
steps between the halves, the arrangements of the front are sorted by their couple. Each arrangement of the back finds
among them those that bring the sum into the window. Two halves of m throws cost m! each where whole stars are (2 m)!
(E. Horowitz, S. Sahni, Computing partitions with applications to the knapsack problem, Journal of the ACM 21, 1974,
pages 277 to 292).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.physics.crank_stars import Stars, StarSpace, phase_waves

Counts = NDArray[np.uint8]
_AT_ONCE = 1 << 19
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Window:
    """Rectangle of allowed couples C_h of one order h (S1), between two corners [unit of the places]."""

    order: int
    low: complex
    high: complex


@dataclass(frozen=True, eq=False)
class Free:
    """Throws of a crank star whose steps may be rearranged, in two halves; `star` has the steps of all throws."""

    star: Stars
    front: tuple[int, ...]
    back: tuple[int, ...]

    @classmethod
    def from_throws(cls, star: Stars, throws: Sequence[int]) -> Free:
        """Return the given throws of a star as free; the first half of them is the front."""
        middle = len(throws) // 2
        return cls(star, tuple(map(int, throws[:middle])), tuple(map(int, throws[middle:])))

    @classmethod
    def from_pattern(cls, pattern: Sequence[int]) -> Free:
        """Return all throws of a pattern as free, except the first."""
        star = np.repeat(np.arange(len(pattern)), pattern).astype(np.uint8)
        return cls.from_throws(star, range(1, len(star)))

    def counts(self, phases: int) -> Counts:
        """Return the number of free throws on each step, shape (phases,)."""
        steps = self.star[[*self.front, *self.back]]
        return np.bincount(steps, minlength=phases).astype(np.uint8)

    @property
    def arrangements(self) -> int:
        """Number of arrangements of both halves, for one division of the steps."""
        return math.factorial(len(self.front)) + math.factorial(len(self.back))


def shares_of(space: StarSpace, free: Free) -> Counts:
    """Return all ways to divide throws between the front and the rear half of a crank.

    A row has the number of front throws on each step, shape (n, phases).

    Divisions of mirror images are left out (S2).
    """
    counts, front = free.counts(space.phases), len(free.front)
    shares = np.zeros((1, 0), dtype=np.uint8)
    for step, maximum in enumerate(counts):
        after = int(counts[step + 1 :].sum())
        placed = shares.sum(axis=1, dtype=np.int64)
        grown = [np.column_stack([shares, np.full(len(shares), k, dtype=np.uint8)]) for k in range(maximum + 1)]
        remaining = np.concatenate([front - placed - k for k in range(maximum + 1)])
        shares = np.concatenate(grown)[(remaining >= 0) & (remaining <= after)]
    is_whole = len(free.star) == len(free.front) + len(free.back) + 1
    # throws on every step of the star that turns the other way
    if space.reflect and is_whole and np.array_equal(counts, np.roll(counts[::-1], 1)):
        mirrored = np.roll(shares[:, ::-1], 1, axis=-1)
        differs = shares != mirrored
        first, rows = np.argmax(differs, axis=1), np.arange(len(shares))
        shares = shares[~differs.any(axis=1) | (shares[rows, first] < mirrored[rows, first])]
    return shares


def work_of(space: StarSpace) -> int:
    """Return the work of a complete search: the number of arrangements of both halves over all crank stars."""
    total = 0
    for pattern in space.patterns:
        free = Free.from_pattern(pattern)
        # coefficients of the product of (1 + z + ... + z^count): in how many ways the front has so many throws
        coefficients = [1]
        for count in free.counts(space.phases):
            coefficients = [sum(coefficients[max(0, k - int(count)) : k + 1]) for k in range(len(free.front) + 1)]
        total += free.arrangements * (coefficients[-1] // 2 + 1 if space.reflect else coefficients[-1])
    return total


def meeting(space: StarSpace, free: Free, share: Counts, window: Window) -> Iterator[Stars]:
    """Yield crank stars whose couple lies in a window, in blocks of shape (n, throws); some repeat.

    The division `share` has the number of throws of the front on every step, shape (phases,).
    """
    front, back, places = list(free.front), list(free.back), np.array(space.places)
    rest = free.counts(space.phases) - share
    front_steps, back_steps = (np.repeat(np.arange(space.phases), counts) for counts in (share, rest))
    waves = phase_waves(space.phases, (window.order,))[0]
    fixed = np.delete(np.arange(space.throws), [*front, *back])
    near = _couple_sums(waves[front_steps], places[front])
    far = _couple_sums(waves[back_steps], places[back]) + places[fixed] @ waves[free.star[fixed]]
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
            stars[:, front] = front_steps[_permutations(len(front))[order[left[inside]]]]
            stars[:, back] = back_steps[_permutations(len(back))[right[inside]]]
            yield stars


def _pairs(first: Indices, counts: Indices) -> Iterator[tuple[Indices, Indices]]:
    # pairs of each right index with `counts` left indices from `first` on, in blocks
    ends, start = np.cumsum(counts), 0
    while start < len(counts):
        before = int(ends[start - 1]) if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, before + _AT_ONCE, side="right")))
        part = counts[start:stop]
        right = np.repeat(np.arange(start, stop), part)
        yield np.arange(len(right)) + np.repeat(first[start:stop] - (ends[start:stop] - part - before), part), right
        start = stop


def _couple_sums(waves: ComplexArray, places: Array) -> ComplexArray:
    total = np.zeros(1, dtype=complex)
    for throw, chosen in enumerate(_chosen(len(places))):
        total = np.repeat(total, len(places) - throw) + (places[throw] * waves)[chosen]
    return total


@lru_cache(maxsize=16)
def _chosen(count: int) -> tuple[NDArray[np.int8], ...]:
    # for each throw, which of the remaining items it takes, for every choice of the throws before it
    rest, out = np.arange(count, dtype=np.int8)[None, :], []
    for _ in range(count):
        out.append(rest.reshape(-1))
        many, left = rest.shape
        others = np.array([[k for k in range(left) if k != taken] for taken in range(left)], dtype=np.intp)
        rest = rest[:, others.reshape(left, left - 1)].reshape(many * left, left - 1)
    return tuple(out)


@lru_cache(maxsize=16)
def _permutations(count: int) -> NDArray[np.int8]:
    permutations = np.zeros((1, 0), dtype=np.int8)
    for throw, chosen in enumerate(_chosen(count)):
        permutations = np.column_stack([np.repeat(permutations, count - throw, axis=0), chosen])
    return permutations
