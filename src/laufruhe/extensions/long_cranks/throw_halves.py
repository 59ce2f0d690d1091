"""Crank stars whose couples lie in a window, by halves of their throws that meet in the middle (S5).

The couple of a crank star is the sum of the couples of its front half and its back half. For every way to share the
steps between the halves, the arrangements of both are listed, and a grid of couples of two orders finds those that
bring the sum into the window. Two halves of m throws cost m! each where whole stars are (2 m)! (E. Horowitz, S. Sahni,
Computing partitions with applications to the knapsack problem, Journal of the ACM 21, 1974, pages 277 to 292). In some
directions the couple of a half is larger than the other half can cancel. Such arrangements are left out (S49).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.physics.crank_stars import Stars, StarSpace, phase_waves

Counts = NDArray[np.uint8]
DIRECTIONS = 64
"""Number of directions in which the couples of halves are compared."""
ORDERS = 2
"""Most orders of couples that halves are compared in."""
LEAVES = 4
"""Number of last throws of a half whose arrangements are listed together, without a comparison."""
CELLS = 1 << 24
"""Number of cells of the grid of couples."""
# most pairs, and arrangements, at once; slots of a table of occupied cells
_AT_ONCE, _NODES, _SLOTS = 1 << 19, 1 << 15, 1 << 21
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Window:
    """Largest couples |C_h| of some orders h (S1) [unit of the places]."""

    orders: tuple[int, ...]
    reaches: tuple[float, ...]

    @classmethod
    def narrowest(cls, phases: int, reaches: dict[int, float]) -> Window:
        """Return the window of the orders with the narrowest windows of all, without orders that are images."""
        orders: dict[int, int] = {}
        for order in sorted(reaches, key=reaches.__getitem__):
            # couples of the orders h and P - h are conjugate
            orders.setdefault(min(order % phases, -order % phases), order)
        selected = tuple(orders.values())[:ORDERS]
        return cls(selected, tuple(reaches[order] for order in selected)) if selected else cls((1,), (math.inf,))


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
        """Return all throws of a pattern as free; the first only if the pattern is the same from every step."""
        star = np.repeat(np.arange(len(pattern)), pattern).astype(np.uint8)
        return cls.from_throws(star, range(len(set(pattern)) > 1, len(star)))

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

    Of divisions whose stars are images of each other, or turned by some steps, one is returned (S2).
    """
    counts, front = free.counts(space.phases), len(free.front)
    shares = np.zeros((1, 0), dtype=np.uint8)
    for step, maximum in enumerate(counts):
        after = int(counts[step + 1 :].sum())
        placed = shares.sum(axis=1, dtype=np.int64)
        grown = [np.column_stack([shares, np.full(len(shares), k, dtype=np.uint8)]) for k in range(maximum + 1)]
        remaining = np.concatenate([front - placed - k for k in range(maximum + 1)])
        shares = np.concatenate(grown)[(remaining >= 0) & (remaining <= after)]
    turns = space.phases if len(free.star) == front + len(free.back) else 1
    # throws on every step of the star that turns the other way
    reflects = space.reflect and len(free.star) - front - len(free.back) <= 1
    reflects &= np.array_equal(counts, np.roll(counts[::-1], 1))
    digits = (int(counts.max(initial=0)) + 1) ** np.arange(space.phases, dtype=np.int64)
    names, is_first = shares @ digits, np.ones(len(shares), dtype=bool)
    swaps = space.mirror and turns > 1 and front == len(free.back)
    for image in (shares, counts - shares) if swaps else (shares,):
        for turned in (image, np.roll(image[:, ::-1], 1, axis=1)) if reflects else (image,):
            for step in range(turns):
                is_first &= names <= np.roll(turned, step, axis=1) @ digits
    return shares[is_first]


