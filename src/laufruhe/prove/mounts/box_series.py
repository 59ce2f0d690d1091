"""Motion over a box of open numbers as a series in what each of them stiffens, and a bound of its rest (E37).

D is linear in numbers x. About the centre c of a box, x_j = c_j + s_j h_j with s_j from -1 to 1, number j stiffens D
along its own directions, the columns B_j, by C_j:

    D(x) = D(c) + sum_j s_j h_j B_j C_j B_j'

With B = [root(h_j) B_j], L = D(c)^-1 B C, G = B' L, z0 = B' y0 and S = diag(s):

    y = y0 - L S z,    z = (1 + G S)^-1 z0,    y0 = D(c)^-1 r

A force f = (V + sum_j s_j E_j B_j') y is, with P = E - V L,

    f = V y0 + P S z0 - P S G S z0 + P S (G S) (1 + G S)^-1 G S z0

the last term of which is at most |P T^-1| g / (1 - g) |T G S z0| for any diagonal T > 0 and g = |T G T^-1| < 1, because
T and S commute. Of the third term s_j^2 goes from 0 to 1: its half belongs to the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray, Indices

# of the largest singular value, what is no direction
NOTHING = 1e-12
# times that a matrix is squared for its norm, which is over by no more than the sixteenth root of its rank
SQUARED = 3
# times that a series counts which need not end: nothing is known before it does
UNENDED = 1e3


@dataclass(frozen=True, eq=False)
class Sides:
    """Directions along which open numbers stiffen.

    Attributes
    ----------
    columns
        B_j side by side, orthonormal for each number, shape (d, m).
    own
        The number of each column, rising, shape (m,).
    count
        Numbers.
    """

    columns: Array
    own: Indices
    count: int

    def inside(self, slopes: Any) -> Any:
        """C of matrices by each number, (..., n, d, d) to (..., m, m)."""
        same = self.own[:, None] == self.own
        return np.where(same, np.swapaxes(self.columns, 0, 1) @ self.along(slopes), 0.0)

    def along(self, slopes: Any) -> Any:
        """E of maps by each number, (..., n, r, d) to (..., r, m)."""
        return np.einsum("...mrd,dm->...rm", np.take(slopes, self.own, axis=-3), self.columns)

    def apart(self, turned: Any) -> list[Any]:
        """The maps E_j B_j' of each number, (..., r, d), from E of all, (..., r, m)."""
        return [turned[..., self.own == j] @ self.columns[:, self.own == j].T for j in range(self.count)]

    def summed(self, values: Any) -> Any:
        """Of all columns of each number, (..., m) to (..., n)."""
        return values if len(self.own) == self.count else values @ (self.own[:, None] == np.arange(self.count))


def directions_of(matrices: Sequence[Sequence[Array]]) -> Sides:
    """Directions of numbers, of each of which some matrices are told, (any, d): what their rows span."""
    found = []
    for each in matrices:
        rows = np.vstack([one / max(float(np.abs(one).max(initial=0.0)), 1e-300) for one in each])
        _, size, directions = np.linalg.svd(rows, full_matrices=False)
        found.append(directions[size > NOTHING * size.max(initial=0.0)].T)
    own = np.repeat(np.arange(len(found)), [each.shape[1] for each in found])
    return Sides(np.hstack(found), own, len(found))


@dataclass(frozen=True, eq=False)
class Expansion:
    """Motion over boxes, shapes (boxes, lines, ...) where nothing else is said (E37).

    Attributes
    ----------
    centres, halves
        Of the boxes, shape (boxes, n).
    sides
        Along which numbers stiffen.
    motion
        y0, (..., d).
    moved, gain, met
        L, G and z0: (..., d, m), (..., m, m) and (..., m).
    balance
        Diagonal of T, (..., m).
    rest
        Bound of g / (1 - g) |T G S z0|, (...); infinite where the series need not end.
    """

    centres: Array
    halves: Array
    sides: Sides
    motion: ComplexArray
    moved: ComplexArray
    gain: ComplexArray
    met: ComplexArray
    balance: Array
    rest: Array

    @property
    def pull(self) -> Array:
        """By how much each side of every box keeps the series from ending, (..., n)."""
        even = self.gain * (self.balance[..., None] / self.balance[..., None, :])
        size = np.linalg.norm(even, axis=-2) + np.linalg.norm(even, axis=-1)
        return np.asarray(np.nan_to_num(self.sides.summed(size), nan=1.0, posinf=1.0))


@dataclass(frozen=True, eq=False)
class Answer:
    """Forces or travel over boxes: value + slopes . s, and a bound of the rest (E37), shapes (boxes, lines, ...).

    Attributes
    ----------
    value, slopes
        (..., r) and (..., n, r).
    rest
        (...).
    bends
        What each side adds to the rest, (..., n).
    """

    value: ComplexArray
    slopes: ComplexArray
    rest: Array
    bends: Array

    @property
    def most(self) -> Array:
        """Bound lengths anywhere in a box from above, shape (...)."""
        size = np.linalg.norm(self.value, axis=-1) + np.linalg.norm(self.slopes, axis=-1).sum(axis=-1)
        return np.asarray(size + self.rest)


