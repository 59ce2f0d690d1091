"""Pieces of a measure: rows that share their factors of sizes (Z12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.norms.norm import lengths


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of a measure that share their factors.

    Attributes
    ----------
    affine
        Norm affine in the columns; rows at the initial sizes.
    positions
        For each operating point, its index, its place (None for all places) and the count of rows.
    initial_factors
        Initial factors of each operating point, shape (places, 1 or d).
    """

    affine: AffineNorm
    positions: tuple[tuple[int, int | None, int], ...]
    initial_factors: tuple[Array, ...]

    def ratio(self, factors: Sequence[Array]) -> float | None:
        """Return the ratio of all factors to the initial ones, or None if the ratios differ."""
        if not factors:
            return 1.0
        pairs = zip(factors, self.initial_factors, strict=True)
        ratios = np.concatenate([(factor / initial).ravel() for factor, initial in pairs])
        return float(ratios[0]) if np.all(ratios == ratios[0]) else None

    def scaled(self, factors: Sequence[Array]) -> AffineNorm:
        """Return the norm with other factors."""
        ratios = self.ratios(factors)
        return replace(self.affine, constant=self.affine.constant * ratios, slope=self.affine.slope * ratios[..., None])

    def ratios(self, factors: Sequence[Array]) -> Array:
        """Return the ratio of other factors to the initial ones for each row, shape (k, 1 or d)."""
        parts = zip(factors, self.initial_factors, self.positions, strict=True)
        return np.concatenate([np.repeat(factor / initial, rows, axis=0) for factor, initial, (_, _, rows) in parts])

    def value(self, factors: Sequence[Array], columns: Array) -> float:
        """Return the value of the norm with other factors at `columns`."""
        ratio = self.ratio(factors)
        return self.scaled(factors).value(columns) if ratio is None else ratio * self.affine.value(columns)

    def pruned(self, low: Array, high: Array) -> Piece:
        """Return the piece of a maximum without rows that are largest for no columns between `low` and `high`."""
        affine_rows, reach = self.affine, 0.5 * (high - low)
        size = lengths(affine_rows.rows(low + reach))
        change = np.sqrt(np.square(affine_rows.slope).sum(axis=1)) @ reach
        may_be_largest = size + change >= (size - change).max()
        affine = replace(
            affine_rows,
            constant=affine_rows.constant[may_be_largest],
            slope=affine_rows.slope[may_be_largest],
            grid=plain(int(may_be_largest.sum())),
        )
        return replace(
            self, affine=affine, positions=tuple((k, place, affine.grid.steps) for k, place, _ in self.positions)
        )


def plain(rows: int) -> Grid:
    """Return the grid of equally weighted rows."""
    return Grid(np.full(rows, 1.0 / max(rows, 1)), rows)
