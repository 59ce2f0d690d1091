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


class Reach(NamedTuple):
    """Least and most of the masses, and of the length of the rod, on a box; unbalances lie anywhere in their sets."""

    low: Array
    high: Array
    rod: tuple[float, float]
    domains: tuple[Domain, ...]

    @property
    def middle(self) -> tuple[Array, float]:
        """Masses and length."""
        return 0.5 * (self.low + self.high), 0.5 * (self.rod[0] + self.rod[1])

    @property
    def most(self) -> Array:
        """Largest size of one, then of every column."""
        scales = [np.full(domain.width, domain.scale) for domain in self.domains]
        return np.concatenate([[1.0], np.maximum(np.abs(self.low), np.abs(self.high)), *scales])

    def least(self, functions: Array) -> Array:
        """Of affine functions, shape (n, 1 + columns)."""
        masses = functions[:, 1 : 1 + MASSES]
        found = functions[:, 0] + np.where(masses > 0.0, masses * self.low, masses * self.high).sum(axis=1)
        for domain in self.domains:
            own = functions[:, 1 + MASSES :][:, domain.columns]
            found = found + np.array([domain.set.least(each) for each in own])
        return np.asarray(found)


Ways: TypeAlias = Array


def least_of(nodes: Array, terms: Array, rest: Array, reach: Reach) -> Array:
    """Least of functions on a box, shape (t,): their first two terms at its ends, and what the others take from them.

    Parameters
    ----------
    nodes
        Of each function its values at the nodes, shape (t, n, 1 + columns).
    terms
        What makes the terms between the lengths of the box of these, shape (n, n).
    rest
        What the series leave out, shape (1 + columns,).
    """
    own = np.einsum("mn,tnj->mtj", terms, nodes)
    linear, further, most = own[1:2].sum(axis=0), np.abs(own[2:]).sum(axis=0), reach.most
    found = np.minimum(*(reach.least(own[0] + end * linear) for end in (-1.0, 1.0)))
    return np.asarray(found - further @ most - rest @ most)


class Bundle:
    """Affine functions of the columns that a norm is nowhere under, as many as were asked for (P4)."""

    def __init__(self, lengths: RodSeries) -> None:
        self.piece, self.lengths = lengths.piece, lengths
        self.nodes = np.zeros((0, len(lengths.constant), 1 + lengths.slope.shape[-1]))

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.nodes)

    def touch(self, columns: Array, length: float) -> None:
        """One more that the norm meets at these columns and this length."""
        z = self.lengths.at(length).subgradient(columns)
        self.nodes = np.concatenate([self.nodes, self.lengths.pulled(z)[None]])

    def scaled(self, factors: Sequence[Array]) -> Bundle:
        """Of other factors of its rows, which nothing has been asked of yet."""
        return Bundle(self.lengths.scaled(factors))

    def least(self, reach: Reach) -> float:
        """On a box."""
        found = least_of(self.nodes, self.lengths.terms(*reach.rod), self.lengths.rest, reach)
        return max(float(found.max(initial=0.0)), 0.0)


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
    def of(cls, lengths: RodSeries, z: Array) -> Grouped:
        """Of dual rows of a piece, its factors as at the start."""
        price = lengths.piece.affine.dual_norm(z)
        whole = np.concatenate([lengths.constant[..., None], lengths.slope], axis=-1)
        each = z[:, :, None] * whole
        if not lengths.piece.given:
            return cls(lengths, (each.sum(axis=(1, 2))[:, None, None],), price)
        groups, start = [], 0
        for (_, _, rows), given in zip(lengths.piece.at, lengths.piece.given, strict=True):
            end = start + len(given) * rows
            own = each[:, start:end]
            groups.append(own.reshape(len(own), len(given), rows, *own.shape[2:]).sum(axis=2))
            start = end
        return cls(lengths, tuple(groups), price)

    def weighed(self, factors: Sequence[Array]) -> tuple[Array, float]:
        """With other factors, shape (n, 1 + columns); and the largest of these over that at the start."""
        if not factors:
            return np.asarray(self.groups[0][:, 0, 0]), 1.0
        ratios = [new / old for new, old in zip(factors, self.lengths.piece.given, strict=True)]
        parts = zip(self.groups, ratios, strict=True)
        total = sum(np.einsum("npdj,pd->nj", own, np.broadcast_to(by, own.shape[1:3])) for own, by in parts)
        return np.asarray(total), max(float(by.max(initial=0.0)) for by in ratios)


@dataclass(frozen=True, eq=False)
class Number:
    """A measure, or less than nothing of it, as boxes see it.

    Attributes
    ----------
    sense
        1, or -1 where it is to be large.
    ways
        For each size whether its factors grow with it (1) or fall (-1).
    pieces
        Of a load, each with what bounds it.
    """

    measure: Measure
    sense: float
    ways: Ways
    pieces: tuple[Bundle, ...] = ()


def corner(ways: Ways, lower: Array, upper: Array) -> Array:
    """Where numbers that go these ways are least."""
    return np.where(ways >= 0.0, lower, upper)
