"""Worst mean, max_p mean_p |v_k|: the mean over cycle and places, at the operating point where it is largest.

Weights of operating points do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

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
    norm_instance,
    softened_lengths,
)
from laufruhe.numerics.norms.rms import RootMeanSquare
from laufruhe.numerics.spectrum import Spectrum


class WorstMean(Norm):
    """Maximum over operating points of the mean length of their rows.

    A subclass with another norm at each point, `at_point`, has its own cones and smooth form.
    """

    name = "worst mean"
    at_point: ClassVar[Norm] = Mean()
    averages = True
    is_largest_mean = is_convex = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the largest norm of any operating point, here max_p mean_p |v_k|."""
        return float(self._values(grid, rows).max(initial=0.0))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return the subgradient of the norm at the worst operating point."""
        values, z = self._values(grid, rows), np.zeros_like(rows)
        if len(values):
            part, grid_of_point = _of_point(grid, int(np.argmax(values)))
            z[part] = self.at_point.subgradient(grid_of_point, rows[part])
        return z

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return the subgradients of the largest values of points; None if one of their rows vanishes."""
        values, subgradients = self._values(grid, rows), list[Array]()
        for point in np.flatnonzero(values >= (1.0 - LONGEST_TOL) * values.max(initial=0.0)):
            (part, grid_of_point), base = _of_point(grid, int(point)), np.zeros_like(rows)
            at_point = self.at_point.subdifferential(grid_of_point, rows[part], rows[part])
            if at_point is None or len(at_point.vanishing):
                return None
            base[part] = at_point.base
            subgradients.append(base)
        return hull(subgradients)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the sum of dual norms of points, here max_k |z_k| / w_k; the weights w_k of a point sum to one."""
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
        """Return the largest upper bound of the norm at any operating point."""
        return max(
            (self.at_point.upper_bound([signal], np.ones(1)) for signal in _counted(signals, shares)), default=0.0
        )

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the largest bound of the sampling error of the norm, over the operating points that count."""
        at_points = (
            self.at_point.sampling_bound([signal], np.ones(1), steps, finest) for signal in _counted(signals, shares)
        )
        return max(at_points, default=0.0)

    def _values(self, grid: Grid, rows: Array) -> Array:
        return self._at_points(grid, rows, self.at_point.value)

    def _dual_norms(self, grid: Grid, z: Array) -> Array:
        return self._at_points(grid, z, self.at_point.dual_norm)

    @staticmethod
    def _at_points(grid: Grid, rows: Array, norm: Callable[[Grid, Array], float]) -> Array:
        # a norm of the rows of each operating point
        parts = (_of_point(grid, point) for point in range(grid.points))
        return np.array([norm(grid_of_point, rows[part]) for part, grid_of_point in parts])


class WorstRms(WorstMean):
    """Maximum over operating points of the root mean square of their rows."""

    name = "worst rms"
    at_point = RootMeanSquare()
    is_largest_mean = False

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the gradients at the design's rows, times the dual norm of Z at every operating point."""
        norms = self._at_points(grid, z, self.at_point.dual_norm)
        values = self._at_points(grid, rows, self.at_point.value)
        factors = np.repeat(norms / np.where(values > 0.0, values, 1.0), _size(grid))
        return np.asarray((factors * _shares(grid))[:, None] * rows)

    def cones(self, grid: Grid) -> Cones:
        """Return cones of heads s_k >= |v_k|, q_k and T: s_k^2 <= q_k T, sum_k w_k q_k <= T at each operating point."""
        count, points = len(grid.weights), grid.points
        row, top = np.arange(count), np.full(count, 2 * count)
        linear_rows = (
            np.concatenate([row // _size(grid), np.arange(points)]),
            np.concatenate([count + row, top[:points]]),
            np.concatenate([_shares(grid), np.full(points, -1.0)]),
        )
        value = np.append(np.zeros(2 * count), 1.0)
        return Cones(value, row, np.ones(count), linear_rows=linear_rows, squares=(row, count + row, top))

    def smooth_expression(self, *_: Any) -> Any:
        """Raise an error: only programs of unbalances have this norm."""
        raise self._unclaimed("smooth form")


def worst_of(norm: Norm) -> Norm:
    """Return the norm that is the largest value of a mean, an rms or a maximum at any operating point."""
    worst = {"mean": WorstMean, "worst mean": WorstMean, "rms": WorstRms}
    return norm_instance(worst[norm.name]) if norm.name in worst else norm


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
