"""Rows of a measure of sizes that have their factors together (Z12)."""

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
    """Rows of a measure that have their factors together.

    Attributes
    ----------
    affine
        Norm that is affine in the columns; rows at the sizes that the problem starts from.
    at
        Index of every operating point in it, its places (all when None) and the rows of each.
    given
        Factors of these at the start, shape (places, 1 or d) each.
    """

    affine: AffineNorm
    at: tuple[tuple[int, int | None, int], ...]
    given: tuple[Array, ...]

    def ratio(self, factors: Sequence[Array]) -> float | None:
        """Return the ratio of all factors to the start's; None where ratios differ."""
        arrays = [np.ones(1), *(new / old for new, old in zip(factors, self.given, strict=True))][bool(factors) :]
        ratios = np.concatenate([array.ravel() for array in arrays])
        return float(ratios[0]) if np.all(ratios == ratios[0]) else None

    def scaled(self, factors: Sequence[Array]) -> AffineNorm:
        """Return the norm with other factors."""
        by = self.by(factors)
        return replace(self.affine, constant=self.affine.constant * by, slope=self.affine.slope * by[..., None])

    def by(self, factors: Sequence[Array]) -> Array:
        """Return the multiplier of every row for other factors, shape (k, 1 or d)."""
        parts = zip(factors, self.given, self.at, strict=True)
        return np.concatenate([np.repeat(new / old, rows, axis=0) for new, old, (_, _, rows) in parts])

    def value(self, factors: Sequence[Array], columns: Array) -> float:
        """Return the norm with other factors."""
        ratio = self.ratio(factors)
        return self.scaled(factors).value(columns) if ratio is None else ratio * self.affine.value(columns)

    def pruned(self, low: Array, high: Array) -> Piece:
        """Return the piece of a largest length without rows that are longest for no columns between two."""
        affine_rows, reach = self.affine, 0.5 * (high - low)
        size = lengths(affine_rows.rows(low + reach))
        moved = np.sqrt(np.square(affine_rows.slope).sum(axis=1)) @ reach
        longest = size + moved >= (size - moved).max()
        affine = replace(
            affine_rows,
            constant=affine_rows.constant[longest],
            slope=affine_rows.slope[longest],
            grid=plain(int(longest.sum())),
        )
        return replace(self, affine=affine, at=tuple((k, place, affine.grid.steps) for k, place, _ in self.at))


def plain(rows: int) -> Grid:
    """Return the grid of equally weighted rows."""
    return Grid(np.full(rows, 1.0 / max(rows, 1)), rows)
