"""Motion over a box of open numbers as a series in these numbers, with a bound of the remainder (E37).

The impedance D gives the motion y = D^-1 r under a load r. It is linear in the open numbers x. In a box with centre c
and half widths h, x_j = c_j + s_j h_j with s_j from -1 to 1. Number j stiffens D along its directions, the columns of
B_j, by the matrix C_j:

    D(x) = D(c) + sum_j s_j h_j B_j C_j B_j'

With B = [root(h_j) B_j], column motions L = D(c)^-1 B C, gain G = B' L, column travels z0 = B' y0 and S = diag(s):

    y = y0 - L S z,    z = (1 + G S)^-1 z0,    y0 = D(c)^-1 r

A force f = (V + sum_j s_j E_j B_j') y, with the map V at the centre and its slopes E_j, is, with P = E - V L,

    f = V y0 + P S z0 - P S G S z0 + P S (G S) (1 + G S)^-1 G S z0

The length of the last term is at most |P T^-1| g / (1 - g) |T G S z0| for any diagonal T > 0 with g = |T G T^-1| < 1,
because T and S commute. In the third term s_j^2 runs from 0 to 1: half of it belongs to the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray, Indices

# share of the largest singular value under which a direction counts as none
NEGLIGIBLE = 1e-12
# number of squarings for the norm of a matrix; the result exceeds it by at most the sixteenth root of the rank
SQUARED = 3
# factor of branching scores of a series that may diverge
DIVERGENT = 1e3


@dataclass(frozen=True, eq=False)
class Sides:
    """Directions along which open numbers stiffen the impedance; symbols are those of the module.

    Attributes
    ----------
    columns
        Directions B_j of all open numbers side by side, orthonormal for each number, shape (d, m).
    number_of_column
        Index of the open number of each column, rising, shape (m,).
    count
        Number of open numbers n.
    """

    columns: Array
    number_of_column: Indices
    count: int

    def inside(self, slopes: Any) -> Any:
        """Return the matrix C from the slopes of D by each open number, shape (..., n, d, d) to (..., m, m)."""
        same = self.number_of_column[:, None] == self.number_of_column
        return np.where(same, np.swapaxes(self.columns, 0, 1) @ self.along(slopes), 0.0)

    def along(self, slopes: Any) -> Any:
        """Return E, slopes of maps along the directions, from those by each number, (..., n, r, d) to (..., r, m)."""
        return np.einsum("...mrd,dm->...rm", np.take(slopes, self.number_of_column, axis=-3), self.columns)

    def maps_by_number(self, turned: Any) -> list[Any]:
        """Return the derivative E_j B_j' of a map by each open number, shape (..., r, d).

        `turned` has the slopes E of the map along the directions, shape (..., r, m).
        """
        return [
            turned[..., self.number_of_column == j] @ self.columns[:, self.number_of_column == j].T
            for j in range(self.count)
        ]

    def sum_by_number(self, values: Any) -> Any:
        """Sum values over the directions of each open number, shape (..., m) to (..., n)."""
        if len(self.number_of_column) == self.count:
            return values
        return values @ (self.number_of_column[:, None] == np.arange(self.count))


def directions_of(matrices: Sequence[Sequence[Array]]) -> Sides:
    """Return the directions of motion along which each open number acts.

    `matrices` has, for each number, the derivatives of all matrices by it, shape (any, d) each. Their rows span the
    directions.
    """
    bases = []
    for slopes in matrices:
        rows = np.vstack([slope / max(float(np.abs(slope).max(initial=0.0)), 1e-300) for slope in slopes])
        _, size, directions = np.linalg.svd(rows, full_matrices=False)
        bases.append(directions[size > NEGLIGIBLE * size.max(initial=0.0)].T)
    numbers = np.repeat(np.arange(len(bases)), [basis.shape[1] for basis in bases])
    return Sides(np.hstack(bases), numbers, len(bases))


@dataclass(frozen=True, eq=False)
class Expansion:
    """Series of motion over boxes, shapes (boxes, orders, ...) unless given otherwise (E37).

    Symbols are those of the module.

    Attributes
    ----------
    centres, halves
        Centres and half widths of the boxes, shape (boxes, n).
    sides
        Directions of the open numbers.
    motion
        Motion y0 at the centre, (..., d).
    column_motions, gain, column_travels
        L, G and z0: (..., d, m), (..., m, m) and (..., m).
    balance
        Diagonal of the balancing matrix T, (..., m).
    remainder
        Bound of g / (1 - g) |T G S z0|, (...); infinite if the series may diverge.
    """

    centres: Array
    halves: Array
    sides: Sides
    motion: ComplexArray
    column_motions: ComplexArray
    gain: ComplexArray
    column_travels: ComplexArray
    balance: Array
    remainder: Array

    @property
    def pull(self) -> Array:
        """Branching scores: contribution of each open number to the gain of the series, (..., n)."""
        even = self.gain * (self.balance[..., None] / self.balance[..., None, :])
        size = np.linalg.norm(even, axis=-2) + np.linalg.norm(even, axis=-1)
        return np.asarray(np.nan_to_num(self.sides.sum_by_number(size), nan=1.0, posinf=1.0))


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """Forces or travel on boxes: value + slopes . s and a remainder (E37), shapes (boxes, orders, ...).

    Attributes
    ----------
    value, slopes
        Shapes (..., r) and (..., n, r).
    remainder
        Upper bound of the length of all further terms, (...).
    scores
        Branching scores: part of the remainder from each open number, (..., n).
    """

    value: ComplexArray
    slopes: ComplexArray
    remainder: Array
    scores: Array

    @property
    def maximum(self) -> Array:
        """Upper bound of the length of forces or travel anywhere in a box, shape (...)."""
        size = np.linalg.norm(self.value, axis=-1) + np.linalg.norm(self.slopes, axis=-1).sum(axis=-1)
        return np.asarray(size + self.remainder)


def series(
    centres: Array, halves: Array, inverse: Any, sides: Sides, inside: Any, motion: Any
) -> Expansion:  # fmt: skip
    """Return the motion over boxes of open numbers as a series, with a bound of its remainder (E37).

    Parameters
    ----------
    centres, halves
        Centres and half widths of the boxes, (boxes, n).
    inverse, motion
        Inverse impedance D(c)^-1 and motion y0 at the centres, (boxes, orders, d, d) and (boxes, orders, d).
    sides, inside
        Directions B_j, and the stiffening C along them, (orders, m, m).
    """
    columns = sides.columns * np.sqrt(halves[:, sides.number_of_column])[:, None]
    column_motions = np.matmul(inverse, np.matmul(columns[:, None], inside))
    gain = np.matmul(np.swapaxes(columns, -2, -1)[:, None], column_motions)
    column_travels = np.matmul(motion[..., None, :], columns[:, None])[..., 0, :]
    balance, even, maximum = balanced(gain)
    rest = rest_of(even, maximum, np.abs(column_travels) * balance)
    return Expansion(centres, halves, sides, motion, column_motions, gain, column_travels, balance, rest)


def balanced(gain: Any) -> tuple[Array, ComplexArray, Array]:
    """Return the diagonal of a scaling T that makes the gain G small, the gain T G T^-1, and a bound g of its norm."""
    heights, widths = np.linalg.norm(gain, axis=-1), np.linalg.norm(gain, axis=-2)
    loaded = (heights > 0.0) & (widths > 0.0)
    balance = np.sqrt(np.where(loaded, widths, 1.0) / np.where(loaded, heights, 1.0))
    even = gain * (balance[..., None] / balance[..., None, :])
    return balance, even, norm_over(even)


def rest_of(even: ComplexArray, maximum: Array, hit: Array) -> Array:
    """Return an upper bound of the remainder g / (1 - g) |T G S z0| of the series; infinite if it may diverge.

    Parameters
    ----------
    even
        Balanced gain T G T^-1, (..., m, m).
    maximum
        Upper bound of its norm g, (...).
    hit
        Upper bounds of |T z0|, (..., m).
    """
    second = np.minimum((np.linalg.norm(even, axis=-2) * hit).sum(axis=-1), maximum * np.linalg.norm(hit, axis=-1))
    share = np.where(maximum < 1.0, maximum / np.where(maximum < 1.0, 1.0 - maximum, 1.0), np.inf)
    rest = share * np.where(second > 0.0, second, 1.0)
    return np.asarray(np.where(second > 0.0, rest, np.where(maximum < 1.0, 0.0, np.inf)))


def mapped(expansion: Expansion, value: Any, turned: Any = None) -> LinearResponse:
    """Return mount forces or travel as linear functions over boxes with bounds of their errors, from the motion (E37).

    Parameters
    ----------
    expansion
        Series of the motion.
    value
        Map V from motion to forces or travel at the centres, (boxes, orders, r, d).
    turned
        Slopes E of the map, times half the width of each open number, (..., r, m); None for a constant map.
    """
    pulls = -np.matmul(value, expansion.column_motions)
    if turned is not None:
        root = np.sqrt(expansion.halves[:, expansion.sides.number_of_column])[:, None, None]
        pulls = pulls + np.where(root > 0.0, turned / np.where(root > 0.0, root, 1.0), 0.0)
    sum_by_number = expansion.sides.sum_by_number
    first = np.swapaxes(sum_by_number(pulls * expansion.column_travels[:, :, None]), -2, -1)
    pairs = pulls[..., None] * (expansion.gain * expansion.column_travels[..., None, :])[:, :, None]
    second = -np.swapaxes(sum_by_number(np.swapaxes(sum_by_number(pairs), -2, -1)), -2, -1)
    k = np.arange(expansion.sides.count)
    squares, sizes = second[..., k, k], np.linalg.norm(0.5 * (second + np.swapaxes(second, -2, -1)), axis=2)
    sizes[..., k, k] *= 0.5
    # a zero map has no remainder, even of a series that diverges
    size = norm_over(pulls / expansion.balance[:, :, None])
    beyond = np.where(size > 0.0, size * np.where(size > 0.0, expansion.remainder, 0.0), 0.0)
    bends = sizes.sum(axis=-1)
    size_at_centre = np.linalg.norm(value, axis=(-2, -1)) * np.linalg.norm(expansion.motion, axis=-1)
    scores = np.where(
        np.isfinite(expansion.remainder)[..., None], bends, DIVERGENT * size_at_centre[..., None] * expansion.pull
    )
    middle = np.matmul(value, expansion.motion[..., None])[..., 0] + 0.5 * squares.sum(axis=-1)
    return LinearResponse(middle, first, bends.sum(axis=-1) + beyond, scores)


def norm_over(matrices: Any) -> Array:
    """Return upper bounds (trace (A* A)^k)^(1 / 2k) of the largest singular value of matrices A, (..., r, m)."""
    squares = np.matmul(np.swapaxes(np.conj(matrices), -2, -1), matrices)
    size = np.trace(squares, axis1=-2, axis2=-1).real
    squares = squares / np.where(size > 0.0, size, 1.0)[..., None, None]
    for _ in range(SQUARED):
        squares = np.matmul(squares, squares)
    return np.asarray(np.sqrt(size * np.linalg.norm(squares, axis=(-2, -1)) ** (0.5**SQUARED)))


def inverses(matrices: ComplexArray) -> ComplexArray:
    """Return the inverses of matrices; a singular matrix gives infinite entries, so that its box has no bound."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        regular = np.where(singular[..., None, None], np.eye(matrices.shape[-1]), matrices)
        return np.asarray(np.where(singular[..., None, None], np.inf, np.linalg.inv(regular)))
