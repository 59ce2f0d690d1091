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
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.mount_relaxation.constraints import MomentConstraint
from laufruhe.extensions.mount_relaxation.modes import ModeConstraints
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

    def price_of(self, multiplier: Array) -> float:
        """Return the price of the epigraph variable that a multiplier of shape (k, k) needs."""
        if not self.blocks:
            return float(np.trace(multiplier))
        return max(float(np.linalg.eigvalsh(multiplier[part, part])[-1]) for part in self.block_slices)


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
class ObjectiveLimit:
    """Upper bound of the sum of prices times roots and of slopes' s, with the shared numbers s.

    Attributes
    ----------
    slopes
        Coefficients of s, shape (numbers,).
    upper
        Upper bound.
    root
        Number of the root that is minimised alone; None to minimise the objective of the program.
    """

    slopes: Array
    upper: float
    root: int | None = None


LinearLimit: TypeAlias = tuple[tuple[int, Array], ...]
"""Sum of <C, M> that is not above zero: order number and C, shape (d, d), of each term."""


@dataclass(frozen=True, eq=False)
class SdpProgram:
    """Objective and constraints of a relaxation.

    Attributes
    ----------
    sizes
        Length d of (1, v) for each order.
    reaches
        For each order, upper bounds of the squares of the entries of v, shape (d - 1,).
    numbers, columns
        Counts of shared numbers s and of unbalance columns.
    prices, uppers
        Coefficients of the epigraph variables in the objective, and their upper bounds, infinite for none.
    quadratics, constraints, linear
        Bounds of the epigraph variables, constraints on moments, and limits of transmissibility.
    sets
        Matrices C with <C, (1, u)(1, u)'> <= 0 for allowed unbalances, shape (1 + columns, 1 + columns).
    roots
        Roots of the epigraph variables, if these are minimised in place of the variables.
    modes
        Constraints of required natural modes.
    objective
        Further objective: slopes by s, then by w of each mode, shape (numbers + 5 modes,).
    limit
        Upper bound of the usual objective while one root, or `objective`, is minimised.
    """

    sizes: tuple[int, ...]
    reaches: tuple[Array, ...]
    numbers: int
    columns: int
    prices: Array
    uppers: Array
    quadratics: Sequence[QuadraticBound]
    constraints: Sequence[MomentConstraint]
    linear: Sequence[LinearLimit]
    sets: Sequence[Array]
    roots: Sequence[RootTerm]
    modes: Sequence[ModeConstraints]
    objective: Array | None = None
    limit: ObjectiveLimit | None = None

    @property
    def slopes(self) -> tuple[Array, list[Array]]:
        """Slopes of `objective` by s, shape (numbers,), and by w of each mode, shape (5,)."""
        joined = np.zeros(self.numbers + 5 * len(self.modes)) if self.objective is None else self.objective
        return joined[: self.numbers], list(joined[self.numbers :].reshape(-1, 5))


@dataclass(frozen=True, eq=False)
class SdpMultipliers:
    """Multipliers of the constraints of a program.

    Attributes
    ----------
    quadratics, constraints
        One symmetric matrix for each semidefinite constraint.
    linear, sets
        One number for each linear limit and each set.
    links
        One matrix for each order but the first: (1, u)(1, u)' is the same in all orders.
    chords
        One number for the chord of each root.
    lengths
        For each root and order, a vector for each length.
    limit
        Multiplier of the limit of the objective.
    modes
        Multipliers of each mode.
    """

    quadratics: Sequence[Array]
    constraints: Sequence[Array]
    linear: Array
    sets: Array
    links: Sequence[Array]
    chords: Array
    lengths: Sequence[Sequence[Array]]
    limit: float
    modes: Sequence[ModeMultipliers] = ()


