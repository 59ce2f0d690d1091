"""Basis of the unbalances in units of their ranges, reduced to the columns that loads distinguish (E42, E57)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.problem.decision import Domain, column_bounds, decision_vector
from laufruhe.problem.sets import Value

# relative size of a load that counts as zero
ZERO_LEVEL = 1e-12


@dataclass(frozen=True, eq=False)
class UnbalanceBasis:
    """Unbalances as a vector (1, u), with entries u_k from -1 to 1.

    Attributes
    ----------
    domain_map, middles
        Map from u to the columns of the domains, less their middles, shape (columns, domain columns), and the middles.
    reference
        Vector u of the best design, shape (columns,).
    sets
        Matrices C with <C, (1, u)(1, u)'> <= 0 for all allowed unbalances.
    domains
        Count of domains; in each the squares of its columns add up to at most one.
    """

    domain_map: Array
    middles: Array
    reference: Array
    sets: tuple[Array, ...]
    domains: int

    @property
    def count(self) -> int:
        """Count of entries of u."""
        return len(self.reference)

    def reduced(self, loads: Sequence[ComplexArray]) -> tuple[UnbalanceBasis, Array]:
        """Return a smaller basis: the combinations of the unbalances u that change loads, and the map to it.

        The map has the shape (fewer, columns).

        `loads` are the changes of the load of each order by the columns of u, shape (columns, k) each.

        The columns of each domain have squares that add up to at most one, so that the reduced u lies in a ball.
        """
        rows = [
            part / (float(np.abs(order_loads).max(initial=0.0)) or 1.0)
            for order_loads in loads
            for part in (order_loads.real, order_loads.imag)
        ]
        if not rows or not self.count:
            return self, np.eye(self.count)
        directions, singular_values, _ = np.linalg.svd(np.concatenate(rows, axis=1))
        rank = int(np.count_nonzero(singular_values > ZERO_LEVEL * max(float(singular_values[0]), ZERO_LEVEL)))
        if rank == self.count:
            return self, np.eye(self.count)
        radius = math.sqrt(self.domains)
        ball = np.diag(np.concatenate([[-1.0], np.ones(rank)]))
        retained = directions[:, :rank].T
        reference = retained @ self.reference / radius
        reduced = UnbalanceBasis(radius * retained @ self.domain_map, self.middles, reference, (ball,), 1)
        return reduced, radius * retained


def unbalance_basis(domains: Sequence[Domain], values: Sequence[Value]) -> UnbalanceBasis:
    """Return the basis of all open unbalances, relative to their bounds; `values` are those of the best design."""
    low, high = column_bounds(domains)
    middles, reaches = 0.5 * (low + high), 0.5 * (high - low)
    reference = (decision_vector(domains, values) - middles) / np.where(reaches > 0.0, reaches, 1.0)
    sets, size = [], 1 + len(reference)
    for domain in domains:
        # an interval or a disc, and the sides of a sector
        columns = np.arange(len(reference))[domain.columns] + 1
        matrix = np.zeros((size, size))
        matrix[0, 0], matrix[columns, columns] = -1.0, 1.0
        sets.append(matrix)
        first, last = domain.set.angles
        if domain.width == 2 and len(domain.set.edges) and last - first < math.pi:
            for edge, sign in zip(domain.set.edges, (1.0, -1.0), strict=True):
                side = np.zeros((size, size))
                # unbalances lie to the left of the first side and to the right of the second
                side[0, columns] = side[columns, 0] = 0.5 * sign * np.array([edge[1], -edge[0]])
                sets.append(side)
    return UnbalanceBasis(np.diag(reaches), middles, reference, tuple(sets), len(domains))
