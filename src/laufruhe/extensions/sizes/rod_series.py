"""Rows of a load over the length l of the rod, as Chebyshev series of 1 / l (Z13).

Where no bend of a load moves with the length of the rod, the load is an analytic function of r / l as far as that is
under one: its series between two lengths falls off by the same share with every term. The exact model tells its terms
at as many lengths; the last of them, and two lengths between, tell what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.extensions.sizes.pieces import Piece
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array, Mask

TERMS, BETWEEN = 20, (0.13, 0.71)
"""Terms of a series, and where between its ends it is held against the exact model."""
LAST, TIMES = 2, 10.0
"""Terms by which the rest is judged, and how many times as large it is taken."""
CONVERGED = 1e-6
"""Share of a load that the rest may be."""


@dataclass(frozen=True, eq=False)
class RodSeries:
    """A piece of a measure at any length of the rod.

    Attributes
    ----------
    piece
        At the length that the problem starts from, whose factors its rows have at every length.
    low, high
        Lengths between which it is known [m].
    constant, slope
        Rows at the nodes, shapes (n, k, d) and (n, k, d, columns).
    rest
        No less than the norm of what the series leave out: of the constant, then for each unit of a column.
    """

    piece: Piece
    low: float
    high: float
    constant: Array
    slope: Array
    rest: Array

    @classmethod
    def still(cls, piece: Piece, length: float) -> RodSeries:
        """Of a rod whose length is given: one term, and nothing is left out."""
        own = piece.affine
        return cls(piece, length, length, own.constant[None], own.slope[None], np.zeros(1 + own.slope.shape[-1]))

    def at(self, length: float) -> AffineNorm:
        """At one length."""
        (shares,) = _shares(np.array([self._place(length)]), len(self.constant))
        constant = np.tensordot(shares, self.constant, axes=1)
        return replace(self.piece.affine, constant=constant, slope=np.tensordot(shares, self.slope, axes=1))

    def scaled(self, factors: Sequence[Array]) -> RodSeries:
        """With other factors of its rows."""
        by = self.piece.by(factors)
        rest = self.rest * float(np.abs(by).max(initial=0.0))
        return replace(self, constant=self.constant * by, slope=self.slope * by[..., None], rest=rest)

    def pulled(self, z: Array) -> Array:
        """<Z, V> at the nodes: of the constant, then of each column, shape (n, 1 + columns)."""
        flat, count = z.ravel(), len(self.constant)
        columns = flat @ self.slope.reshape(count, z.size, -1)
        return np.concatenate([(self.constant.reshape(count, -1) @ flat)[:, None], columns], axis=1)

    def terms(self, low: float, high: float) -> Array:
        """What makes the terms of a series between two lengths of values at the nodes, shape (n, n)."""
        count = len(self.constant)
        return _terms(count) @ _shares(np.array([self._place(at) for at in _lengths(low, high, count)]), count)

    def _place(self, length: float) -> float:
        if self.low == self.high:
            return 0.0
        ends = 1.0 / self.low, 1.0 / self.high
        return (2.0 / length - ends[0] - ends[1]) / (ends[0] - ends[1])


def rod_series(
    pieces: Callable[[float], Sequence[Piece]], start: float, low: float, high: float, kept: Sequence[Mask]
) -> list[RodSeries]:
    """Every piece of a measure between two lengths of the rod.

    Parameters
    ----------
    pieces
        Of a length, with all their rows.
    start
        The length whose factors all rows get.
    kept
        Rows of each that no bend passes between the lengths; the others count as nothing, which is never too much.

    Raises
    ------
    ValueError
        If the series of a load does not end: a bend of it moves with the length.
    """
    given = pieces(start)
    told = [_like(given, pieces(length), kept) for length in _lengths(low, high, TERMS)]
    found = []
    for k, piece in enumerate(given):
        constant, slope = (np.stack([getattr(each[k], part) for each in told]) for part in ("constant", "slope"))
        found.append(RodSeries(piece, low, high, constant, slope, np.zeros(0)))
    between = [low + share * (high - low) for share in BETWEEN]
    exact = [_like(given, pieces(length), kept) for length in between]
    return [_with_rest(own, between, [each[k] for each in exact]) for k, own in enumerate(found)]


def _like(given: Sequence[Piece], found: Sequence[Piece], kept: Sequence[Mask]) -> list[AffineNorm]:
    """Pieces at another length with the factors that they are given with, rows that are not kept at nothing."""
    alike = [own.scaled(piece.given) if piece.given else own.affine for piece, own in zip(given, found, strict=True)]
    return [
        replace(own, constant=own.constant * rows[:, None], slope=own.slope * rows[:, None, None])
        for own, rows in zip(alike, kept, strict=True)
    ]


def _with_rest(own: RodSeries, lengths: Sequence[float], exact: Sequence[AffineNorm]) -> RodSeries:
    def size(rows: Array) -> float:
        return own.piece.affine.norm.value(own.piece.affine.grid, rows)

    rest = []
    parts = [own.constant, *np.moveaxis(own.slope, -1, 0)]
    for part, j in zip(parts, range(-1, own.slope.shape[-1]), strict=True):
        series = np.tensordot(_terms(TERMS), part, axes=1)
        left = max(size(each) for each in series[-LAST:])
        for length, known in zip(lengths, exact, strict=True):
            at, true = own.at(length), known
            pairs = (at.constant, true.constant) if j < 0 else (at.slope[..., j], true.slope[..., j])
            left = max(left, size(pairs[0] - pairs[1]))
        if TIMES * left > CONVERGED * max(map(size, series)):
            raise ValueError("a bend of a load moves with the length of the rod")
        rest.append(TIMES * left)
    return replace(own, rest=np.array(rest))


def _lengths(low: float, high: float, count: int) -> list[float]:
    places = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return [float(2.0 / ((1.0 + x) / low + (1.0 - x) / high)) for x in places]


@lru_cache(maxsize=2)
def _terms(count: int) -> Array:
    """Terms of a series from values at its nodes, shape (n, n)."""
    k, i = np.arange(count)[:, None], np.arange(count) + 0.5
    return np.asarray(np.cos(np.pi * k * i / count) * np.where(k == 0, 1.0, 2.0) / count)


def _shares(places: Array, count: int) -> Array:
    """Shares of the nodes in the value of the series at places in -1 ... 1, shape (places, n)."""
    waves = np.cos(np.arange(count) * np.arccos(np.clip(places, -1.0, 1.0))[:, None])
    return np.asarray(waves @ _terms(count))
