"""The semidefinite relaxation of a box of mounts, and the bound that multipliers prove (E43-E45, E52-E54).

A moment matrix M of every order stands for (1, v)(1, v)' (E42), under the constraints of E43. Its first rows, of (1, u)
with u the unbalances, are the same for all orders. The objective is a sum of epigraph variables, each over its bounds

    S - F(M) positive semidefinite,    F(M) = sum R M R'                                     (E54)

where S is the variable times the identity, or blocks whose traces add up to it: the square of a longest vector, or of
a sum of lengths. A solver proposes multipliers; the bound follows from them by linear algebra (E44).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from laufruhe.extensions.mount_relaxation.constraints import MomentConstraint
from laufruhe.extensions.mount_relaxation.modes import ModeConstraints
from laufruhe.numerics.arrays import Array

# shifts that make a matrix convex, as shares of its largest eigenvalue
_SHIFTS = np.concatenate([[0.0], 10.0 ** np.arange(-14.0, 1.1, 0.25)])
_FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class QuadraticBound:
    """An epigraph variable over F(M) (E54).

    Attributes
    ----------
    variable
        Number of the epigraph variable.
    rows
        Number of an order, and R of every part of the sum, shape (parts, k, d).
    blocks
        Sizes of the blocks of S; none where S is the variable times the identity.
    """

    variable: int
    rows: tuple[tuple[int, Array], ...]
    blocks: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Return k."""
        return int(self.rows[0][1].shape[1])

    @property
    def block_slices(self) -> list[slice]:
        """Return the rows of every block of S."""
        return [slice(int(a), int(b)) for a, b in pairwise(np.cumsum((0, *self.blocks)))]

    def price_of(self, multiplier: Array) -> float:
        """Return the part of the price of the variable that a multiplier takes."""
        if not self.blocks:
            return float(np.trace(multiplier))
        return max(float(np.linalg.eigvalsh(multiplier[part, part])[-1]) for part in self.block_slices)


@dataclass(frozen=True, eq=False)
class RootTerm:
    """The root of an epigraph variable: over a chord of the square root, and over a sum of lengths (E58).

    Attributes
    ----------
    price
        In the objective.
    lower, upper
        Bounds of the root, the ends of the chord.
    rows
        Number of an order, and vectors that are linear in the first row of its moments, shape (lengths, k, d).
    """

    price: float
    lower: float
    upper: float
    rows: tuple[tuple[int, Array], ...]

    @property
    def slope(self) -> float:
        """Return the slope of the chord over the square."""
        return 1.0 / (self.lower + self.upper)

    @property
    def offset(self) -> float:
        """Return the chord at zero."""
        return self.lower * self.upper * self.slope


@dataclass(frozen=True, eq=False)
class ObjectiveLimit:
    """Upper bound of the sum of the roots at their prices and of slopes' s.

    Attributes
    ----------
    root
        Number of the root that is minimised alone; None where it is the objective of the program.
    """

    slopes: Array
    upper: float
    root: int | None = None


@dataclass(frozen=True, eq=False)
class LinearLimit:
    """Upper bound of a sum <C, M>: number of an order and C, shape (d, d)."""

    matrices: tuple[tuple[int, Array], ...]
    upper: float


