"""Least squares of mount forces or travel on a box of mounts, by a semidefinite relaxation (E43-E45, E52-E54).

Of every order a moment matrix M stands for (1, v)(1, v)' (E42), and must keep the conditions of E43. Its first rows, of
(1, u) with u the unbalances, are those of all orders. What is minimised is a sum of heads, each over the caps

    S - F(M) nowhere indefinite,    F(M) = sum R M R'                                    (E54)

where S is the head times the identity, or blocks whose traces add up to the head: the square of a longest vector, or of
a sum of lengths. A solver proposes multipliers; the bound is what follows from them by linear algebra (E44).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from laufruhe.extensions.mount_relaxation.conditions import Held
from laufruhe.extensions.mount_relaxation.modes import Shapes
from laufruhe.numerics.arrays import Array

# shifts that make a matrix convex, in parts of its largest eigenvalue, be that under zero too
_SHIFTS = np.concatenate([[0.0], 10.0 ** np.arange(-14.0, 1.1, 0.25)])
_FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class Cap:
    """S over F(M) (E54).

    Attributes
    ----------
    head
        Its number.
    rows
        Number of an order, and R of every part of the sum, shape (parts, k, d).
    blocks
        Sizes of the blocks of S; none where S is the head times the identity.
    """

    head: int
    rows: tuple[tuple[int, Array], ...]
    blocks: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """k."""
        return int(self.rows[0][1].shape[1])

    @property
    def parts(self) -> list[slice]:
        """Where the blocks stand."""
        return [slice(int(a), int(b)) for a, b in pairwise(np.cumsum((0, *self.blocks)))]

    def share(self, price: Array) -> float:
        """What a multiplier takes of the price of its head."""
        if not self.blocks:
            return float(np.trace(price))
        return max(float(np.linalg.eigvalsh(price[part, part])[-1]) for part in self.parts)


@dataclass(frozen=True, eq=False)
class Goal:
    """Designs of which the sum of roots at their prices and of s at these is not over a number.

    Attributes
    ----------
    root
        Number of that which is minimised alone; none where it is what a program aims at.
    """

    along: Array
    most: float
    root: int | None = None


@dataclass(frozen=True, eq=False)
class Budget:
    """A sum of functions linear in moments that is not over a number: order and matrix, shape (d, d)."""

    matrices: tuple[tuple[int, Array], ...]
    most: float


@dataclass(frozen=True, eq=False)
class Root:
    """The root of a head: not under the line between what it is at least and at most, nor under a sum of lengths (E58).

    Attributes
    ----------
    price
        Of the root.
    least, most
        Of the root.
    rows
        Number of an order, and vectors that are linear in the first row of its moments, shape (lengths, k, d): the sum
        of their lengths.
    """

    price: float
    least: float
    most: float
    rows: tuple[tuple[int, Array], ...]

    @property
    def slope(self) -> float:
        """Of the line by the square."""
        return 1.0 / (self.least + self.most)

    @property
    def offset(self) -> float:
        """Of the line where the square is nothing."""
        return self.least * self.most * self.slope


@dataclass(frozen=True, eq=False)
class Program:
    """What is minimised, and under what.

    Attributes
    ----------
    sizes
        d of every order.
    reaches
        Of every order squares that those of the entries of v are not over, shape (d - 1,).
    numbers, columns
        How many s there are, and columns of unbalances.
    prices
        Of the heads.
    roots
        Of the heads, where these are what is minimised, in place of their prices.
    tops
        What heads are not over, infinite where that is not known; empty where it is of none.
    aim
        What is minimised beside the heads: of every s, and of the w of every mode.
    goal
        The root that is minimised in place of all, where their sum with `along` of every s is not over `most`.
    sets
        Matrices C with <C, (1, u)(1, u)'> not over zero for unbalances allowed, shape (1 + columns, 1 + columns).
    """

    sizes: tuple[int, ...]
    reaches: tuple[Array, ...]
    numbers: int
    columns: int
    prices: Array
    caps: Sequence[Cap]
    held: Sequence[Held]
    budgets: Sequence[Budget] = ()
    sets: Sequence[Array] = ()
    roots: Sequence[Root] = ()
    shapes: Sequence[Shapes] = ()
    tops: Array = field(default_factory=lambda: np.zeros(0))
    aim: Array | None = None
    goal: Goal | None = None

    @property
    def aims(self) -> tuple[Array, list[Array]]:
        """Of s, and of the w of every mode."""
        whole = np.zeros(self.numbers + 5 * len(self.shapes)) if self.aim is None else self.aim
        return whole[: self.numbers], list(whole[self.numbers :].reshape(-1, 5))


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Of caps, conditions, budgets and sets, and of (1, u)(1, u)' being the same for all orders but the first.

    Of every root that of its line, and vectors for its lengths, of every order one for each.
    """

    caps: Sequence[Array]
    held: Sequence[Array]
    budgets: Array
    sets: Array
    links: Sequence[Array]
    lines: Array
    lengths: Sequence[Sequence[Array]]
    goal: float
    shapes: Sequence[Priced] = ()


