"""Rows of a load over the rod length l, as Chebyshev series of 1 / l (Z13).

If no kink of a load moves with the rod length, the load is an analytic function of r / l for r / l < 1. Its series
between two lengths then converges geometrically. The exact model at as many lengths gives the terms; the last terms,
and two lengths between the nodes, give a bound of the remainder.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.extensions.sizes.model import Piece
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array, Mask

TERMS, CHECKED = 20, (0.13, 0.71)
"""Terms of a series, and relative positions at which it is compared with the exact model."""
LAST_TERMS, SAFETY = 2, 10.0
"""Last terms that estimate the remainder, and safety factor."""
CONVERGED = 1e-6
"""Largest remainder, as a share of the load."""


@dataclass(frozen=True, eq=False)
class RodSeries:
    """Load rows of a measure as a series in the rod length; one piece of rows with common size factors.

    Attributes
    ----------
    piece
        Piece at the initial length; its rows have the initial factors at all lengths.
    low, high
        Range of lengths [m].
    constant, slope
        Rows at the nodes, shapes (n, k, d) and (n, k, d, columns).
    remainder
        Bound of the norm of the remainder: for the constant, then for one unit of each column, shape (1 + columns,).
    """

    piece: Piece
    low: float
    high: float
    constant: Array
    slope: Array
    remainder: Array

    @classmethod
    def fixed(cls, piece: Piece, length: float) -> RodSeries:
        """Return load rows at a fixed rod length as a series with one term and no remainder."""
        affine = piece.affine
        return cls(
            piece, length, length, affine.constant[None], affine.slope[None], np.zeros(1 + affine.slope.shape[-1])
        )

    def at_length(self, length: float) -> AffineNorm:
        """Return the norm at one rod length [m]."""
        (shares,) = _shares(np.array([self._place(length)]), len(self.constant))
        constant = np.tensordot(shares, self.constant, axes=1)
        return replace(self.piece.affine, constant=constant, slope=np.tensordot(shares, self.slope, axes=1))

    def scaled(self, factors: Sequence[Array]) -> RodSeries:
        """Return the series with the factors of other sizes."""
        ratios = self.piece.ratios(factors)
        remainder = self.remainder * float(np.abs(ratios).max(initial=0.0))
        return replace(self, constant=self.constant * ratios, slope=self.slope * ratios[..., None], remainder=remainder)

    def pulled(self, z: Array) -> Array:
        """Return products of multipliers `z` and rows at the nodes: constant, then columns, shape (n, 1 + columns)."""
        flat, count = z.ravel(), len(self.constant)
        columns = flat @ self.slope.reshape(count, z.size, -1)
        return np.concatenate([(self.constant.reshape(count, -1) @ flat)[:, None], columns], axis=1)

    def terms(self, low: float, high: float) -> Array:
        """Return the matrix from values at the nodes to the series between two lengths, shape (n, n)."""
        count = len(self.constant)
        return _terms(count) @ _shares(np.array([self._place(length) for length in _lengths(low, high, count)]), count)

    def _place(self, length: float) -> float:
        if self.low == self.high:
            return 0.0
        ends = 1.0 / self.low, 1.0 / self.high
        return (2.0 / length - ends[0] - ends[1]) / (ends[0] - ends[1])


def rod_series(
    pieces: Callable[[float], Sequence[Piece]], start: float, low: float, high: float, masks: Sequence[Mask]
) -> list[RodSeries]:
    """Return the load rows of a measure as series in the rod length between two lengths, one for each piece.

    Parameters
    ----------
    pieces
        Function from a length to the pieces with all their rows.
    start
        Initial length, whose factors all rows get.
    masks
        Rows of each piece that no kink passes; the other rows are set to zero, which keeps the bounds valid.

    Raises
    ------
    ValueError
        If a series does not converge, because a kink of a load moves with the length.
    """
    start_pieces = pieces(start)
    at_nodes = [_with_initial_factors(start_pieces, pieces(length), masks) for length in _lengths(low, high, TERMS)]
    series = []
    for k, piece in enumerate(start_pieces):
        constant, slope = (np.stack([getattr(node[k], part) for node in at_nodes]) for part in ("constant", "slope"))
        series.append(RodSeries(piece, low, high, constant, slope, np.zeros(0)))
    between = [low + share * (high - low) for share in CHECKED]
    exact = [_with_initial_factors(start_pieces, pieces(length), masks) for length in between]
    return [_with_remainder(term, between, [pieces_at[k] for pieces_at in exact]) for k, term in enumerate(series)]


def _with_initial_factors(
    start_pieces: Sequence[Piece], pieces: Sequence[Piece], masks: Sequence[Mask]
) -> list[AffineNorm]:
    norms = [
        norm.scaled(piece.initial_factors) if piece.initial_factors else norm.affine
        for piece, norm in zip(start_pieces, pieces, strict=True)
    ]
    return [
        replace(norm, constant=norm.constant * rows[:, None], slope=norm.slope * rows[:, None, None])
        for norm, rows in zip(norms, masks, strict=True)
    ]


def _with_remainder(series_at: RodSeries, lengths: Sequence[float], exact: Sequence[AffineNorm]) -> RodSeries:
    def size(rows: Array) -> float:
        return series_at.piece.affine.norm.value(series_at.piece.affine.grid, rows)

    remainders = []
    parts = [series_at.constant, *np.moveaxis(series_at.slope, -1, 0)]
    for part, j in zip(parts, range(-1, series_at.slope.shape[-1]), strict=True):
        series = np.tensordot(_terms(TERMS), part, axes=1)
        remainder = max(size(term) for term in series[-LAST_TERMS:])
        for length, length_norm in zip(lengths, exact, strict=True):
            computed, exact_norm = series_at.at_length(length), length_norm
            pairs = (
                (computed.constant, exact_norm.constant)
                if j < 0
                else (computed.slope[..., j], exact_norm.slope[..., j])
            )
            remainder = max(remainder, size(pairs[0] - pairs[1]))
        if SAFETY * remainder > CONVERGED * max(map(size, series)):
            raise ValueError(
                "a kink (jump of the slope) of a load moves with the rod length, so its series does not converge"
            )
        remainders.append(SAFETY * remainder)
    return replace(series_at, remainder=np.array(remainders))


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