def meeting(space: StarSpace, free: Free, share: Counts, window: Window) -> Iterator[Stars]:
    """Yield crank stars whose couples lie in a window, in blocks of shape (n, throws); some repeat.

    The division `share` has the number of throws of the front on every step, shape (phases,).
    """
    places, steps = np.array(space.places), np.arange(space.phases)
    waves = np.ascontiguousarray(phase_waves(space.phases, window.orders).T).view(float)
    fixed = np.delete(np.arange(space.throws), [*free.front, *free.back])
    offset = places[fixed] @ waves[free.star[fixed]]
    levers = float(np.abs(places).sum())
    reaches = np.repeat(np.minimum(window.reaches, levers), 2) + 8.0 * (space.throws + 2) * _EPS * levers
    front, back = (
        _Half(places, throws, np.repeat(steps, counts), waves)
        for throws, counts in ((free.front, share), (free.back, free.counts(space.phases) - share))
    )
    directions = _directions(waves.shape[1])
    room = directions @ offset + np.abs(directions) @ reaches
    if (front.support + back.support + room < 0.0).any():
        return
    front.grow(room + back.support)
    back.grow(room + front.support)
    if not len(front.sets) or not len(back.sets):
        return
    grid = _Grid(np.concatenate([sums for _, sums in front.leaves()], axis=1), reaches)
    for first, far in back.leaves():
        for left, right in grid.pairs(-offset[:, None] - far):
            stars = np.repeat(free.star[None], len(left), axis=0)
            stars[:, front.throws] = front.arranged(left)
            stars[:, back.throws] = back.arranged(first + right)
            yield stars


