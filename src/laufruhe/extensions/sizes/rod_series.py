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
    """Piece of a measure at any length of the rod.

    Attributes
    ----------
    piece
        Piece at the length that the problem starts from, whose factors its rows have at every length.
    low, high
        Lengths between which it is known [m].
    constant, slope
        Rows at the nodes, shapes (n, k, d) and (n, k, d, columns).
    rest
        Bound of the norm of the rest of the series: for the constant, then for each unit of a column.
    """

    piece: Piece
    low: float
    high: float
    constant: Array
    slope: Array
    rest: Array

    @classmethod
    def fixed(cls, piece: Piece, length: float) -> RodSeries:
        """Return the series for a fixed rod length: one term, and no rest."""
        affine = piece.affine
        return cls(
            piece, length, length, affine.constant[None], affine.slope[None], np.zeros(1 + affine.slope.shape[-1])
        )

    def at_length(self, length: float) -> AffineNorm:
        """Return the rows at one length."""
        (shares,) = _shares(np.array([self._place(length)]), len(self.constant))
        constant = np.tensordot(shares, self.constant, axes=1)
        return replace(self.piece.affine, constant=constant, slope=np.tensordot(shares, self.slope, axes=1))

    def scaled(self, factors: Sequence[Array]) -> RodSeries:
        """Return the series with other factors of its rows."""
        by = self.piece.by(factors)
        rest = self.rest * float(np.abs(by).max(initial=0.0))
        return replace(self, constant=self.constant * by, slope=self.slope * by[..., None], rest=rest)

    def pulled(self, z: Array) -> Array:
        """Return <Z, V> at the nodes: for the constant, then for each column, shape (n, 1 + columns)."""
        flat, count = z.ravel(), len(self.constant)
        columns = flat @ self.slope.reshape(count, z.size, -1)
        return np.concatenate([(self.constant.reshape(count, -1) @ flat)[:, None], columns], axis=1)

    def terms(self, low: float, high: float) -> Array:
        """Return the matrix from values at the nodes to the terms between two lengths, shape (n, n)."""
        count = len(self.constant)
        return _terms(count) @ _shares(np.array([self._place(at) for at in _lengths(low, high, count)]), count)

    def _place(self, length: float) -> float:
        if self.low == self.high:
            return 0.0
        ends = 1.0 / self.low, 1.0 / self.high
        return (2.0 / length - ends[0] - ends[1]) / (ends[0] - ends[1])


def rod_series(
    pieces: Callable[[float], Sequence[Piece]], start: float, low: float, high: float, masks: Sequence[Mask]
) -> list[RodSeries]:
    """Return the series of every piece of a measure between two lengths of the rod.

    Parameters
    ----------
    pieces
        Function from a length to the pieces with all their rows.
    start
        The length whose factors all rows get.
    kept
        Rows of each that no bend passes between the lengths; the others count as nothing, which is never too much.

    Raises
    ------
    ValueError
        If the series of a load does not end: a bend of it moves with the length.
    """
    start_pieces = pieces(start)
    at_nodes = [_like(start_pieces, pieces(length), masks) for length in _lengths(low, high, TERMS)]
    series = []
    for k, piece in enumerate(start_pieces):
        constant, slope = (np.stack([getattr(at[k], part) for at in at_nodes]) for part in ("constant", "slope"))
        series.append(RodSeries(piece, low, high, constant, slope, np.zeros(0)))
    between = [low + share * (high - low) for share in BETWEEN]
    exact = [_like(start_pieces, pieces(length), masks) for length in between]
    return [_with_rest(one, between, [at[k] for at in exact]) for k, one in enumerate(series)]


def _like(start_pieces: Sequence[Piece], pieces: Sequence[Piece], masks: Sequence[Mask]) -> list[AffineNorm]:
    alike = [
        norm.scaled(piece.given) if piece.given else norm.affine
        for piece, norm in zip(start_pieces, pieces, strict=True)
    ]
    return [
        replace(norm, constant=norm.constant * rows[:, None], slope=norm.slope * rows[:, None, None])
        for norm, rows in zip(alike, masks, strict=True)
    ]


def _with_rest(series_at: RodSeries, lengths: Sequence[float], exact: Sequence[AffineNorm]) -> RodSeries:
    def size(rows: Array) -> float:
        return series_at.piece.affine.norm.value(series_at.piece.affine.grid, rows)

    rest = []
    parts = [series_at.constant, *np.moveaxis(series_at.slope, -1, 0)]
    for part, j in zip(parts, range(-1, series_at.slope.shape[-1]), strict=True):
        series = np.tensordot(_terms(TERMS), part, axes=1)
        left = max(size(term) for term in series[-LAST:])
        for length, known in zip(lengths, exact, strict=True):
            at, true = series_at.at_length(length), known
            pairs = (at.constant, true.constant) if j < 0 else (at.slope[..., j], true.slope[..., j])
            left = max(left, size(pairs[0] - pairs[1]))
        if TIMES * left > CONVERGED * max(map(size, series)):
            raise ValueError("a bend of a load moves with the length of the rod")
        rest.append(TIMES * left)
    return replace(series_at, rest=np.array(rest))


def _lengths(low: float, high: float, count: int) -> list[float]:
    places = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return [float(2.0 / ((1.0 + x) / low + (1.0 - x) / high)) for x in places]


@lru_cache(maxsize=2)
def _terms(count: int) -> Array:
    k, i = np.arange(count)[:, None], np.arange(count) + 0.5
    return np.asarray(np.cos(np.pi * k * i / count) * np.where(k == 0, 1.0, 2.0) / count)


def _shares(places: Array, count: int) -> Array:
    waves = np.cos(np.arange(count) * np.arccos(np.clip(places, -1.0, 1.0))[:, None])
    return np.asarray(waves @ _terms(count))
