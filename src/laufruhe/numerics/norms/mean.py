"""Weighted sum of row lengths, sum_k w_k |v_k|: a mean over the cycle, or a sum of masses with weights of one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import (
    ZERO_TOL,
    Cones,
    Grid,
    Norm,
    Subdifferential,
    fine_lengths,
    lengths,
    mean_square,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum

SHORT = 1e-6
"""Smallest row length in a second derivative, as a fraction of the longest row."""
MAJORANT_FLOOR = 1e-9
"""Smallest row length in a majorant, as a fraction of the longest row."""


class Mean(Norm):
    """Weighted sum of the lengths of rows v_k with weights w_k."""

    name = "mean"
    averages = True
    sums_lengths = is_convex = is_smooth = is_monotone_in_lengths = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the weighted sum of row lengths, sum_k w_k |v_k|."""
        return float(grid.weights @ lengths(rows))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return the dual rows w_k v_k / |v_k|, zero for zero rows."""
        size = lengths(rows)
        return np.asarray(grid.weights[:, None] * rows / np.where(size > 0.0, size, 1.0)[:, None])

    def second_derivative(self, grid: Grid, rows: Array) -> tuple[Array, Array, float]:
        """Return w_k / |v_k| and -w_k / |v_k|^3 of each row, with a small length in place of zero."""
        size = lengths(rows)
        size = np.maximum(size, SHORT * float(size.max(initial=0.0)) or 1.0)
        return grid.weights / size, -grid.weights / size**3, 0.0

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential:
        """Return all subgradients of the mean: w_k v_k / |v_k| as base, and indices of zero rows, which are free."""
        size = lengths(rows)
        vanishing = size <= ZERO_TOL * float(size.max(initial=0.0))
        base = np.where(vanishing[:, None], 0.0, self.subgradient(grid, rows))
        return Subdifferential(base, vanishing=np.flatnonzero(vanishing))

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the dual norm of dual rows z_k: max_k |z_k| / w_k; infinite if a row without weight is not zero."""
        size, weights = lengths(z), grid.weights
        if np.any((weights == 0.0) & (size > 0.0)):
            return math.inf
        return float((size / np.where(weights > 0.0, weights, 1.0)).max(initial=0.0))

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Return Z with every row shortened to at most its weight."""
        size, weights = lengths(z), grid.weights
        shrink = np.divide(weights, size, out=np.ones(len(size)), where=size > weights)
        return np.asarray(z * shrink[:, None])

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the subgradient at the design, and the solver's Z where a row vanishes."""
        size = lengths(rows)
        small = size <= 1e-6 * float(size.max(initial=0.0))
        return np.where(small[:, None], z, self.subgradient(grid, rows))

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the weighted sum of lengths."""
        return np.asarray(np.dot(lengths, weights))

    def majorant(self, grid: Grid, lengths: Array) -> tuple[Array, float]:
        """Return the sum of |v| <= (|v|^2 / c + c) / 2 over all rows, c the given length of each."""
        size = np.maximum(lengths, MAJORANT_FLOOR * float(lengths.max(initial=0.0)) or 1.0)
        return grid.weights / size, 0.5 * float(grid.weights @ size)

    def cones(self, grid: Grid) -> Cones:
        """Return one cone for each row, with a head of its own."""
        count = len(grid.weights)
        return Cones(grid.weights, np.arange(count), np.ones(count))

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return the weighted sum of row lengths, rounded near zero by e = softness x unit (N3)."""
        import casadi as ca

        return ca.dot(ca.DM(grid.weights), softened_lengths(rows, softness * unit))

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return the root mean square at each place, averaged over places and operating points."""
        squares = np.array([mean_square(signal) for signal in signals])
        return float(shares @ np.sqrt(squares).mean(axis=1))

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the change of the mean to fine samples, plus the spreads of its halves and thirds (F7)."""
        times, total = 6 * max(1, finest // (6 * steps)), 0.0
        for signal, share in zip(signals, shares, strict=True):
            if share > 0.0:
                sixths = fine_lengths(signal, steps, times)[0].reshape(-1, 6, signal.coefficients.shape[1]).mean((0, 2))
                halves, thirds = sixths.reshape(3, 2).mean(axis=0), sixths.reshape(2, 3).mean(axis=0)
                sampled = lengths(signal.series.sample(steps)).mean()
                total += share * float(abs(sampled - sixths.mean()) + np.ptp(halves) + np.ptp(thirds))
        return total
