"""Root mean squares of a star as sums over pairs of throws (V9).

A root mean square of rows that add up over the throws is a sum over pairs,

    |V0 + sum_k m_k(p_k)|^2 = c + sum_k L_k(p_k) + 2 sum_{k<l} m_k(p_k) . m_l(p_l),

whatever orders, sections and operating points it is taken over: as many as there are cost nothing
more. A star that grows throw by throw takes its squares along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.star_model import StarNorm, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars

_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class PairTable:
    """The square of one root mean square.

    Attributes
    ----------
    constant, linear
        c and L, the latter of shape (throws, steps).
    pairs
        2 m_k(p) . m_l(q), shape (throws, throws, steps, steps).
    rounding
        What a square may be off by.
    """

    constant: float
    linear: Array
    pairs: Array
    rounding: float

    def squares(self, stars: Stars) -> Array:
        """Return the squares of whole stars, shape (n,)."""
        total = np.full(len(stars), self.constant)
        for k in range(stars.shape[1]):
            total += self.placed(stars, stars[:, k], k)
        return total

    def placed(self, stars: Stars, steps: Stars, throw: int) -> Array:
        """Return the increase of the squares by placing one throw, shape (n,); the throws before it are placed."""
        total = self.linear[throw, steps]
        count = self.linear.shape[1]
        for other in range(throw):
            table = self.pairs[other, throw].reshape(-1)
            total += table[stars[:, other].astype(np.intp) * count + steps]
        return np.asarray(total)


def pair_table(norm: StarNorm) -> PairTable:
    """Build the table of a root mean square without decisions."""
    weights = np.sqrt(norm.grid.weights)[:, None]
    first = (norm.constant * weights).reshape(-1)
    throws, steps = norm.moves.shape[:2]
    moves = (norm.moves * weights).reshape(throws * steps, -1)
    gram = moves @ moves.T
    own = np.diag(gram).reshape(throws, steps)
    linear = own + 2.0 * (moves @ first).reshape(throws, steps)
    pairs = 2.0 * gram.reshape(throws, steps, throws, steps).transpose(0, 2, 1, 3)
    size = float(np.linalg.norm(first)) + float(np.sqrt(own).max(axis=1).sum())
    return PairTable(float(first @ first), linear, np.ascontiguousarray(pairs), _ROUNDING * size**2)


@dataclass(frozen=True, eq=False)
class PairObjective:
    """A weighted sum of root mean squares, under limits of others.

    Attributes
    ----------
    terms, limits
        With the weight of each, and with its maximum.
    """

    terms: tuple[tuple[float, PairTable], ...]
    limits: tuple[tuple[float, PairTable], ...]

    @classmethod
    def of(cls, problem: StarProblem) -> PairObjective:
        """Build the objective of a problem with root mean squares only, and no decisions besides the star."""
        terms, limits = (
            tuple((number, pair_table(norm)) for number, norm in each) for each in (problem.terms, problem.limits)
        )
        return cls(terms, limits)

    @property
    def tables(self) -> list[PairTable]:
        """Tables of the terms, then of the limits."""
        return [table for _, table in (*self.terms, *self.limits)]

    def values(self, squares: Array) -> Array:
        """The objective from the squares of terms and limits, shape (n, tables); infinite over a limit."""
        total = np.zeros(len(squares))
        for k, (weight, _) in enumerate(self.terms):
            total += weight * np.sqrt(np.maximum(squares[:, k], 0.0))
        for k, (maximum, table) in enumerate(self.limits, len(self.terms)):
            total[squares[:, k] > maximum**2 * (1.0 + 1e-9) + table.rounding] = np.inf
        return total

    def below(self, squares: Array) -> float:
        """Return the least objective that rounding allows, from one row of squares."""
        minimum = sum(
            weight * float(np.sqrt(max(squares[k] - table.rounding, 0.0)))
            for k, (weight, table) in enumerate(self.terms)
        )
        return float(minimum)
