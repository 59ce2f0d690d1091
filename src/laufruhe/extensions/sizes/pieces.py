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
        Of the columns; rows at the sizes that the problem starts from.
    at
        Of every operating point in it, its index, its places (all when None) and the rows of each.
    given
        Factors of these at the start, shape (places, 1 or d) each.
    """

    affine: AffineNorm
    at: tuple[tuple[int, int | None, int], ...]
    given: tuple[Array, ...]

    def ratio(self, factors: Sequence[Array]) -> float | None:
        """Factor of all rows over that at the start; None where they differ."""
        found = [np.ones(1), *(new / old for new, old in zip(factors, self.given, strict=True))][bool(factors) :]
        ratios = np.concatenate([each.ravel() for each in found])
        return float(ratios[0]) if np.all(ratios == ratios[0]) else None

    def scaled(self, factors: Sequence[Array]) -> AffineNorm:
        """The norm with other factors."""
        by = self.by(factors)
        return replace(self.affine, constant=self.affine.constant * by, slope=self.affine.slope * by[..., None])

    def by(self, factors: Sequence[Array]) -> Array:
        """What every row is multiplied by for other factors, shape (k, 1 or d)."""
        parts = zip(factors, self.given, self.at, strict=True)
        return np.concatenate([np.repeat(new / old, rows, axis=0) for new, old, (_, _, rows) in parts])

    def value(self, factors: Sequence[Array], columns: Array) -> float:
        """The norm."""
        ratio = self.ratio(factors)
        return self.scaled(factors).value(columns) if ratio is None else ratio * self.affine.value(columns)

    def pruned(self, low: Array, high: Array) -> Piece:
        """Of a largest length with one factor: without rows that are not the longest for any columns between two."""
        own, reach = self.affine, 0.5 * (high - low)
        size = lengths(own.rows(low + reach))
        moved = np.sqrt(np.square(own.slope).sum(axis=1)) @ reach
        kept = size + moved >= (size - moved).max()
        affine = replace(own, constant=own.constant[kept], slope=own.slope[kept], grid=plain(int(kept.sum())))
        return replace(self, affine=affine, at=tuple((k, place, affine.grid.steps) for k, place, _ in self.at))


def plain(rows: int) -> Grid:
    """Of rows that each have the same weight."""
    return Grid(np.full(rows, 1.0 / max(rows, 1)), rows)
