"""Root mean squares of the loads of a crank star as sums over pairs of throws (V9).

Throw k stands on step p_k of the star and adds load rows m_k(p_k) to the rows V0. The square of the root mean square is

    |V0 + sum_k m_k(p_k)|^2 = c + sum_k L_k(p_k) + 2 sum_{k<l} m_k(p_k) . m_l(p_l).

The tables of L and of the products have the same size for any number of orders, sections and operating points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.star_model import StarNorm, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars, StarSpace

_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class PairTable:
    """Table of the square of one root mean square for all crank stars; symbols are those of the module.

    Attributes
    ----------
    constant
        Square c of the load rows V0 without any throw.
    linear
        Summand L_k(p) of throw k on step p, shape (throws, steps).
    pairs
        Products 2 m_k(p) . m_l(q) of throw k on step p and throw l on step q, shape (throws, throws, steps, steps).
    rounding
        Largest rounding error of a square.
    """

    constant: float
    linear: Array
    pairs: Array
    rounding: float

    def squares(self, stars: Stars) -> Array:
        """Return the squared norm of each of n crank stars, shape (n,), from the step of every throw, (n, throws)."""
        steps, (throws, count) = stars.astype(np.intp), self.linear.shape
        total = np.full(len(stars), self.constant)
        for k in range(throws):
            total += self.linear[k, steps[:, k]]
            for earlier in range(k):
                total += self.pairs[earlier, k].reshape(-1)[steps[:, earlier] * count + steps[:, k]]
        return total


def pair_table(norm: StarNorm) -> PairTable:
    """Return a root mean square of loads as a table over pairs of throws, if only the crank star is open."""
    weights = np.sqrt(norm.grid.weights)[:, None]
    first = (norm.constant * weights).reshape(-1)
    throws, steps = norm.moves.shape[:2]
    moves = (norm.moves * weights).reshape(throws * steps, -1)
    gram = moves @ moves.T
    squares = np.diag(gram).reshape(throws, steps)
    linear = squares + 2.0 * (moves @ first).reshape(throws, steps)
    pairs = 2.0 * gram.reshape(throws, steps, throws, steps).transpose(0, 2, 1, 3)
    size = float(np.linalg.norm(first)) + float(np.sqrt(squares).max(axis=1).sum())
    return PairTable(float(first @ first), linear, np.ascontiguousarray(pairs), _ROUNDING * size**2)


@dataclass(frozen=True, eq=False)
class PairObjective:
    """Weighted sum of root mean squares, pairs (weight, table), under limits, pairs (maximum, table)."""

    terms: tuple[tuple[float, PairTable], ...]
    limits: tuple[tuple[float, PairTable], ...]

    @classmethod
    def from_problem(cls, problem: StarProblem) -> PairObjective:
        """Return the objective as tables over pairs of throws, for root mean squares and an open crank star alone."""
        terms, limits = (
            tuple((number, pair_table(norm)) for number, norm in pairs) for pairs in (problem.terms, problem.limits)
        )
        return cls(terms, limits)

    @property
    def tables(self) -> list[PairTable]:
        """Tables of the terms, then of the limits."""
        return [table for _, table in (*self.terms, *self.limits)]

    def values(self, _: StarSpace, stars: Stars) -> Array:
        """Return the objective of n crank stars, below their rounding errors; infinite for one that violates a limit.

        `stars` has the step of every throw, shape (n, throws).
        """
        total, squares = np.zeros(len(stars)), [table.squares(stars) for table in self.tables]
        for (weight, table), square in zip(self.terms, squares, strict=False):
            total += weight * np.sqrt(np.maximum(square - table.rounding, 0.0))
        for (maximum, table), square in zip(self.limits, squares[len(self.terms) :], strict=True):
            total[square > maximum**2 * (1.0 + 1e-9) + table.rounding] = np.inf
        return total

    def lower_bound(self, _: StarSpace) -> float:
        """Return a lower bound over all crank stars: zero."""
        return 0.0
