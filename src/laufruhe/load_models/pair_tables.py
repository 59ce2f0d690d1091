"""Root mean squares of the loads of a crank star as sums over pairs of throws (V9).

Throw k stands on step p_k of the star and adds load rows m_k(p_k) to the rows V0. The square of the root mean square is

    |V0 + sum_k m_k(p_k)|^2 = c + sum_k L_k(p_k) + 2 sum_{k<l} m_k(p_k) . m_l(p_l).

The tables of L and of the products have the same size for any number of orders, sections and operating points. A search
that places one throw after the other adds to the squares at each step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.star_model import StarNorm, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars

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
        total = np.full(len(stars), self.constant)
        for k in range(stars.shape[1]):
            total += self.increments(stars, stars[:, k], k)
        return total

    def increments(self, stars: Stars, steps: Stars, throw: int) -> Array:
        """Return the increase of the squared norms, shape (n,), when a throw is added to n incomplete crank stars.

        `stars` has the steps of the throws before this one, shape (n, at least `throw`), and `steps` the step of the
        new throw in each star, shape (n,).
        """
        total = self.linear[throw, steps]
        count = self.linear.shape[1]
        for earlier in range(throw):
            table = self.pairs[earlier, throw].reshape(-1)
            total += table[stars[:, earlier].astype(np.intp) * count + steps]
        return np.asarray(total)


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

    def values(self, squares: Array) -> Array:
        """Return the objective of n crank stars, from the squared norms of all tables, shape (n, tables).

        It is infinite for a star that violates a limit.
        """
        total = np.zeros(len(squares))
        for k, (weight, _) in enumerate(self.terms):
            total += weight * np.sqrt(np.maximum(squares[:, k], 0.0))
        for k, (maximum, table) in enumerate(self.limits, len(self.terms)):
            total[squares[:, k] > maximum**2 * (1.0 + 1e-9) + table.rounding] = np.inf
        return total

    def lower_value(self, squares: Array) -> float:
        """Return a lower bound of the objective under rounding errors, from one row of squares, shape (tables,)."""
        terms = zip(self.terms, squares, strict=False)
        return sum(weight * math.sqrt(max(square - table.rounding, 0.0)) for (weight, table), square in terms)
