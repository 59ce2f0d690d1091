"""Affine lower bounds of measures over boxes of sizes (Z12, Z13, Z14).

At any rod length, the product <Z, V> of multipliers Z and rows V is affine in the columns of a size model: for one
measure with Z its subgradient, or for all terms and limits with multipliers of a cone program. Each group of rows has
its factors of sizes, so that one set of multipliers bounds any box.
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
    """Ranges of the masses and of the rod length on a box; unbalances lie anywhere in their sets."""

    low: Array
    high: Array
    rod: tuple[float, float]
    domains: tuple[Domain, ...]

    @property
    def middle(self) -> tuple[Array, float]:
        """Middle masses, shape (4,), and middle rod length [m]."""
        return 0.5 * (self.low + self.high), 0.5 * (self.rod[0] + self.rod[1])

    @property
    def maximum(self) -> Array:
        """Largest absolute value of 1 and of each column, shape (1 + columns,)."""
        scales = [np.full(domain.width, domain.scale) for domain in self.domains]
        return np.concatenate([[1.0], np.maximum(np.abs(self.low), np.abs(self.high)), *scales])

    def minimum(self, functions: Array) -> Array:
        """Return the minimum of affine functions of shape (n, 1 + columns) over masses and unbalances, shape (n,)."""
        masses = functions[:, 1 : 1 + MASSES]
        total = functions[:, 0] + np.where(masses > 0.0, masses * self.low, masses * self.high).sum(axis=1)
        for domain in self.domains:
            columns = functions[:, 1 + MASSES :][:, domain.columns]
            total = total + np.array([domain.set.minimum(row) for row in columns])
        return np.asarray(total)


Monotonicity: TypeAlias = Array
"""For each size 1 if a factor rises with it, -1 if it falls, 0 if it is constant; shape (sizes,)."""


def minimum_of(nodes: Array, terms: Array, remainder: Array, reach: SizeReach) -> Array:
    """Return lower bounds of functions of rod length and columns on a box, shape (t,).

    A bound is the least linear part of the series at both ends of the rod length, less the largest other terms.

    Parameters
    ----------
    nodes
        Coefficients of 1 and each column at the nodes of the rod length, shape (t, n, 1 + columns).
    terms
        Matrix from the nodes to the series between the rod lengths of the box, shape (n, n).
    remainder
        Bound of the remainder of the series, shape (1 + columns,).
    """
    series = np.einsum("mn,tnj->mtj", terms, nodes)
    linear, higher_terms, maximum = series[1:2].sum(axis=0), np.abs(series[2:]).sum(axis=0), reach.maximum
    ends = np.minimum(*(reach.minimum(series[0] + end * linear) for end in (-1.0, 1.0)))
    return np.asarray(ends - higher_terms @ maximum - remainder @ maximum)


class Bundle:
    """Affine lower bounds of the norm of a piece over the columns: its tangents so far (P4)."""

    def __init__(self, lengths: RodSeries) -> None:
        self.piece, self.lengths = lengths.piece, lengths
        self.nodes = np.zeros((0, len(lengths.constant), 1 + lengths.slope.shape[-1]))

    def add_tangents(self, columns: Array, length: float) -> None:
        """Add the tangent of the norm at columns and a rod length [m]."""
        z = self.lengths.at_length(length).subgradient(columns)
        self.nodes = np.concatenate([self.nodes, self.lengths.pulled(z)[None]])

    def minimum(self, reach: SizeReach) -> float:
        """Return a lower bound of the norm on a box."""
        values = minimum_of(self.nodes, self.lengths.terms(*reach.rod), self.lengths.remainder, reach)
        return max(float(values.max(initial=0.0)), 0.0)


@dataclass(frozen=True, eq=False)
class GroupedRows:
    """Products <Z, V> of multipliers and rows of a piece, summed over groups of rows with one factor each.

    Attributes
    ----------
    groups
        For each operating point, shape (n, places, d, 1 + columns); a single group if there are no factors.
    price
        Dual norm of Z.
    """

    lengths: RodSeries
    groups: tuple[Array, ...]
    price: float

    @classmethod
    def from_rows(cls, lengths: RodSeries, z: Array) -> GroupedRows:
        """Return groups of load rows with common size factors, weighted by multipliers `z`, at the initial factors."""
        price = lengths.piece.affine.dual_norm(z)
        rows_of_columns = np.concatenate([lengths.constant[..., None], lengths.slope], axis=-1)
        products = z[:, :, None] * rows_of_columns
        if not lengths.piece.initial_factors:
            return cls(lengths, (products.sum(axis=(1, 2))[:, None, None],), price)
        groups, start = [], 0
        for (_, _, rows), factors in zip(lengths.piece.positions, lengths.piece.initial_factors, strict=True):
            end = start + len(factors) * rows
            part = products[:, start:end]
            groups.append(part.reshape(len(part), len(factors), rows, *part.shape[2:]).sum(axis=2))
            start = end
        return cls(lengths, tuple(groups), price)

    def with_factors(self, factors: Sequence[Array]) -> tuple[Array, float]:
        """Return the weighted sum <Z, V> of load rows for other size factors, shape (n, 1 + columns).

        The second result is the largest ratio of these factors to the initial ones.
        """
        if not factors:
            return np.asarray(self.groups[0][:, 0, 0]), 1.0
        ratios = [factor / initial for factor, initial in zip(factors, self.lengths.piece.initial_factors, strict=True)]
        parts = zip(self.groups, ratios, strict=True)
        total = sum(np.einsum("npdj,pd->nj", group, np.broadcast_to(ratio, group.shape[1:3])) for group, ratio in parts)
        return np.asarray(total), max(float(ratio.max(initial=0.0)) for ratio in ratios)


@dataclass(frozen=True, eq=False)
class SizeNumber:
    """Measure, or its negative, with its lower bounds on boxes.

    Attributes
    ----------
    sense
        1 for an upper limit or an objective, -1 for a lower limit.
    monotonicity
        For each size 1 if the factors rise with it, -1 if they fall, 0 if they are constant; shape (sizes,).
    pieces
        Tangents of each piece of a load.
    """

    measure: Measure
    sense: float
    monotonicity: Monotonicity
    pieces: tuple[Bundle, ...] = ()


def corner(monotonicity: Monotonicity, lower: Array, upper: Array) -> Array:
    """Return the vertex of a box at which numbers of this monotonicity are smallest."""
    return np.where(monotonicity >= 0.0, lower, upper)