@dataclass(frozen=True, eq=False)
class Priced:
    """Multipliers of a mode: of its matrices, sides, equations, corners of Z_j that are s_j, Z + Z_j and Z - Z_j."""

    matrices: Sequence[Array]
    sides: Array
    equal: Array
    corners: Array
    shares: Sequence[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Proposed:
    """What a solver says: multipliers, s, moments of orders and modes, and the least value; infinite where none is."""

    multipliers: Multipliers
    middle: Array
    moments: Sequence[Array]
    least: float
    shapes: Sequence[Array] = ()


def follows(program: Program, found: Multipliers) -> float:
    """What multipliers prove: the least value of the heads less all that they price (E44)."""
    left, slopes, bound = [np.zeros((d, d)) for d in program.sizes], np.zeros(program.numbers), 0.0
    aim, aims = program.aims
    slopes += aim
    prices, times, goal = np.array(program.prices, dtype=float), 1.0, program.goal
    if goal is not None:
        times = max(found.goal, 0.0)
        slopes += times * goal.along
        bound -= times * goal.most
    for number, (root, line, along) in enumerate(zip(program.roots, found.lines, found.lengths, strict=True)):
        alone = float(goal is not None and number == goal.root)
        share, taken = _of_root(times * root.price + alone, float(line), along)
        prices[number] = share * root.slope
        bound += share * root.offset
        for (order, rows), vectors in zip(root.rows, taken, strict=True):
            first = 0.5 * np.einsum("na,nad->d", vectors, rows)
            left[order][0] += first
            left[order][:, 0] += first
    for cap, price in zip(program.caps, _shared(program, prices, found.caps), strict=True):
        if len(program.tops) and math.isfinite(program.tops[cap.head]):
            bound -= cap.share(price) * float(program.tops[cap.head])
        for order, rows in cap.rows:
            left[order] += np.einsum("pad,ab,pbe->de", rows, price, rows, optimize=True)
    for limit, multiplier in zip(program.held, found.held, strict=True):
        price = _positive(multiplier)
        bound -= float(np.sum(price * limit.constant))
        slopes -= np.einsum("ab,nab->n", price, limit.slopes)
        left[limit.order] -= np.einsum("ab,abij->ij", price, limit.moments)
    for budget, factor in zip(program.budgets, np.maximum(found.budgets, 0.0), strict=True):
        bound -= float(factor) * budget.most
        for order, matrix in budget.matrices:
            left[order] += factor * matrix
    corner = slice(1 + program.columns)
    for matrix, factor in zip(program.sets, np.maximum(found.sets, 0.0), strict=True):
        left[0][corner, corner] += factor * matrix
    for order, link in enumerate(found.links, 1):
        both = 0.5 * (link + link.T)
        left[order][corner, corner] += both
        left[0][corner, corner] -= both
    for shapes, priced, own in zip(program.shapes, found.shapes, aims, strict=True):
        bound += _of_shapes(shapes, priced, own)
        slopes -= priced.corners
    least = sum(_least(matrix, reach) for matrix, reach in zip(left, program.reaches, strict=True))
    return bound - float(np.abs(slopes).sum()) + least


def _of_root(price: float, line: float, along: Sequence[Array]) -> tuple[float, list[Array]]:
    """What of the price of a root its line has, and vectors of its lengths, none longer than the rest of the price."""
    line = max(line, 0.0)
    longest = max((float(np.linalg.norm(each, axis=1).max()) for each in along), default=0.0)
    if line + longest <= 0.0:
        return price, [np.zeros_like(each) for each in along]
    factor = price / (line + longest)
    return factor * line, [factor * each for each in along]


def _of_shapes(shapes: Shapes, found: Priced, aim: Array) -> float:
    """Least of what multipliers leave of (1, w)(1, w)', every s_j with the worse sign (E56)."""
    left = _left(shapes, found)
    left[1:, 0, 0] += found.corners
    left[0, 0, 1:] += 0.5 * aim
    left[0, 1:, 0] += 0.5 * aim
    for matrix, (above, under) in zip(left[1:], found.shares, strict=True):
        # P + Q + |P - Q - L| is not under L, nor under -L
        first, second = _positive(above), _positive(under)
        left[0] -= first + second + _size(matrix - first + second)
    return _shifted(left[0], 1.0)


def _left(shapes: Shapes, found: Priced) -> Array:
    left = np.tensordot(found.equal, shapes.equal, 1) - np.tensordot(np.maximum(found.sides, 0.0), shapes.sides, 1)
    for tensor, multiplier in zip(shapes.matrices, found.matrices, strict=True):
        left -= np.einsum("ab,mabxy->mxy", _positive(multiplier), tensor)
    return np.asarray(left)


def pulls(shapes: Shapes, found: Priced, s: Array, moments: Array) -> tuple[Array, Array]:
    """Of every s and every w, what products are not those of the means, as it is priced."""
    left, z = _left(shapes, found), moments[0][0]
    apart = moments[1:] - s[:, None, None] * moments[0]
    priced = np.abs(np.einsum("jab,jab->jb", left[1:], apart))
    plain = np.abs(np.einsum("ab,ab->b", left[0], moments[0] - np.outer(z, z)))
    return priced.sum(axis=1), np.asarray((priced.sum(axis=0) + plain)[1:])


def _size(matrix: Array) -> Array:
    """Of a symmetric matrix the one with its eigenvalues' absolute values."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.abs(values)) @ vectors.T)


def _shared(program: Program, prices: Array, multipliers: Sequence[Array]) -> list[Array]:
    """Multipliers of the caps that take of the price of each head what it has."""
    caps, tops = program.caps, program.tops
    found = [_positive(multiplier) for multiplier in multipliers]
    taken = np.zeros(len(prices))
    for cap, price in zip(caps, found, strict=True):
        taken[cap.head] += cap.share(price)
    factors = np.where(taken > 0.0, prices / np.where(taken > 0.0, taken, 1.0), 0.0)
    if len(tops):
        # what is limited has any price
        factors = np.where(np.isfinite(tops), 1.0, factors)
    return [factors[cap.head] * price for cap, price in zip(caps, found, strict=True)]


def _positive(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _least(matrix: Array, reaches: Array) -> float:
    """Least of (1, v) matrix (1, v)' over v_i^2 at most `reaches`: a shift that makes it convex takes its share off.

    The shift is the same for all entries, or for all in parts of what each is not over.
    """
    plain = _shifted(matrix, float(reaches.sum()))
    if not np.all(np.isfinite(reaches)):
        return plain
    sizes = np.concatenate([[1.0], np.sqrt(np.maximum(reaches, _FLAT * reaches.max(initial=0.0)))])
    return max(plain, _shifted(matrix * np.outer(sizes, sizes), float(len(reaches))))


def _shifted(matrix: Array, reach: float) -> float:
    """Least over |v|^2 at most `reach`."""
    whole = 0.5 * (matrix + matrix.T)
    if len(whole) == 1:
        # nothing of it is open
        return float(whole[0, 0])
    values, vectors = np.linalg.eigh(whole[1:, 1:])
    along = (vectors.T @ whole[1:, 0]) ** 2
    top, best = float(np.abs(values).max(initial=0.0)), -math.inf
    for shift in _SHIFTS * top:
        if values[0] + shift > _FLAT * top and (shift == 0.0 or reach < math.inf):
            lost = shift * reach if shift else 0.0
            best = max(best, float(whole[0, 0] - np.sum(along / (values + shift))) - lost)
    return best
