"""Worst mean, max_p mean_p |v_k|: the mean over cycle and places, at the operating point where it is largest.

Weights of operating points do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.mean import Mean
from laufruhe.numerics.norms.norm import (
    LONGEST_TOL,
    Cones,
    Grid,
    Norm,
    Subdifferential,
    hull,
    lengths,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum

_MEAN = Mean()


class WorstMean(Norm):
    """Maximum over operating points of the mean length of their rows."""

    name = "worst mean"
    averages = True
    is_largest_mean = is_convex = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the largest mean row length of any operating point, max_p mean_p |v_k|."""
        return float(self._means(grid, rows).max(initial=0.0))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return the subgradient of the mean at the worst operating point."""
        means, z = self._means(grid, rows), np.zeros_like(rows)
        if len(means):
            part, grid_of_point = _of_point(grid, int(np.argmax(means)))
            z[part] = _MEAN.subgradient(grid_of_point, rows[part])
        return z

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return the subgradients of the largest means; None if one of their rows vanishes."""
        means, subgradients = self._means(grid, rows), list[Array]()
        for point in np.flatnonzero(means >= (1.0 - LONGEST_TOL) * means.max(initial=0.0)):
            (part, grid_of_point), base = _of_point(grid, int(point)), np.zeros_like(rows)
            mean = _MEAN.subdifferential(grid_of_point, rows[part], rows[part])
            if len(mean.vanishing):
                return None
            base[part] = mean.base
            subgradients.append(base)
        return hull(subgradients)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return sum_p max_k |z_k| / w_k over dual rows z_k; the weights w_k of each operating point p sum to one."""
        return float(self._dual_norms(grid, z).sum())

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return dual rows along the design's load rows; at every operating point they have the dual norm of Z.

        Load rows of nearly zero length have no direction; there Z is returned.
        """
        size, shares = lengths(rows), _shares(grid)
        dual_norms = np.repeat(self._dual_norms(grid, z), _size(grid))
        small = size <= 1e-6 * float(size.max(initial=0.0))
        directions = rows * (dual_norms * shares / np.where(size > 0.0, size, 1.0))[:, None]
        return np.where(small[:, None], z, directions)

    def cones(self, grid: Grid) -> Cones:
        """Return the cones of the norm: each row length is at most a variable.

        One more is at least every point's mean.
        """
        count, size = len(grid.weights), _size(grid)
        point = np.arange(count) // size
        value = np.zeros(count + 1)
        value[-1] = 1.0
        linear_rows = (
            np.concatenate([point, np.arange(grid.points)]),
            np.concatenate([np.arange(count), np.full(grid.points, count)]),
            np.concatenate([_shares(grid), np.full(grid.points, -1.0)]),
        )
        return Cones(value, np.arange(count), np.ones(count), linear_rows=linear_rows)

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return a variable of the smooth program: at least every point's mean row length, rounded at zero (E22)."""
        import casadi as ca

        weights = ca.DM(_shares(grid).reshape(grid.points, _size(grid)))
        softened = softened_lengths(rows, softness * unit) / unit
        means = ca.sum2(weights * ca.reshape(softened, _size(grid), grid.points).T)
        top = program.head(ca.mmax(means))
        program.hold(means - top)
        return top * unit

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return the largest upper bound of the mean at any operating point."""
        return max((_MEAN.upper_bound([signal], np.ones(1)) for signal in _counted(signals, shares)), default=0.0)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the largest bound of the sampling error of the mean, over the operating points that count."""
        errors = (_MEAN.sampling_bound([signal], np.ones(1), steps, finest) for signal in _counted(signals, shares))
        return max(errors, default=0.0)

    def _means(self, grid: Grid, rows: Array) -> Array:
        return np.asarray((_shares(grid) * lengths(rows)).reshape(grid.points, _size(grid)).sum(axis=1))

    def _dual_norms(self, grid: Grid, z: Array) -> Array:
        # dual norm of the rows of each operating point
        blocks = zip(
            _shares(grid).reshape(grid.points, _size(grid)),
            z.reshape(grid.points, _size(grid), z.shape[-1]),
            strict=True,
        )
        return np.array([_MEAN.dual_norm(Grid(shares, grid.steps), block) for shares, block in blocks])


def _size(grid: Grid) -> int:
    return len(grid.weights) // grid.points


def _shares(grid: Grid) -> Array:
    blocks = grid.weights.reshape(grid.points, _size(grid))
    sums = blocks.sum(axis=1, keepdims=True)
    return np.asarray(blocks / np.where(sums > 0.0, sums, 1.0)).reshape(-1)


def _of_point(grid: Grid, point: int) -> tuple[slice, Grid]:
    # rows of an operating point, and their grid
    rows = slice(point * _size(grid), (point + 1) * _size(grid))
    return rows, Grid(_shares(grid)[rows], grid.steps)


def _counted(signals: Sequence[Spectrum], shares: Array) -> list[Spectrum]:
    return [signal for signal, share in zip(signals, shares, strict=True) if share > 0.0]
