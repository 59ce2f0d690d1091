"""Root mean square, sqrt(sum_k w_k |v_k|^2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import Cones, Grid, Norm, Subdifferential, lengths, mean_square
from laufruhe.numerics.spectrum import Spectrum


class RootMeanSquare(Norm):
    """Euclidean norm of rows v_k with weights w_k."""

    name = "rms"
    is_euclidean = is_convex = is_smooth = is_monotone_in_lengths = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the weighted root mean square of the row lengths, sqrt(sum_k w_k |v_k|^2)."""
        size = np.where(grid.weights > 0.0, lengths(rows), 0.0)
        largest = float(size.max(initial=0.0))
        if largest == 0.0:
            return largest
        return largest * float(np.sqrt(grid.weights @ np.square(size / largest)))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return the dual rows w_k v_k / norm(V), zero if the norm is."""
        total = self.value(grid, rows)
        return np.asarray(grid.weights[:, None] * rows / total) if total > 0.0 else np.zeros_like(rows)

    def second_derivative(self, grid: Grid, rows: Array) -> tuple[Array, Array, float]:
        """Return w_k / N, zero and 1 / N for the norm N."""
        norm = self.value(grid, rows) or 1.0
        return grid.weights / norm, np.zeros(len(rows)), 1.0 / norm

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential:
        """Return the gradient as base, or Z at zero rows: the norm is smooth except at zero."""
        return Subdifferential(self.subgradient(grid, rows) if rows.any() else z)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the dual norm sqrt(sum_k |z_k|^2 / w_k); infinite if a dual row z_k without weight is not zero."""
        size, weights = lengths(z), grid.weights
        if np.any((weights == 0.0) & (size > 0.0)):
            return math.inf
        largest = float(size.max(initial=0.0))
        if largest == 0.0:
            return 0.0
        return largest * float(np.sqrt((np.square(size / largest) / np.where(weights > 0.0, weights, 1.0)).sum()))

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the subgradient at the design."""
        return self.subgradient(grid, rows)

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the root of the weighted sum of squares."""
        return np.asarray(np.sqrt(np.dot(np.multiply(lengths, lengths, out=lengths), weights)))

    def majorant(self, grid: Grid, lengths: Array) -> tuple[Array, float]:
        """Return N <= (N^2 / c + c) / 2 for the norm N of all rows, c its value at the given lengths."""
        norm = self.value(grid, lengths[:, None]) or 1.0
        return grid.weights / norm, 0.5 * norm

    def cones(self, grid: Grid) -> Cones:
        """Return one cone with all rows, each multiplied by the root of its weight."""
        return Cones(np.ones(1), np.zeros(1, dtype=np.intp), np.sqrt(grid.weights), is_single=True)

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return sqrt(N^2 + e^2) - e with N the norm and e = softness x unit."""
        import casadi as ca

        absolute_softness = softness * unit
        return ca.sqrt(ca.dot(ca.DM(grid.weights), ca.sum2(rows * rows)) + absolute_softness**2) - absolute_softness

    def smooth_limit(
        self, program: Any, grid: Grid, rows: Any, maximum: float, softness: float
    ) -> tuple[Any, float, float]:
        """Return the mean square, which is smooth at zero, and the limit maximum^2."""
        import casadi as ca

        return ca.dot(ca.DM(grid.weights), ca.sum2(rows * rows)), maximum * maximum, 2.0 * maximum

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return the root of Parseval's sum; exact without kinks, whose orders beyond the list are bounded."""
        squares = np.array([mean_square(signal) for signal in signals])
        return math.sqrt(float(shares @ squares.mean(axis=1)))

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the sampling error of the norm: the difference between its sampled value and Parseval's exact sum."""
        squares = [float(np.square(lengths(s.series.sample(steps))).mean()) for s in signals]
        sampled = math.sqrt(float(shares @ np.array(squares)))
        # orders of kinks beyond the listed ones add between zero and a bound
        counted = self.upper_bound([s.series for s in signals], shares)
        return max(abs(sampled - counted), abs(sampled - self.upper_bound(signals, shares)))
