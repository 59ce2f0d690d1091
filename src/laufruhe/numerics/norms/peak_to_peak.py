"""2 min_c max_k |v_k - c|: the diameter of the smallest ball that holds a signal over its cycle.

Of one component it is the largest less the smallest value. What does not alternate does
not count, so it is a seminorm: its dual rows add up to nothing over every signal, and
their lengths add up to two at the most. Of several signals it is the largest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.maximum import in_place
from laufruhe.numerics.norms.norm import (  # fmt: skip
    Cones,
    Grid,
    Norm,
    SmoothProgram,
    amplitudes,
    curvature,
    lengths,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum

SAME = 1e-13
"""Share of a radius by which a point may stand outside a ball that holds it."""


class PeakToPeak(Norm):
    """The largest diameter of the signals."""

    name = "peak to peak"
    refinement = 8
    of_row_lengths = False

    def value(self, grid: Grid, rows: Array) -> float:
        """The largest diameter."""
        return max((2.0 * _ball(signal)[0] for signal in _signals(rows, grid.steps)), default=0.0)

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Along the radii to the points that hold the largest ball, by their shares of its centre."""
        z = np.zeros_like(rows)
        balls = [_ball(signal) for signal in _signals(rows, grid.steps)]
        largest = max(range(len(balls)), key=lambda g: balls[g][0], default=0)
        if balls and balls[largest][0] > 0.0:
            radius, centre, held, shares = balls[largest]
            at = largest * grid.steps + held
            z[at] = 2.0 * shares[:, None] * (rows[at] - centre) / radius
        return z

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Half the sum of the lengths; infinite where the rows of a signal do not add up to nothing."""
        sums = np.array([signal.sum(axis=0) for signal in _signals(z, grid.steps)])
        whole = float(lengths(z).sum())
        return 0.5 * whole if np.abs(sums).max(initial=0.0) <= 1e-12 * whole else math.inf

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Balanced, then scaled."""
        return super().dual_feasible(grid, self.balanced(grid, z))

    def balanced(self, grid: Grid, z: Array) -> Array:
        """The mean of every signal taken away."""
        blocks = z.reshape(-1, grid.steps, z.shape[-1])
        return np.asarray(blocks - blocks.mean(axis=1, keepdims=True)).reshape(z.shape)

    def aligned(self, grid: Grid, rows: Array, z: Array) -> Array:
        """The solver's: several signals may be as large."""
        return z

    def spread(self, z: Array, steps: int, times: int) -> Array:
        """In place: the angles between have nothing."""
        return in_place(z, steps, times)

    def cones(self, grid: Grid) -> Cones:
        """One head over all rows, those of a signal counted from a centre that is free."""
        count = len(grid.weights)
        return Cones(np.full(1, 2.0), np.zeros(count, dtype=np.intp), np.ones(count), centred=True)

    def least(self, program: SmoothProgram, grid: Grid, rows: Any, unit: Any, share: Any) -> Any:
        """A variable over all radii (E22)."""
        return 2.0 * unit * self._radius(program, grid, rows / unit, share)

    def _radius(self, program: SmoothProgram, grid: Grid, rows: Any, share: Any) -> Any:
        import casadi as ca

        signals = [rows[k : k + grid.steps, :] for k in range(0, rows.shape[0], grid.steps)]
        middles = [ca.sum1(signal) / grid.steps for signal in signals]
        reach = [
            ca.mmax(ca.sum2((s - ca.repmat(m, grid.steps, 1)) ** 2)) for s, m in zip(signals, middles, strict=True)
        ]
        top = program.head(ca.sqrt(ca.mmax(ca.vertcat(*reach))))
        for signal, middle in zip(signals, middles, strict=True):
            centre = program.free(middle)
            program.hold(softened_lengths(signal - ca.repmat(centre, grid.steps, 1), share) - top)
        return top

    def above(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Not above twice the sum of the amplitudes of the orders that alternate."""
        used = [signal for signal, share in zip(signals, shares, strict=True) if share > 0.0]
        return max((_swing(signal) for signal in used), default=0.0)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Compared at every place where the samples could have stood, and what curvature lets these miss."""
        coarse = steps * self.refinement
        times, errors, bends = max(2, math.ceil(finest / coarse)), [0.0], [0.0]
        for signal, share in zip(signals, shares, strict=True):
            if share == 0.0:
                continue
            samples = signal.sample(coarse * times).swapaxes(0, 1)
            step = 2.0 * math.pi / float(signal.base) / (coarse * times)
            bends.append(step**2 / 8.0 * 2.0 * float(curvature(signal)[0].max(initial=0.0)))
            for place, bent in zip(samples, signal.values(signal.bends).swapaxes(0, 1), strict=True):
                whole, starts = _reach(place, bent), (place[first::times] for first in range(times))
                errors.append(max(whole - _reach(start, bent) for start in starts))
        return max(errors) + max(bends)


def _signals(rows: Array, steps: int) -> Array:
    return rows.reshape(-1, steps, rows.shape[-1])


def _swing(signal: Spectrum) -> float:
    alternating = signal.holding(np.concatenate([0.0 * signal.coefficients[:1], signal.coefficients[1:]]))
    return 2.0 * float(amplitudes(alternating).max(initial=0.0))


def _reach(steps: Array, bent: Array) -> float:
    """Diameter of the ball that holds a signal at equal steps and where it bends."""
    return 2.0 * _ball(np.concatenate([steps, bent]))[0]


def _ball(points: Array) -> tuple[float, Array, np.ndarray, Array]:
    """The smallest ball that holds points (k, d): radius, centre, the points that hold it, their shares of the centre.

    The farthest point joins those that hold the ball, and the ball of these few is found
    by trying every choice of them. The radius grows with every round, so it ends.
    """
    unit = float(np.abs(points).max(initial=0.0))
    if unit == 0.0:
        return 0.0, np.zeros(points.shape[-1]), np.zeros(1, dtype=np.intp), np.ones(1)
    scaled = points / unit
    if scaled.shape[-1] == 1:
        ends = np.array([np.argmin(scaled), np.argmax(scaled)], dtype=np.intp)
        low, high = scaled[ends]
        return 0.5 * float(high[0] - low[0]) * unit, 0.5 * (low + high) * unit, ends, np.full(2, 0.5)
    held = np.array([int(np.argmax(_apart(scaled, scaled.mean(axis=0))))], dtype=np.intp)
    radius, centre, shares = 0.0, scaled[held[0]], np.ones(1)
    for _ in range(len(points)):
        far = _apart(scaled, centre)
        farthest = int(np.argmax(far))
        if far[farthest] <= radius * (1.0 + SAME) or farthest in held:
            break
        held, radius, centre, shares = _of_few(scaled, np.append(held, farthest))
    return radius * unit, centre * unit, held, shares


def _apart(points: Array, centre: Array) -> Array:
    """Distances of points none of whose coordinates is over one."""
    away = points - centre
    return np.asarray(np.sqrt(np.einsum("kd,kd->k", away, away)))


def _of_few(points: Array, few: np.ndarray) -> tuple[np.ndarray, float, Array, Array]:
    """The smallest ball of a handful: that of the subset whose own ball, centred between them, holds all."""
    best: tuple[np.ndarray, float, Array, Array] | None = None
    for size in range(2, min(len(few), points.shape[-1] + 1) + 1):
        for subset in itertools.combinations(few, size):
            chosen = np.array(subset, dtype=np.intp)
            shares = _centre_shares(points[chosen])
            if shares.min() < -1e-9:
                continue
            shares = np.maximum(shares, 0.0) / np.maximum(shares, 0.0).sum()
            centre = shares @ points[chosen]
            radius = float(_apart(points[chosen], centre).max())
            outside = float(_apart(points[few], centre).max())
            if outside <= radius * (1.0 + 1e-12) and (best is None or radius < best[1]):
                best = chosen, max(radius, outside), centre, shares
    if best is None:
        # points that all but coincide with others: a ball about their middle holds them too
        shares = np.full(len(few), 1.0 / len(few))
        centre = shares @ points[few]
        return few, float(_apart(points[few], centre).max()), centre, shares
    return best


def _centre_shares(points: Array) -> Array:
    """Shares that add up to one of the point as far from each of these, in the plane that they span."""
    apart = points[1:] - points[0]
    shares, *_ = np.linalg.lstsq(2.0 * apart @ apart.T, np.einsum("kd,kd->k", apart, apart), rcond=None)
    return np.concatenate([[1.0 - shares.sum()], shares])
