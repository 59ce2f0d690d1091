"""sqrt(sum_k w_k |v_k|^2): the root mean square."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import Cones, EpigraphProgram, Grid, Norm, Subdifferential, lengths, mean_square
from laufruhe.numerics.spectrum import Spectrum


class RootMeanSquare(Norm):
    """Euclidean norm of weighted rows."""

    name = "rms"
    is_euclidean = is_convex = is_monotone_in_lengths = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return sqrt(sum_k w_k |v_k|^2)."""
        size = np.where(grid.weights > 0.0, lengths(rows), 0.0)
        largest = float(size.max(initial=0.0))
        if largest == 0.0:
            return largest
        return largest * float(np.sqrt(grid.weights @ np.square(size / largest)))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return w_k v_k over the norm."""
        total = self.value(grid, rows)
        return np.asarray(grid.weights[:, None] * rows / total) if total > 0.0 else np.zeros_like(rows)

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential:
        """Return rows along the design's own: the norm is smooth except at zero."""
        return Subdifferential(self.subgradient(grid, rows) if rows.any() else z)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return sqrt(sum_k |z_k|^2 / w_k); infinite where a weightless row is used."""
        size, weights = lengths(z), grid.weights
        if np.any((weights == 0.0) & (size > 0.0)):
            return math.inf
        largest = float(size.max(initial=0.0))
        if largest == 0.0:
            return 0.0
        return largest * float(np.sqrt((np.square(size / largest) / np.where(weights > 0.0, weights, 1.0)).sum()))

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the design's own direction."""
        return self.subgradient(grid, rows)

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the root of weighted squares."""
        return np.asarray(np.sqrt(np.dot(np.multiply(lengths, lengths, out=lengths), weights)))

    def majorant(self, grid: Grid, lengths: Array) -> tuple[Array, float]:
        """Return N <= (N^2 / c + c) / 2 for the whole."""
        whole = self.value(grid, lengths[:, None]) or 1.0
        return grid.weights / whole, 0.5 * whole

    def cones(self, grid: Grid) -> Cones:
        """Return a single cone over all rows, each times the root of its weight."""
        return Cones(np.ones(1), np.zeros(1, dtype=np.intp), np.sqrt(grid.weights), is_single=True)

    def smooth_expression(self, program: EpigraphProgram, grid: Grid, rows: Any, unit: Any, share: Any) -> Any:
        """Return the norm softened as a single length."""
        import casadi as ca

        softness = share * unit
        return ca.sqrt(ca.dot(ca.DM(grid.weights), ca.sum2(rows * rows)) + softness**2) - softness

    def smooth_limit(
        self, program: EpigraphProgram, grid: Grid, rows: Any, maximum: float, share: float
    ) -> tuple[Any, float, float]:
        """Limit the mean square, which is smooth at zero."""
        import casadi as ca

        return ca.dot(ca.DM(grid.weights), ca.sum2(rows * rows)), maximum * maximum, 2.0 * maximum

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return Parseval's sum, exact except for orders of kinks."""
        squares = np.array([mean_square(signal) for signal in signals])
        return math.sqrt(float(shares @ squares.mean(axis=1)))

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Compare with Parseval's sum."""
        squares = [float(np.square(lengths(s.series.sample(steps))).mean()) for s in signals]
        sampled = math.sqrt(float(shares @ np.array(squares)))
        # the orders of corners beyond those that are counted add something between nothing and a bound
        counted = self.upper_bound([s.series for s in signals], shares)
        return max(abs(sampled - counted), abs(sampled - self.upper_bound(signals, shares)))