class _Half:
    """Arrangements of the steps of a half on its throws, the longest levers first.

    Attributes
    ----------
    throws
        Throws in the order in which they take steps. The index of a step of the half is an *item*.
    items, sets, sums
        Arrangements of the first throws, shape (n, throws): their items, the set of the other items as a sum of powers
        of two, and the couples of the first throws, shape (n, 2 orders).
    support
        Upper bound of the couples of all arrangements in every direction, shape (directions,).
    """

    def __init__(self, places: Array, throws: Sequence[int], steps: Indices, waves: Array) -> None:
        self.throws, self._steps = sorted(throws, key=lambda throw: -abs(places[throw])), steps
        self._levers, self._waves, count = places[self.throws], waves[steps], len(throws)
        self.items = np.zeros((1, 0), dtype=np.intp)
        self.sets, self.sums = np.array([(1 << count) - 1]), np.zeros((1, waves.shape[1]))
        self._sides = _directions(waves.shape[1]) @ self._waves.T
        # no arrangement exceeds that of equal order (G. H. Hardy, J. E. Littlewood, G. Polya, Inequalities, 10.2)
        self.support = np.sort(self._sides) @ np.sort(self._levers)

    def grow(self, room: Array) -> None:
        """List arrangements of the first throws whose couple the other half, with `room`, may cancel (S49)."""
        count = len(self.throws)
        leaves = min(LEAVES, count)
        for size in range(count - 1, leaves - 1, -1):
            parts = [self._grown(slice(k, k + _NODES), size, room) for k in range(0, max(len(self.sets), 1), _NODES)]
            self.items, self.sets, self.sums = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        # items of the last throws by set and order, and their couples
        subsets, names = _subsets(count, leaves)
        self._last_items = subsets[:, _permutations(leaves)]
        self._last_sums = np.einsum("k,nlkd->ndl", self._levers[count - leaves :], self._waves[self._last_items])
        self._index = np.zeros(1 << count, dtype=np.intp)
        self._index[names] = np.arange(len(names))

    def _grown(self, part: slice, size: int, room: Array) -> tuple[Indices, Indices, Array]:
        # arrangements of one more throw, which leave `size` items
        count = len(self.throws)
        rows, items = np.nonzero(self.sets[part, None] >> np.arange(count) & 1)
        sums = self.sums[part][rows] + self._levers[count - size - 1] * self._waves[items]
        sets = self.sets[part][rows] - (1 << items)
        keep = (self._reaches(sets, sums, size) + room >= 0.0).all(axis=1)
        return np.column_stack([self.items[part][rows], items])[keep], sets[keep], sums[keep]

    def _reaches(self, sets: Indices, sums: Array, size: int) -> Array:
        # largest couple of arrangements in every direction, whatever order the other items have
        subsets, names = _subsets(len(self.throws), size)
        levers = np.sort(self._levers[len(self.throws) - size :])
        supports = np.zeros((1 << len(self.throws), len(self._sides)))
        supports[names] = (np.sort(self._sides[:, subsets]) @ levers).T
        return np.asarray(sums @ _directions(sums.shape[1]).T + supports[sets])

    def leaves(self) -> Iterator[tuple[int, Array]]:
        """Yield the index of the first arrangement of a block, and couples of its arrangements, shape (2 orders, n)."""
        count = self._last_sums.shape[2]
        size = max(1, _NODES // count)
        for start in range(0, len(self.sets), size):
            part = slice(start, start + size)
            sums = self._last_sums.transpose(1, 0, 2)[:, self._index[self.sets[part]]]
            sums += self.sums[part].T[:, :, None]
            yield start * count, sums.reshape(len(sums), -1)

    def arranged(self, arrangements: Indices) -> Indices:
        """Return the steps of `throws` in arrangements of given indices, shape (n, throws)."""
        nodes, last = np.divmod(arrangements, self._last_sums.shape[2])
        last_items = self._last_items[self._index[self.sets[nodes]], last]
        return np.asarray(self._steps[np.concatenate([self.items[nodes], last_items], axis=1)])


class _Grid:
    """Points in a grid of cells, each wider than the window, to find those near other points.

    Parameters
    ----------
    points
        Shape (d, n).
    reaches
        Half widths of the window, shape (d,).
    """

    def __init__(self, points: Array, reaches: Array) -> None:
        size, low, high = len(points), points.min(axis=1), points.max(axis=1)
        count = int(CELLS ** (1.0 / size))
        # a window reaches into two cells of a direction at most
        widths = np.maximum(2.001 * reaches, (high - low) / count)
        self._reaches, self._low, self._scale = reaches[:, None], low[:, None], 1.0 / widths[:, None]
        self._strides = (count + 3.0) ** np.arange(size)
        names = self._names(np.floor((points - self._low) * self._scale))
        self._order = np.argsort(names)
        self._sorted, self._points = names[self._order], points[:, self._order]
        self._occupied = np.zeros(_SLOTS, dtype=bool)
        self._occupied[names & (_SLOTS - 1)] = True

    def _names(self, cells: Array) -> Indices:
        return np.asarray(self._strides @ cells).astype(np.intp)

    def pairs(self, targets: Array) -> Iterator[tuple[Indices, Indices]]:
        """Yield blocks of pairs: indices of points, and of targets within reach of them."""
        places = (targets - self._reaches - self._low) * self._scale
        cells = np.floor(places)
        splits = places - cells > 1.0 - 2.0 * self._reaches * self._scale - 1e-9
        for sides in itertools.product((False, True), repeat=len(targets)):
            rows = np.flatnonzero(splits[list(sides)].all(axis=0))
            names = self._names(cells[:, rows] + np.array(sides)[:, None])
            near = np.flatnonzero(self._occupied[names & (_SLOTS - 1)])
            names, right = names[near], rows[near]
            first = np.searchsorted(self._sorted, names)
            for left, at in _pairs(first, np.searchsorted(self._sorted, names, side="right") - first):
                close = (np.abs(self._points[:, left] - targets[:, right[at]]) <= self._reaches).all(axis=0)
                if close.any():
                    yield self._order[left[close]], right[at[close]]


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


@lru_cache(maxsize=4)
def _directions(size: int) -> Array:
    # unit vectors in all directions, shape (directions, size)
    vectors = np.random.default_rng(1).normal(size=(DIRECTIONS, size))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


@lru_cache(maxsize=64)
def _subsets(count: int, size: int) -> tuple[Indices, Indices]:
    # all subsets of a size of `count` items, shape (n, size), and their sums of powers of two, shape (n,)
    subsets = np.array(list(itertools.combinations(range(count), size)), dtype=np.intp)
    return subsets, (1 << subsets).sum(axis=1)


@lru_cache(maxsize=8)
def _permutations(count: int) -> Indices:
    return np.array(list(itertools.permutations(range(count))), dtype=np.intp)