@dataclass(frozen=True, eq=False)
class ModeMultipliers:
    """Multipliers of a mode: of matrices, sides, equations, the entries (0, 0) of Z_j = s_j Z, and Z +- Z_j >= 0."""

    matrices: Sequence[Array]
    sides: Array
    equal: Array
    corners: Array
    signs: Sequence[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Solution:
    """Solver output: multipliers, shared numbers s, and moments of orders and of modes."""

    multipliers: SdpMultipliers
    s: Array
    moments: Sequence[Array]
    modes: Sequence[Array] = ()


def proven_bound(program: SdpProgram, multipliers: SdpMultipliers) -> float:
    """Return the lower bound that multipliers prove; it is valid for any multipliers (E44)."""
    # coefficients of the moments of each order in the Lagrangian
    remainders, bound = [np.zeros((d, d)) for d in program.sizes], 0.0
    objective, mode_objectives = program.slopes
    slopes = np.array(objective, dtype=float)
    prices, limit_multiplier, limit = np.array(program.prices, dtype=float), 1.0, program.limit
    if limit is not None:
        limit_multiplier = max(multipliers.limit, 0.0)
        slopes += limit_multiplier * limit.slopes
        bound -= limit_multiplier * limit.upper
    for number, (root, chord, vectors) in enumerate(
        zip(program.roots, multipliers.chords, multipliers.lengths, strict=True)
    ):
        root_price = limit_multiplier * root.price + float(limit is not None and number == limit.root)
        chord_price, vectors = _split_price(root_price, float(chord), vectors)
        prices[number] = chord_price * root.slope
        bound += chord_price * root.offset
        for (order, rows), length_multipliers in zip(root.rows, vectors, strict=True):
            row = 0.5 * np.einsum("na,nad->d", length_multipliers, rows)
            remainders[order][0] += row
            remainders[order][:, 0] += row
    for quadratic, price in zip(
        program.quadratics, _scaled_to_prices(program, prices, multipliers.quadratics), strict=True
    ):
        if math.isfinite(program.uppers[quadratic.variable]):
            bound -= quadratic.price_of(price) * float(program.uppers[quadratic.variable])
        for order, rows in quadratic.rows:
            remainders[order] += np.einsum("pad,ab,pbe->de", rows, price, rows, optimize=True)
    for constraint, multiplier in zip(program.constraints, multipliers.constraints, strict=True):
        price = _psd_part(multiplier)
        bound -= float(np.sum(price * constraint.constant))
        slopes -= np.einsum("ab,nab->n", price, constraint.slopes)
        remainders[constraint.order] -= np.einsum("ab,abij->ij", price, constraint.moments)
    for linear, factor in zip(program.linear, np.maximum(multipliers.linear, 0.0), strict=True):
        for order, matrix in linear:
            remainders[order] += factor * matrix
    corner = slice(1 + program.columns)
    for matrix, factor in zip(program.sets, np.maximum(multipliers.sets, 0.0), strict=True):
        remainders[0][corner, corner] += factor * matrix
    for order, link_multiplier in enumerate(multipliers.links, 1):
        symmetric = 0.5 * (link_multiplier + link_multiplier.T)
        remainders[order][corner, corner] += symmetric
        remainders[0][corner, corner] -= symmetric
    for mode, mode_multipliers, slope in zip(program.modes, multipliers.modes, mode_objectives, strict=True):
        bound += _mode_bound(mode, mode_multipliers, slope)
        slopes -= mode_multipliers.corners
    minimum = sum(_least_quadratic(matrix, reach) for matrix, reach in zip(remainders, program.reaches, strict=True))
    return bound - float(np.abs(slopes).sum()) + minimum


def _split_price(price: float, chord: float, vectors: Sequence[Array]) -> tuple[float, list[Array]]:
    chord = max(chord, 0.0)
    longest = max((float(np.linalg.norm(length_vectors, axis=1).max()) for length_vectors in vectors), default=0.0)
    if chord + longest <= 0.0:
        return price, [np.zeros_like(length_vectors) for length_vectors in vectors]
    factor = price / (chord + longest)
    return factor * chord, [factor * length_vectors for length_vectors in vectors]


def _mode_bound(mode: ModeConstraints, multipliers: ModeMultipliers, slope: Array) -> float:
    # E56: minimum of the remainder over (1, w)(1, w)', each s_j with its worse sign
    remainder = _mode_remainder(mode, multipliers)
    remainder[1:, 0, 0] += multipliers.corners
    remainder[0, 0, 1:] += 0.5 * slope
    remainder[0, 1:, 0] += 0.5 * slope
    for matrix, (upper_part, lower_part) in zip(remainder[1:], multipliers.signs, strict=True):
        # P + Q + |P - Q - L| is over L and -L
        first, second = _psd_part(upper_part), _psd_part(lower_part)
        values, vectors = np.linalg.eigh(_symmetric(matrix - first + second))
        remainder[0] -= first + second + (vectors * np.abs(values)) @ vectors.T
    return _least_with_shift(remainder[0], 1.0)


def _mode_remainder(mode: ModeConstraints, multipliers: ModeMultipliers) -> Array:
    remainder = np.tensordot(multipliers.equal, mode.equal, 1)
    remainder -= np.tensordot(np.maximum(multipliers.sides, 0.0), mode.sides, 1)
    for tensor, multiplier in zip(mode.matrices, multipliers.matrices, strict=True):
        remainder -= np.einsum("ab,mabxy->mxy", _psd_part(multiplier), tensor)
    return np.asarray(remainder)


def mode_scores(mode: ModeConstraints, multipliers: ModeMultipliers, s: Array, moments: Array) -> tuple[Array, Array]:
    """Return branching scores of the numbers s, shape (numbers,), and of the mode coordinates w, shape (5,).

    A score is the violation of products at the optimum, times its multipliers.
    """
    remainder, z = _mode_remainder(mode, multipliers), moments[0][0]
    violations = moments[1:] - s[:, None, None] * moments[0]
    priced = np.abs(np.einsum("jab,jab->jb", remainder[1:], violations))
    squares = np.abs(np.einsum("ab,ab->b", remainder[0], moments[0] - np.outer(z, z)))
    return priced.sum(axis=1), np.asarray((priced.sum(axis=0) + squares)[1:])


def _scaled_to_prices(program: SdpProgram, prices: Array, multipliers: Sequence[Array]) -> list[Array]:
    # scale the multipliers of the quadratic bounds so that they add up to the price of each epigraph variable
    positive = [_psd_part(multiplier) for multiplier in multipliers]
    sums = np.zeros(len(prices))
    for quadratic, price in zip(program.quadratics, positive, strict=True):
        sums[quadratic.variable] += quadratic.price_of(price)
    factors = np.where(sums > 0.0, prices / np.where(sums > 0.0, sums, 1.0), 0.0)
    # a variable with an upper bound needs no exact price
    factors = np.where(np.isfinite(program.uppers), 1.0, factors)
    return [factors[q.variable] * price for q, price in zip(program.quadratics, positive, strict=True)]


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))


