"""Peak-to-peak seminorm, 2 min_c max_k |v_k - c|: the diameter of the smallest enclosing ball of a signal.

For one component it is the largest value less the smallest. The mean of a signal does not count, so the dual rows of
each signal sum to zero; their lengths sum to at most two. The norm of several signals is the largest of theirs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.norms.maximum import Maximum
from laufruhe.numerics.norms.norm import (  # fmt: skip
    LONGEST_TOL,
    MAX_KINKS,
    Cones,
    Grid,
    Norm,
    Subdifferential,
    curvature,
    hull,
    lengths,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum

SAME = 1e-13
"""Relative tolerance of a radius within which a point counts as inside."""
# regularisation of the linear system for points that coincide or are collinear: relative, and absolute
_FLAT, _TINY = 1e-15, 1e-290


@dataclass(frozen=True, eq=False)
class EnclosingBalls:
    """Smallest enclosing ball of each of several sets of points in d dimensions.

    Attributes
    ----------
    radii
        Radius of each ball, shape (sets,).
    centres
        Centre of each ball, shape (sets, d).
    support
        Indices of the support points of each ball, shape (sets, d + 1); fewer than d + 1 points are repeated.
    shares
        Weights of the support points whose mean is the centre, shape (sets, d + 1); not negative, with sum one.
    """

    radii: Array
    centres: Array
    support: Indices
    shares: Array


def enclosing_balls(points: Array) -> EnclosingBalls:
    """Return the smallest enclosing balls of sets of points, shape (sets, k, d).

    Each round adds the point farthest from the centre to the support points and takes the smallest ball of these, by
    enumeration. Radii grow with every round, so the loop ends.
    """
    sets, count, d = points.shape
    units = np.abs(points).max(axis=(1, 2), initial=0.0)
    scaled = points / np.where(units > 0.0, units, 1.0)[:, None, None]
    all_sets = np.arange(sets)
    radii, shares = np.zeros(sets), np.zeros((sets, d + 1))
    shares[:, 0] = 1.0
    middle = 0.5 * (scaled.min(axis=1) + scaled.max(axis=1))
    support = np.repeat(_squares(scaled, middle).argmax(axis=1)[:, None], d + 1, axis=1)
    centres = scaled[all_sets, support[:, 0]]
    active = all_sets
    for _ in range(count):
        squares = _squares(scaled[active], centres[active])
        farthest = squares.argmax(axis=1)
        outside = np.sqrt(squares[np.arange(len(active)), farthest]) > radii[active] * (1.0 + SAME)
        unsolved = outside & (support[active] != farthest[:, None]).all(axis=1)
        active, farthest = active[unsolved], farthest[unsolved]
        if not len(active):
            break
        candidates = np.concatenate([support[active], farthest[:, None]], axis=1)
        selection, radii[active], centres[active], shares[active] = _ball_of_candidates(
            scaled[active[:, None], candidates]
        )
        support[active] = np.take_along_axis(candidates, selection, axis=1)
    return EnclosingBalls(radii * units, centres * units[:, None], support, shares)


def _squares(points: Array, centres: Array) -> Array:
    offsets = points - centres[:, None]
    return np.asarray(np.einsum("skd,skd->sk", offsets, offsets))


def _ball_of_candidates(points: Array) -> tuple[Indices, Array, Array, Array]:
    """Return support indices, radii, centres and weights of the balls of d + 2 points, shape (sets, d + 2, d).

    The last point lies outside the ball of the others, so it is a support point. Among the circumcentres of all subsets
    with it, the centre is the one whose farthest point is nearest.
    """
    sets, count, d = points.shape
    support, shares = np.full((sets, d + 1), count - 1), np.zeros((sets, d + 1))
    radii, centres, active = np.full(sets, np.inf), np.zeros((sets, d)), np.arange(sets)
    done = np.zeros(sets, dtype=bool)
    for size in range(2, d + 2):
        choices = _choices(count, size)
        remaining = points[active]
        corners = remaining[:, choices]
        parts = np.maximum(_centre_shares(corners), 0.0)
        parts /= parts.sum(axis=2, keepdims=True)
        middles = np.einsum("sck,sckd->scd", parts, corners)
        offsets = remaining[:, None] - middles[:, :, None]
        distances = np.sqrt(np.einsum("sckd,sckd->sck", offsets, offsets))
        farthest = distances.max(axis=2)
        best = farthest.argmin(axis=1)
        row = np.arange(len(active))
        better = farthest[row, best] < radii[active]
        improved, best, row = active[better], best[better], row[better]
        radii[improved], centres[improved] = farthest[row, best], middles[row, best]
        shares[improved], support[improved] = 0.0, count - 1
        shares[improved, :size], support[improved, :size] = parts[row, best], choices[best]
        # a ball whose support points are as far as any point is the smallest
        support_distance = distances[row[:, None], best[:, None], choices[best]].min(axis=1)
        done[improved] = farthest[row, best] <= support_distance * (1.0 + SAME)
        active = np.flatnonzero(~done)
        if not len(active):
            break
    return support, radii, centres, shares


@cache
def _choices(count: int, size: int) -> Indices:
    choices = [(*first, count - 1) for first in itertools.combinations(range(count - 1), size - 1)]
    return np.array(choices)


def _centre_shares(points: Array) -> Array:
    edges = points[..., 1:, :] - points[..., :1, :]
    products = edges @ edges.swapaxes(-1, -2)
    squares = np.einsum("...kk->...k", products).copy()
    size = edges.shape[-2]
    products += (_FLAT * squares.sum(axis=-1) + _TINY)[..., None, None] * np.eye(size)
    shares = 0.5 * np.linalg.solve(products, squares[..., None])[..., 0]
    return np.concatenate([1.0 - shares.sum(axis=-1, keepdims=True), shares], axis=-1)


SAME_WAY = 1e-3
"""Tolerance within which unit vectors to support points count as equal."""


class PeakToPeak(Norm):
    """Largest diameter of the enclosing balls of the signals."""

    name = "peak to peak"
    refinement = 8
    is_diameter = is_convex = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the largest diameter of the smallest enclosing ball of any signal."""
        return _diameter(_signals(rows, grid.steps))

    def values(self, grid: Grid, row_sets: Array) -> Array:
        """Return the largest diameter of each set of rows, shape (n, k, d) to (n,)."""
        balls = enclosing_balls(_signals(row_sets, grid.steps))
        return np.asarray(2.0 * balls.radii.reshape(len(row_sets), -1).max(axis=1, initial=0.0))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return a subgradient (dual rows) of the peak to peak of the worst signal.

        It has unit vectors from the centre of the largest enclosing ball to its support points, weighted.
        """
        z = np.zeros_like(rows)
        balls = enclosing_balls(_signals(rows, grid.steps))
        if balls.radii.max(initial=0.0) > 0.0:
            largest = int(np.argmax(balls.radii))
            support, shares = largest * grid.steps + balls.support[largest], balls.shares[largest]
            directions = (rows[support] - balls.centres[largest]) / balls.radii[largest]
            np.add.at(z, support, 2.0 * shares[:, None] * directions)
        return z

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return the subgradients of all sets of support points of the largest balls; None if there are many (P19).

        A ball in d dimensions has at most d + 1 affinely independent support points; other subgradients are convex
        combinations of theirs.
        """
        balls, subgradients = enclosing_balls(_signals(rows, grid.steps)), list[Array]()
        largest = float(balls.radii.max(initial=0.0))
        for k in np.flatnonzero(balls.radii >= (1.0 - LONGEST_TOL) * largest) if largest else ():
            first = int(k) * grid.steps
            directions = (rows[first : first + grid.steps] - balls.centres[k]) / balls.radii[k]
            peaks = _peaks(lengths(directions))
            count = int(np.linalg.matrix_rank(_balance(directions[peaks]), tol=SAME_WAY)) if len(peaks) else 0
            if math.comb(len(peaks), count) > MAX_KINKS:
                return None
            for subset in combinations(peaks.tolist(), count):
                shares = _shares_of(directions[[*subset]])
                if shares is not None:
                    subgradient = np.zeros_like(rows)
                    subgradient[first + np.array(subset)] = 2.0 * shares[:, None] * directions[[*subset]]
                    subgradients.append(subgradient)
        return hull(subgradients)

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return half the sum of lengths of the dual rows; infinite if those of a signal do not sum to zero."""
        sums = np.array([signal.sum(axis=0) for signal in _signals(z, grid.steps)])
        total = float(lengths(z).sum())
        return 0.5 * total if np.abs(sums).max(initial=0.0) <= 1e-12 * total else math.inf

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Return Z less its mean over each signal, scaled into the unit ball."""
        return super().dual_feasible(grid, self.balanced_dual(grid, z))

    def balanced_dual(self, grid: Grid, z: Array) -> Array:
        """Return Z less its mean over each signal."""
        blocks = z.reshape(-1, grid.steps, z.shape[-1])
        return np.asarray(blocks - blocks.mean(axis=1, keepdims=True)).reshape(z.shape)

    def cones(self, grid: Grid) -> Cones:
        """Return cones for all rows with one common head, and a free centre for each signal."""
        count = len(grid.weights)
        return Cones(np.full(1, 2.0), np.zeros(count, dtype=np.intp), np.ones(count), centred=True)

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return twice a variable of the smooth program that is at least the radius of every enclosing ball (E22).

        Distances from the centre are rounded near zero by e = softness x unit (N3).
        """
        import casadi as ca

        rows = rows / unit
        signals = [rows[k : k + grid.steps, :] for k in range(0, rows.shape[0], grid.steps)]
        middles = [ca.sum1(signal) / grid.steps for signal in signals]
        reach = [
            ca.mmax(ca.sum2((s - ca.repmat(m, grid.steps, 1)) ** 2)) for s, m in zip(signals, middles, strict=True)
        ]
        top = program.head(ca.sqrt(ca.mmax(ca.vertcat(*reach))))
        for signal, middle in zip(signals, middles, strict=True):
            centre = program.free(middle)
            program.hold(softened_lengths(signal - ca.repmat(centre, grid.steps, 1), softness) - top)
        return 2.0 * unit * top

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return twice the sum of the amplitudes of all orders but zero."""
        return 2.0 * Maximum().upper_bound([signal.without_mean for signal in signals], shares)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return an upper bound of the sampling error: spread over shifted samples, and curvature between them.

        `shares` has the weight of each operating point.
        """
        coarse = steps * self.refinement
        times, errors, curvatures = max(2, math.ceil(finest / coarse)), [0.0], [0.0]
        for signal, share in zip(signals, shares, strict=True):
            if share == 0.0:
                continue
            samples = signal.sample(coarse * times).swapaxes(0, 1)
            step = 2.0 * math.pi / float(signal.base) / (coarse * times)
            curvatures.append(step**2 / 8.0 * 2.0 * float(curvature(signal).max(initial=0.0)))
            for place, kink_values in zip(samples, signal.values(signal.kink_angles).swapaxes(0, 1), strict=True):
                diameter, starts = _reach(place, kink_values), (place[first::times] for first in range(times))
                errors.append(max(diameter - _reach(start, kink_values) for start in starts))
        return max(errors) + max(curvatures)


def _signals(rows: Array, steps: int) -> Array:
    return rows.reshape(-1, steps, rows.shape[-1])


def _peaks(sizes: Array) -> NDArray[np.intp]:
    touching = np.flatnonzero(sizes >= (1.0 - LONGEST_TOL) * sizes.max(initial=0.0))
    groups = np.split(touching, np.flatnonzero(np.diff(touching) > 1) + 1)
    if len(groups) > 1 and groups[0][0] == 0 and groups[-1][-1] == len(sizes) - 1:
        groups = [np.concatenate([groups.pop(), groups[0]]), *groups[1:]]
    return np.array([group[np.argmax(sizes[group])] for group in groups if len(group)], dtype=np.intp)


def _balance(directions: Array) -> Array:
    return np.vstack([directions.T, np.ones(len(directions))])


def _shares_of(directions: Array) -> Array | None:
    system = _balance(directions)
    right = np.zeros(len(system))
    right[-1] = 1.0
    shares, _, rank, _ = np.linalg.lstsq(system, right, rcond=SAME_WAY)
    near = np.abs(system @ shares - right).max() <= SAME_WAY and shares.min() >= -SAME_WAY
    return np.maximum(shares, 0.0) if near and rank == len(directions) else None


def _reach(steps: Array, kink_values: Array) -> float:
    return _diameter(np.concatenate([steps, kink_values])[None])


def _diameter(signals: Array) -> float:
    return float(2.0 * enclosing_balls(signals).radii.max(initial=0.0))