@dataclass(frozen=True, eq=False)
class SdpProgram:
    """Objective and constraints of a relaxation.

    Attributes
    ----------
    sizes
        d of every order.
    reaches
        Upper bounds of the squares of the entries of v, of every order shape (d - 1,).
    numbers, columns
        How many s there are, and columns of unbalances.
    prices
        Of the epigraph variables.
    roots
        Of the epigraph variables, where the roots are minimised in place of the variables.
    uppers
        Upper bounds of the epigraph variables, infinite where there is none; empty where no variable has one.
    objective
        Further objective: slopes by every s, and by the w of every mode.
    limit
        Upper bound of what else would be the objective, while one root, or `objective`, is minimised.
    sets
        Matrices C with <C, (1, u)(1, u)'> <= 0 for unbalances allowed, shape (1 + columns, 1 + columns).
    """

    sizes: tuple[int, ...]
    reaches: tuple[Array, ...]
    numbers: int
    columns: int
    prices: Array
    quadratics: Sequence[QuadraticBound]
    constraints: Sequence[MomentConstraint]
    linear: Sequence[LinearLimit] = ()
    sets: Sequence[Array] = ()
    roots: Sequence[RootTerm] = ()
    modes: Sequence[ModeConstraints] = ()
    uppers: Array = field(default_factory=lambda: np.zeros(0))
    objective: Array | None = None
    limit: ObjectiveLimit | None = None

    @property
    def slopes(self) -> tuple[Array, list[Array]]:
        """Return `objective` split into slopes by s, and by the w of every mode."""
        joined = np.zeros(self.numbers + 5 * len(self.modes)) if self.objective is None else self.objective
        return joined[: self.numbers], list(joined[self.numbers :].reshape(-1, 5))


@dataclass(frozen=True, eq=False)
class SdpMultipliers:
    """Multipliers of a program.

    Attributes
    ----------
    links
        Of (1, u)(1, u)' being the same for all orders; one for every order but the first.
    chords
        Of the chord of every root.
    lengths
        Of every root and order a vector for each length.
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
    """Multipliers of a mode: of its matrices, sides and equations, of the corners Z_j = s_j, and of Z +- Z_j >= 0."""

    matrices: Sequence[Array]
    sides: Array
    equal: Array
    corners: Array
    signs: Sequence[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Solution:
    """A solver's multipliers, s, moments of orders and modes, and value; infinite where it finds no point."""

    multipliers: SdpMultipliers
    s: Array
    moments: Sequence[Array]
    value: float
    modes: Sequence[Array] = ()


def proven_bound(program: SdpProgram, multipliers: SdpMultipliers) -> float:
    """Return the lower bound of a program that multipliers prove, whatever they are (E44)."""
    remainders, bound = [np.zeros((d, d)) for d in program.sizes], 0.0
    objective, mode_objectives = program.slopes
    slopes = np.array(objective, dtype=float)
    prices, times, limit = np.array(program.prices, dtype=float), 1.0, program.limit
    if limit is not None:
        times = max(multipliers.limit, 0.0)
        slopes += times * limit.slopes
        bound -= times * limit.upper
    for number, (root, chord, vectors) in enumerate(
        zip(program.roots, multipliers.chords, multipliers.lengths, strict=True)
    ):
        root_price = times * root.price + float(limit is not None and number == limit.root)
        chord_price, vectors = _split_price(root_price, float(chord), vectors)
        prices[number] = chord_price * root.slope
        bound += chord_price * root.offset
        for (order, rows), along in zip(root.rows, vectors, strict=True):
            first = 0.5 * np.einsum("na,nad->d", along, rows)
            remainders[order][0] += first
            remainders[order][:, 0] += first
    for quadratic, price in zip(
        program.quadratics, _scaled_to_prices(program, prices, multipliers.quadratics), strict=True
    ):
        if len(program.uppers) and math.isfinite(program.uppers[quadratic.variable]):
            bound -= quadratic.price_of(price) * float(program.uppers[quadratic.variable])
        for order, rows in quadratic.rows:
            remainders[order] += np.einsum("pad,ab,pbe->de", rows, price, rows, optimize=True)
    for constraint, multiplier in zip(program.constraints, multipliers.constraints, strict=True):
        price = _psd_part(multiplier)
        bound -= float(np.sum(price * constraint.constant))
        slopes -= np.einsum("ab,nab->n", price, constraint.slopes)
        remainders[constraint.order] -= np.einsum("ab,abij->ij", price, constraint.moments)
    for linear, factor in zip(program.linear, np.maximum(multipliers.linear, 0.0), strict=True):
        bound -= float(factor) * linear.upper
        for order, matrix in linear.matrices:
            remainders[order] += factor * matrix
    corner = slice(1 + program.columns)
    for matrix, factor in zip(program.sets, np.maximum(multipliers.sets, 0.0), strict=True):
        remainders[0][corner, corner] += factor * matrix
    for order, link in enumerate(multipliers.links, 1):
        symmetric = 0.5 * (link + link.T)
        remainders[order][corner, corner] += symmetric
        remainders[0][corner, corner] -= symmetric
    for mode, priced, slope in zip(program.modes, multipliers.modes, mode_objectives, strict=True):
        bound += _mode_bound(mode, priced, slope)
        slopes -= priced.corners
    minimum = sum(_least_quadratic(matrix, reach) for matrix, reach in zip(remainders, program.reaches, strict=True))
    return bound - float(np.abs(slopes).sum()) + minimum


