"""Affine functions of masses and unbalances that lie under what is asked, over boxes of sizes (Z12, Z13, Z14).

At any length of the rod <Z, V> is affine in the columns of a model of sizes: of one measure with Z its subgradient, or
of all that is asked together with dual rows of a cone program. Factors of sizes stand before each group of rows that
has its own, so that one set of dual rows says something of every box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from laufruhe.extensions.sizes.model import MASSES
from laufruhe.extensions.sizes.rod_series import RodSeries
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Measure


class SizeReach(NamedTuple):
    """Ranges of the masses and of the length of the rod on a box; unbalances lie anywhere in their sets."""

    low: Array
    high: Array
    rod: tuple[float, float]
    domains: tuple[Domain, ...]

    @property
    def middle(self) -> tuple[Array, float]:
        """Middle masses and rod length."""
        return 0.5 * (self.low + self.high), 0.5 * (self.rod[0] + self.rod[1])

    @property
    def maximum(self) -> Array:
        """Largest size of one, then of every column."""
        scales = [np.full(domain.width, domain.scale) for domain in self.domains]
        return np.concatenate([[1.0], np.maximum(np.abs(self.low), np.abs(self.high)), *scales])

    def minimum(self, functions: Array) -> Array:
        """Return the least of affine functions, shape (n, 1 + columns)."""
        masses = functions[:, 1 : 1 + MASSES]
        total = functions[:, 0] + np.where(masses > 0.0, masses * self.low, masses * self.high).sum(axis=1)
        for domain in self.domains:
            columns = functions[:, 1 + MASSES :][:, domain.columns]
            total = total + np.array([domain.set.minimum(row) for row in columns])
        return np.asarray(total)


Ways: TypeAlias = Array


def minimum_of(nodes: Array, terms: Array, rest: Array, reach: SizeReach) -> Array:
    """Return the least of functions on a box, shape (t,): their first two terms at its ends, less bounds of the others.

    Parameters
    ----------
    nodes
        Values of each function at the nodes, shape (t, n, 1 + columns).
    terms
        Matrix from these to the terms between the lengths of the box, shape (n, n).
    rest
        Bound of the rest of the series, shape (1 + columns,).
    """
    series = np.einsum("mn,tnj->mtj", terms, nodes)
    linear, further, maximum = series[1:2].sum(axis=0), np.abs(series[2:]).sum(axis=0), reach.maximum
    ends = np.minimum(*(reach.minimum(series[0] + end * linear) for end in (-1.0, 1.0)))
    return np.asarray(ends - further @ maximum - rest @ maximum)


class Bundle:
    """Affine functions of the columns that a norm is nowhere under, as many as were asked for (P4)."""

    def __init__(self, lengths: RodSeries) -> None:
        self.piece, self.lengths = lengths.piece, lengths
        self.nodes = np.zeros((0, len(lengths.constant), 1 + lengths.slope.shape[-1]))

    @property
    def count(self) -> int:
        """Number of functions."""
        return len(self.nodes)

    def touch(self, columns: Array, length: float) -> None:
        """Add the function that meets the norm at these columns and this length."""
        z = self.lengths.at_length(length).subgradient(columns)
        self.nodes = np.concatenate([self.nodes, self.lengths.pulled(z)[None]])

    def scaled(self, factors: Sequence[Array]) -> Bundle:
        """Return an empty bundle with other factors of its rows."""
        return Bundle(self.lengths.scaled(factors))

    def minimum(self, reach: SizeReach) -> float:
        """Return a lower bound of the norm on a box."""
        values = minimum_of(self.nodes, self.lengths.terms(*reach.rod), self.lengths.rest, reach)
        return max(float(values.max(initial=0.0)), 0.0)


@dataclass(frozen=True, eq=False)
class Grouped:
    """<Z, V> of a piece by groups of rows that have a factor of sizes each.

    Attributes
    ----------
    groups
        Of every operating point in it, shape (n, places, d, 1 + columns); of one group alone where nothing has factors.
    price
        Dual norm of Z.
    """

    lengths: RodSeries
    groups: tuple[Array, ...]
    price: float

    @classmethod
    def from_rows(cls, lengths: RodSeries, z: Array) -> Grouped:
        """Return the groups of dual rows of a piece, with the factors of the start."""
        price = lengths.piece.affine.dual_norm(z)
        rows_of_columns = np.concatenate([lengths.constant[..., None], lengths.slope], axis=-1)
        products = z[:, :, None] * rows_of_columns
        if not lengths.piece.given:
            return cls(lengths, (products.sum(axis=(1, 2))[:, None, None],), price)
        groups, start = [], 0
        for (_, _, rows), factors in zip(lengths.piece.at, lengths.piece.given, strict=True):
            end = start + len(factors) * rows
            part = products[:, start:end]
            groups.append(part.reshape(len(part), len(factors), rows, *part.shape[2:]).sum(axis=2))
            start = end
        return cls(lengths, tuple(groups), price)

    def weighed(self, factors: Sequence[Array]) -> tuple[Array, float]:
        """Return the function with other factors, shape (n, 1 + columns), and their largest ratio to the start's."""
        if not factors:
            return np.asarray(self.groups[0][:, 0, 0]), 1.0
        ratios = [new / old for new, old in zip(factors, self.lengths.piece.given, strict=True)]
        parts = zip(self.groups, ratios, strict=True)
        total = sum(np.einsum("npdj,pd->nj", group, np.broadcast_to(by, group.shape[1:3])) for group, by in parts)
        return np.asarray(total), max(float(by.max(initial=0.0)) for by in ratios)


@dataclass(frozen=True, eq=False)
class SizeNumber:
    """Measure, or its negative, as boxes see it.

    Attributes
    ----------
    sense
        1, or -1 where it is to be large.
    ways
        For each size whether its factors grow with it (1) or fall (-1).
    pieces
        Pieces of a load, each with its functions.
    """

    measure: Measure
    sense: float
    ways: Ways
    pieces: tuple[Bundle, ...] = ()


def corner(ways: Ways, lower: Array, upper: Array) -> Array:
    """Return the corner at which numbers that go these ways are least."""
    return np.where(ways >= 0.0, lower, upper)
