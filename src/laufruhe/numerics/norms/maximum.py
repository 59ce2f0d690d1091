"""Maximum norm, max_k |v_k|: the peak over the cycle, over places and operating points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import (
    DUAL_TOL,
    LONGEST_TOL,
    Cones,
    Grid,
    Norm,
    Subdifferential,
    amplitudes,
    curvature,
    fine_lengths,
    lengths,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum


class Maximum(Norm):
    """Largest length of the rows v_k."""

    name = "maximum"
    refinement = 8
    is_largest = is_convex = is_monotone_in_lengths = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the largest row length, max_k |v_k|."""
        return float(lengths(rows).max(initial=0.0))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return a subgradient (dual rows) of the maximum: v_k / |v_k| for the longest row, zero for all others."""
        size, z = lengths(rows), np.zeros_like(rows)
        k = int(np.argmax(size)) if len(size) else 0
        if len(size) and size[k] > 0.0:
            z[k] = rows[k] / size[k]
        return z

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential:
        """Return Z as base, and the rows that are as long as the longest or in use in Z."""
        size, shares = lengths(rows), lengths(z)
        counts = (size >= (1.0 - LONGEST_TOL) * size.max(initial=0.0)) | (shares > DUAL_TOL * shares.sum())
        return Subdifferential(z, np.flatnonzero(counts & (size > 0.0)))

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the sum of the lengths of the dual rows, sum_k |z_k|."""
        return float(lengths(z).sum())

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the largest length."""
        return np.asarray(lengths.max(axis=-1))

    def cones(self, grid: Grid) -> Cones:
        """Return cones for all rows with one common head."""
        count = len(grid.weights)
        return Cones(np.ones(1), np.zeros(count, dtype=np.intp), np.ones(count))

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return a variable of the smooth program that is at least every row length, rounded near zero (E22, N3)."""
        import casadi as ca

        top = program.head(ca.mmax(ca.sqrt(ca.sum2(rows * rows))) / unit)
        program.hold(softened_lengths(rows / unit, softness) - top)
        return top * unit

    def smooth_limit(
        self, program: Any, grid: Grid, rows: Any, maximum: float, softness: float
    ) -> tuple[Any, float, float]:
        """Return squared lengths, shape (k, 1), which are smooth at zero, and the limit maximum^2."""
        import casadi as ca

        return ca.sum2(rows * rows), maximum * maximum, 2.0 * maximum

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return the largest sum of the amplitudes of all orders at one place."""
        counted = [signal for signal, share in zip(signals, shares, strict=True) if share > 0.0]
        return max((float(amplitudes(signal).max(initial=0.0)) for signal in counted), default=0.0)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return an upper bound of the sampling error: spread over shifted samples, and curvature between them.

        `shares` has the weight of each operating point.
        """
        coarse = steps * self.refinement
        times, errors, curvatures = max(2, math.ceil(finest / coarse)), [0.0], [0.0]
        for signal, share in zip(signals, shares, strict=True):
            if share > 0.0:
                size, step = fine_lengths(signal, coarse, times)
                curvatures.append(step**2 / 8.0 * float(curvature(signal).max(initial=0.0)))
                kink_lengths = lengths(signal.values(signal.kink_angles)).max(axis=0, initial=0.0)
                maximum, minimum = size.max(axis=(0, 1)), size.max(axis=0).min(axis=0)
                errors.append(
                    float((np.maximum(maximum, kink_lengths) - np.maximum(minimum, kink_lengths)).max(initial=0.0))
                )
        return max(errors) + max(curvatures)
