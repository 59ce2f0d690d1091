"""Unbalances as columns of loads: counted in what each is not over, as few of them as loads tell apart (E42, E57)."""

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
class Columns:
    """What unbalances may be, (1, u) with no entry of u over one.

    Attributes
    ----------
    of_domains
        From u to what domains call columns, less their middles, shape (columns, domains' columns).
    near
        u of the best design.
    sets
        Matrices C with <C, (1, u)(1, u)'> not over zero for unbalances allowed.
    domains
        Of how many the squares of columns add up to one at most.
    """

    of_domains: Array
    near: Array
    sets: tuple[Array, ...]
    domains: int

    @property
    def count(self) -> int:
        """Entries of u."""
        return len(self.near)

    def seen_by(self, loads: Sequence[ComplexArray]) -> tuple[Columns, Array]:
        """What loads of orders tell of u alone, shape (columns, k) each, and u from this, shape (fewer, columns).

        Every domain has columns whose squares add up to one at most, so that what is left of them lies in a ball.
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
        kept = across[:, :fewer].T
        return Columns(size * kept @ self.of_domains, kept @ self.near / size, (ball,), 1), size * kept


def columns_of(domains: Sequence[Domain], values: Sequence[Value]) -> tuple[Columns, Array]:
    """All columns of domains, at the unbalances of a design, and their middles."""
    middles, reaches = _ranges(domains)
    near = vector_of(domains, values)
    near = (near - middles) / np.where(reaches > 0.0, reaches, 1.0)
    return Columns(np.diag(reaches), near, tuple(_sets(domains, len(near))), len(domains)), middles


def _ranges(domains: Sequence[Domain]) -> tuple[Array, Array]:
    """Middle and reach of every column."""
    low, high = ends_of(domains)
    return 0.5 * (low + high), 0.5 * (high - low)


def _sets(domains: Sequence[Domain], count: int) -> list[Array]:
    """Every unbalance within its bounds: an interval, a disc, and the sides of a sector."""
    found, size = [], 1 + count
    for domain in domains:
        own = np.arange(count)[domain.columns] + 1
        matrix = np.zeros((size, size))
        matrix[0, 0], matrix[own, own] = -1.0, 1.0
        found.append(matrix)
        low, high = domain.set.angles
        if domain.width == 2 and len(domain.set.edges) and high - low < math.pi:
            for along, sign in zip(domain.set.edges, (1.0, -1.0), strict=True):
                side = np.zeros((size, size))
                # v lies to the left of the first side and to the right of the second
                side[0, own] = side[own, 0] = 0.5 * sign * np.array([along[1], -along[0]])
                found.append(side)
    return found
