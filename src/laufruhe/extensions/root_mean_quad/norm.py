"""Root mean quad, (sum_k w_k |v_k|^4)^(1/4), which rates vibration with peaks (ISO 2631-1, eq. 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import Cones, Grid, Norm, Subdifferential, amplitudes, lengths, mean_square
from laufruhe.numerics.spectrum import Spectrum


class RootMeanQuad(Norm):
    """Fourth root of the weighted mean of the fourth powers of row lengths."""

    name = "rmq"
    averages = is_convex = is_smooth = is_monotone_in_lengths = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return (sum_k w_k |v_k|^4)^(1/4) over rows v_k with weights w_k."""
        size = np.where(grid.weights > 0.0, lengths(rows), 0.0)
        longest = float(size.max(initial=0.0))
        return longest and longest * float(grid.weights @ (size / longest) ** 4) ** 0.25

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return the gradient (dual rows) of the norm: w_k |v_k|^2 v_k / norm(V)^3; zero if the norm is zero."""
        value = self.value(grid, rows)
        if value == 0.0:
            return np.zeros_like(rows)
        share = np.where(grid.weights > 0.0, lengths(rows) / value, 0.0)
        return np.asarray((grid.weights * share**2)[:, None] * (rows / value))

    def second_derivative(self, grid: Grid, rows: Array) -> tuple[Array, Array, float]:
        """Return w_k |v_k|^2 / N^3, 2 w_k / N^3 and 3 / N for the norm N."""
        norm = self.value(grid, rows) or 1.0
        weights = grid.weights / norm
        return weights * (lengths(rows) / norm) ** 2, 2.0 * weights / norm**2, 3.0 / norm

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential:
        """Return the gradient as base, or Z at zero rows: the norm is smooth except at zero."""
        return Subdifferential(self.subgradient(grid, rows) if rows.any() else z)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the dual norm (sum_k w_k (|z_k| / w_k)^(4/3))^(3/4).

        It is infinite if a row z_k with w_k = 0 is not zero.
        """
        size, weights = lengths(z), grid.weights
        if np.any((weights == 0.0) & (size > 0.0)):
            return math.inf
        density = size / np.where(weights > 0.0, weights, 1.0)
        longest = float(density.max(initial=0.0))
        return longest and longest * float(weights @ (density / longest) ** (4.0 / 3.0)) ** 0.75

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the gradient at the design."""
        return self.subgradient(grid, rows)

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the fourth root of the weighted sum of fourth powers."""
        return np.asarray(np.sqrt(np.sqrt(np.dot(np.square(np.square(lengths)), weights))))

    def cones(self, grid: Grid) -> Cones:
        """Return cones of heads t_k >= |v_k|, s_k, r_k and T: t_k^2 <= s_k T, s_k^2 <= r_k T, sum_k w_k r_k <= T."""
        count = len(grid.weights)
        length, top = np.arange(count), np.full(count, 3 * count)
        value = np.zeros(3 * count + 1)
        value[-1] = 1.0
        return Cones(
            value,
            length,
            np.ones(count),
            linear_rows=(
                np.zeros(count + 1, dtype=np.intp),
                np.append(2 * count + length, 3 * count),
                np.append(grid.weights, -1.0),
            ),
            squares=(
                np.concatenate([length, count + length]),
                np.concatenate([count + length, 2 * count + length]),
                np.concatenate([top, top]),
            ),
        )

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return (N^4 + e^4)^(1/4) - e with N the norm and e = softness x unit."""
        import casadi as ca

        squares = ca.sum2(rows * rows) / unit**2
        return unit * (ca.sqrt(ca.sqrt(ca.dot(ca.DM(grid.weights), squares * squares) + softness**4)) - softness)

    def smooth_limit(
        self, program: Any, grid: Grid, rows: Any, maximum: float, softness: float
    ) -> tuple[Any, float, float]:
        """Return the mean of fourth powers, which is smooth at zero, and the limit maximum^4."""
        import casadi as ca

        squares = ca.sum2(rows * rows)
        return ca.dot(ca.DM(grid.weights), squares * squares), maximum**4, 4.0 * maximum**3

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return a bound by Hölder's inequality: mean |v|^4 <= max |v|^2 mean |v|^2."""
        fourth = [float((amplitudes(s) ** 2 * mean_square(s)).mean()) for s in signals]
        return math.sqrt(math.sqrt(float(shares @ np.array(fourth))))

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the sampling error of the norm: difference of sampled and exact means, plus a bound of further orders.

        |v|^4 has four times the orders of v, so a mean over more samples than these is the exact integral.
        """
        sampled, exact, beyond = 0.0, 0.0, 0.0
        for signal, share in zip(signals, shares, strict=True):
            series = signal.series
            sampled += share * float((lengths(series.sample(steps)) ** 4).mean())
            exact += share * float((lengths(series.sample(4 * len(series.coefficients) + 1)) ** 4).mean())
            if signal.kinks is not None:
                sums, roots = map(lengths, signal.kinks.beyond(len(signal.coefficients), float(signal.base)))
                beyond += share * float((sums**2 * roots**2).mean())
        return float(abs(sampled**0.25 - exact**0.25) + beyond**0.25)