def _split_price(price: float, chord: float, vectors: Sequence[Array]) -> tuple[float, list[Array]]:
    chord = max(chord, 0.0)
    longest = max((float(np.linalg.norm(each, axis=1).max()) for each in vectors), default=0.0)
    if chord + longest <= 0.0:
        return price, [np.zeros_like(each) for each in vectors]
    factor = price / (chord + longest)
    return factor * chord, [factor * each for each in vectors]


def _mode_bound(mode: ModeConstraints, multipliers: ModeMultipliers, slope: Array) -> float:
    # E56: least remainder over (1, w)(1, w)', every s_j with the worse sign
    remainder = _mode_remainder(mode, multipliers)
    remainder[1:, 0, 0] += multipliers.corners
    remainder[0, 0, 1:] += 0.5 * slope
    remainder[0, 1:, 0] += 0.5 * slope
    for matrix, (above, under) in zip(remainder[1:], multipliers.signs, strict=True):
        # P + Q + |P - Q - L| is over L and -L
        first, second = _psd_part(above), _psd_part(under)
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
    """Return branching scores of every s and every w: the priced violation of products of means."""
    remainder, z = _mode_remainder(mode, multipliers), moments[0][0]
    violations = moments[1:] - s[:, None, None] * moments[0]
    priced = np.abs(np.einsum("jab,jab->jb", remainder[1:], violations))
    plain = np.abs(np.einsum("ab,ab->b", remainder[0], moments[0] - np.outer(z, z)))
    return priced.sum(axis=1), np.asarray((priced.sum(axis=0) + plain)[1:])


def _scaled_to_prices(program: SdpProgram, prices: Array, multipliers: Sequence[Array]) -> list[Array]:
    # multipliers of the quadratic bounds take the price of each epigraph variable
    uppers = program.uppers
    positive = [_psd_part(multiplier) for multiplier in multipliers]
    sums = np.zeros(len(prices))
    for quadratic, price in zip(program.quadratics, positive, strict=True):
        sums[quadratic.variable] += quadratic.price_of(price)
    factors = np.where(sums > 0.0, prices / np.where(sums > 0.0, sums, 1.0), 0.0)
    if len(uppers):
        # a variable with an upper bound may have any price
        factors = np.where(np.isfinite(uppers), 1.0, factors)
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
    """Return the best lower bound over |v|^2 <= reach of the shifts tried."""
    symmetric = _symmetric(matrix)
    if len(symmetric) == 1:
        # nothing of it is open
        return float(symmetric[0, 0])
    values, vectors = np.linalg.eigh(symmetric[1:, 1:])
    along = (vectors.T @ symmetric[1:, 0]) ** 2
    top, best = float(np.abs(values).max(initial=0.0)), -math.inf
    for shift in _SHIFTS * top:
        if values[0] + shift > _FLAT * top and (shift == 0.0 or reach < math.inf):
            loss = shift * reach if shift else 0.0
            best = max(best, float(symmetric[0, 0] - np.sum(along / (values + shift))) - loss)
    return best
