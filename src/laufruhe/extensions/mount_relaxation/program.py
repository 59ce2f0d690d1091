"""Semidefinite relaxation of a box of mounts, and the bound that multipliers prove (E43-E45, E52-E54).

A moment matrix M of each order represents (1, v)(1, v)' (E42), under the constraints of E43. Its first rows, for (1, u)
with unbalances u, are the same for all orders. The objective is a sum of epigraph variables, each above its bounds

    S - F(M) positive semidefinite,    F(M) = sum R M R'                                     (E54)

where S is the variable times the identity, or has blocks with traces that add up to it. Their optima are the square of
the longest vector, or the square of a sum of lengths. A solver proposes multipliers; linear algebra turns any
multipliers into a valid lower bound (E44).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from laufruhe.extensions.mount_relaxation.constraints import ModeConstraints, MomentConstraint
from laufruhe.numerics.arrays import Array

# diagonal shifts that may make a matrix convex, and eigenvalue that counts as zero, over the largest eigenvalue
_SHIFTS = np.concatenate([[0.0], 10.0 ** np.arange(-14.0, 1.1, 0.25)])
_FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class QuadraticBound:
    """Bound of an epigraph variable from below by F(M) (E54).

    Attributes
    ----------
    variable
        Number of the epigraph variable.
    rows
        For each order in the sum F(M), its number and the matrices R, shape (summands, k, d).
    blocks
        Sizes of the blocks of S; () if S is the variable times the identity.
    """

    variable: int
    rows: tuple[tuple[int, Array], ...]
    blocks: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Count k of rows of the matrix S."""
        return int(self.rows[0][1].shape[1])

    @property
    def block_slices(self) -> list[slice]:
        """Range of the rows of each block of S."""
        return [slice(int(a), int(b)) for a, b in pairwise(np.cumsum((0, *self.blocks)))]


@dataclass(frozen=True, eq=False)
class RootTerm:
    """Root of an epigraph variable: above a chord of the square root, and above a sum of lengths (E58).

    Attributes
    ----------
    price
        Coefficient in the objective.
    lower, upper
        Bounds of the root, the ends of the chord.
    rows
        For each order, its number and vectors linear in the first row of its moments, shape (lengths, k, d).
    """

    price: float
    lower: float
    upper: float
    rows: tuple[tuple[int, Array], ...]

    @property
    def slope(self) -> float:
        """Slope of the chord over the square."""
        return 1.0 / (self.lower + self.upper)

    @property
    def offset(self) -> float:
        """Value of the chord at zero."""
        return self.lower * self.upper * self.slope


@dataclass(frozen=True, eq=False)
class SdpProgram:
    """Objective and constraints of a relaxation.

    Attributes
    ----------
    sizes
        Length d of (1, v) for each order.
    reaches
        For each order, an upper bound of |v|^2.
    numbers, columns
        Counts of shared numbers s and of unbalance columns.
    prices, uppers
        Coefficients of the epigraph variables in the objective, and their finite upper bounds.
    quadratics, constraints
        Bounds of the epigraph variables, and constraints on moments.
    sets
        Matrices C with <C, (1, u)(1, u)'> <= 0 for allowed unbalances, shape (1 + columns, 1 + columns).
    roots
        Roots of the epigraph variables, if these are minimised in place of the variables.
    modes
        Constraints of required natural modes.
    slopes
        Coefficients of s in the objective, shape (numbers,).
    limit
        Upper bound of the objective, for programs that minimise something else; infinite for none.
    """

    sizes: tuple[int, ...]
    reaches: tuple[float, ...]
    numbers: int
    columns: int
    prices: Array
    uppers: Array
    quadratics: Sequence[QuadraticBound]
    constraints: Sequence[MomentConstraint]
    sets: Sequence[Array]
    roots: Sequence[RootTerm]
    modes: Sequence[ModeConstraints]
    slopes: Array
    limit: float = math.inf


def least_in_ball(matrix: Array, reach: float) -> float:
    """Return a lower bound of the quadratic (1, v)' matrix (1, v) over |v|^2 <= reach, by the best diagonal shift."""
    if len(matrix) == 1:
        # no open entry
        return float(matrix[0, 0])
    values, vectors = np.linalg.eigh(matrix[1:, 1:])
    coefficients = (vectors.T @ matrix[1:, 0]) ** 2
    largest, best = float(np.abs(values).max(initial=0.0)), -math.inf
    for shift in _SHIFTS * largest:
        if values[0] + shift > _FLAT * largest and (shift == 0.0 or reach < math.inf):
            loss = shift * reach if shift else 0.0
            best = max(best, float(matrix[0, 0] - np.sum(coefficients / (values + shift))) - loss)
    return best
