"""Unbalances as columns of loads, in units of their reach, only as many as loads tell apart (E42, E57)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.problem.decision import Domain, ends_of, vector_of
from laufruhe.problem.sets import Value

# share of the largest load under which one counts as none
NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class UnbalanceBasis:
    """The unbalances as (1, u) with no entry of u over one.

    Attributes
    ----------
    of_domains
        From u to the domains' columns less their middles, shape (columns, domains' columns).
    near
        u of the best design.
    sets
        Matrices C with <C, (1, u)(1, u)'> <= 0 for unbalances allowed.
    domains
        Count of domains, in each of which the squares of columns add up to one at most.
    """

    of_domains: Array
    near: Array
    sets: tuple[Array, ...]
    domains: int

    @property
    def count(self) -> int:
        """Return the count of entries of u."""
        return len(self.near)

    def reduced(self, loads: Sequence[ComplexArray]) -> tuple[UnbalanceBasis, Array]:
        """Return the basis of what loads distinguish, and the map from its u to this one, shape (fewer, columns).

        Every domain has columns whose squares add up to one at most, so that the projection lies in a ball.

        Parameters
        ----------
        loads
            Loads of orders per column, shape (columns, k) each.
        """
        rows = [
            part / (float(np.abs(each).max(initial=0.0)) or 1.0) for each in loads for part in (each.real, each.imag)
        ]
        if not rows or not self.count:
            return self, np.eye(self.count)
        across, sizes, _ = np.linalg.svd(np.concatenate(rows, axis=1))
        fewer = int(np.count_nonzero(sizes > NOTHING * max(float(sizes[0]), NOTHING)))
        if fewer == self.count:
            return self, np.eye(self.count)
        size = math.sqrt(self.domains)
        ball = np.diag(np.concatenate([[-1.0], np.ones(fewer)]))
        rows_kept = across[:, :fewer].T
        return UnbalanceBasis(
            size * rows_kept @ self.of_domains, rows_kept @ self.near / size, (ball,), 1
        ), size * rows_kept


def unbalance_basis(domains: Sequence[Domain], values: Sequence[Value]) -> tuple[UnbalanceBasis, Array]:
    """Return all columns of domains, with the unbalances of a design, and the middles of the columns."""
    low, high = ends_of(domains)
    middles, reaches = 0.5 * (low + high), 0.5 * (high - low)
    near = (vector_of(domains, values) - middles) / np.where(reaches > 0.0, reaches, 1.0)
    sets, size = [], 1 + len(near)
    for domain in domains:
        # an interval or a disc, and the sides of a sector
        own = np.arange(len(near))[domain.columns] + 1
        matrix = np.zeros((size, size))
        matrix[0, 0], matrix[own, own] = -1.0, 1.0
        sets.append(matrix)
        first, last = domain.set.angles
        if domain.width == 2 and len(domain.set.edges) and last - first < math.pi:
            for along, sign in zip(domain.set.edges, (1.0, -1.0), strict=True):
                side = np.zeros((size, size))
                # v lies to the left of the first side and to the right of the second
                side[0, own] = side[own, 0] = 0.5 * sign * np.array([along[1], -along[0]])
                sets.append(side)
    return UnbalanceBasis(np.diag(reaches), near, tuple(sets), len(domains)), middles