def _psd_part(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(_symmetric(matrix))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _least_quadratic(matrix: Array, reaches: Array) -> float:
    plain = _least_with_shift(matrix, float(reaches.sum()))
    if not np.all(np.isfinite(reaches)):
        return plain
    sizes = np.concatenate([[1.0], np.sqrt(np.maximum(reaches, _FLAT * reaches.max(initial=0.0)))])
    return max(plain, _least_with_shift(matrix * np.outer(sizes, sizes), float(len(reaches))))


def _least_with_shift(matrix: Array, reach: float) -> float:
    """Return a lower bound of the quadratic (1, v)' matrix (1, v) over |v|^2 <= reach, by the best diagonal shift."""
    symmetric = _symmetric(matrix)
    if len(symmetric) == 1:
        # no open entry
        return float(symmetric[0, 0])
    values, vectors = np.linalg.eigh(symmetric[1:, 1:])
    coefficients = (vectors.T @ symmetric[1:, 0]) ** 2
    largest, best = float(np.abs(values).max(initial=0.0)), -math.inf
    for shift in _SHIFTS * largest:
        if values[0] + shift > _FLAT * largest and (shift == 0.0 or reach < math.inf):
            loss = shift * reach if shift else 0.0
            best = max(best, float(symmetric[0, 0] - np.sum(coefficients / (values + shift))) - loss)
    return best