def series(
    centres: Array, halves: Array, inverse: Any, sides: Sides, inside: Any, motion: Any
) -> Expansion:  # fmt: skip
    """Motion over boxes.

    Parameters
    ----------
    centres, halves
        Of the boxes, (boxes, n).
    inverse, motion
        D(c)^-1 and y0, (boxes, lines, d, d) and (boxes, lines, d).
    sides, inside
        B, and C, (lines, m, m).
    """
    columns = sides.columns * np.sqrt(halves[:, sides.own])[:, None]
    moved = np.matmul(inverse, np.matmul(columns[:, None], inside))
    gain = np.matmul(np.swapaxes(columns, -2, -1)[:, None], moved)
    met = np.matmul(motion[..., None, :], columns[:, None])[..., 0, :]
    balance, even, most = balanced(gain)
    rest = rest_of(even, most, np.abs(met) * balance)
    return Expansion(centres, halves, sides, motion, moved, gain, met, balance, rest)


def balanced(gain: Any) -> tuple[Array, ComplexArray, Array]:
    """T with which what goes through a channel is about what comes back, T G T^-1, and what its norm is not over."""
    heights, widths = np.linalg.norm(gain, axis=-1), np.linalg.norm(gain, axis=-2)
    met = (heights > 0.0) & (widths > 0.0)
    balance = np.sqrt(np.where(met, widths, 1.0) / np.where(met, heights, 1.0))
    even = gain * (balance[..., None] / balance[..., None, :])
    return balance, even, norm_over(even)


def rest_of(even: ComplexArray, most: Array, hit: Array) -> Array:
    """Bound of g / (1 - g) |T G S z0| from |T z0|, (..., m) to (...); infinite where the series need not end."""
    second = np.minimum((np.linalg.norm(even, axis=-2) * hit).sum(axis=-1), most * np.linalg.norm(hit, axis=-1))
    share = np.where(most < 1.0, most / np.where(most < 1.0, 1.0 - most, 1.0), np.inf)
    rest = share * np.where(second > 0.0, second, 1.0)
    return np.asarray(np.where(second > 0.0, rest, np.where(most < 1.0, 0.0, np.inf)))


def mapped(at: Expansion, value: Any, turned: Any = None) -> Answer:
    """What maps make of motion.

    Parameters
    ----------
    value
        V, (boxes, lines, r, d).
    turned
        E times half the width of the box of each number, (..., r, m); nothing where maps are the same all over.
    """
    pulls = -np.matmul(value, at.moved)
    if turned is not None:
        root = np.sqrt(at.halves[:, at.sides.own])[:, None, None]
        pulls = pulls + np.where(root > 0.0, turned / np.where(root > 0.0, root, 1.0), 0.0)
    summed = at.sides.summed
    first = np.swapaxes(summed(pulls * at.met[:, :, None]), -2, -1)
    pairs = pulls[..., None] * (at.gain * at.met[..., None, :])[:, :, None]
    second = -np.swapaxes(summed(np.swapaxes(summed(pairs), -2, -1)), -2, -1)
    own = np.arange(at.sides.count)
    squares, sizes = second[..., own, own], np.linalg.norm(0.5 * (second + np.swapaxes(second, -2, -1)), axis=2)
    sizes[..., own, own] *= 0.5
    # a map that sees nothing has no rest, however far the motion goes
    size = norm_over(pulls / at.balance[:, :, None])
    beyond = np.where(size > 0.0, size * np.where(size > 0.0, at.rest, 0.0), 0.0)
    bends = sizes.sum(axis=-1)
    whole = np.linalg.norm(value, axis=(-2, -1)) * np.linalg.norm(at.motion, axis=-1)
    told = np.where(np.isfinite(at.rest)[..., None], bends, UNENDED * whole[..., None] * at.pull)
    middle = np.matmul(value, at.motion[..., None])[..., 0] + 0.5 * squares.sum(axis=-1)
    return Answer(middle, first, bends.sum(axis=-1) + beyond, told)


def norm_over(matrices: Any) -> Array:
    """At least the largest singular value, (..., r, m) to (...): trace (A* A)^k to the power 1 / 2k is over it."""
    squares = np.matmul(np.swapaxes(np.conj(matrices), -2, -1), matrices)
    size = np.trace(squares, axis1=-2, axis2=-1).real
    squares = squares / np.where(size > 0.0, size, 1.0)[..., None, None]
    for _ in range(SQUARED):
        squares = np.matmul(squares, squares)
    return np.asarray(np.sqrt(size * np.linalg.norm(squares, axis=(-2, -1)) ** (0.5**SQUARED)))


def inverses(matrices: ComplexArray) -> ComplexArray:
    """Inverses; infinite where there is none, which leaves a box without a bound."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        found = np.linalg.inv(np.where(singular[..., None, None], np.eye(matrices.shape[-1]), matrices))
        return np.asarray(np.where(singular[..., None, None], np.inf, found))
