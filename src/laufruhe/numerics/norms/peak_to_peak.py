"""2 min_c max_k |v_k - c|: the diameter of the smallest ball that holds a signal over its cycle.

Of one component it is the largest less the smallest value. What does not alternate does
not count, so it is a seminorm: its dual rows add up to nothing over every signal, and
their lengths add up to two at the most. Of several signals it is the largest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.enclosing_ball import enclosing_balls
from laufruhe.numerics.norms.maximum import in_place
from laufruhe.numerics.norms.norm import (  # fmt: skip
    LONGEST_TOL,
    MOST_KINKS,
    Cones,
    EpigraphProgram,
    Grid,
    Norm,
    Subdifferential,
    amplitudes,
    curvature,
    lengths,
    softened_lengths,
)
from laufruhe.numerics.spectrum import Spectrum

SAME_WAY = 1e-3
"""Share of a radius that tells directions apart."""


class PeakToPeak(Norm):
    """Largest diameter of the signals."""

    name = "peak to peak"
    refinement = 8
    is_diameter = is_convex = is_pointwise = True

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the largest diameter."""
        return _diameter(_signals(rows, grid.steps))

    def values(self, grid: Grid, many: Array) -> Array:
        """Return the largest diameter of each of many signals."""
        balls = enclosing_balls(_signals(many, grid.steps))
        return np.asarray(2.0 * balls.radii.reshape(len(many), -1).max(axis=1, initial=0.0))

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return radii to the points that hold the largest ball, by their shares of its centre."""
        z = np.zeros_like(rows)
        balls = enclosing_balls(_signals(rows, grid.steps))
        if balls.radii.max(initial=0.0) > 0.0:
            largest = int(np.argmax(balls.radii))
            at, shares = largest * grid.steps + balls.inside[largest], balls.shares[largest]
            along = (rows[at] - balls.centres[largest]) / balls.radii[largest]
            np.add.at(z, at, 2.0 * shares[:, None] * along)
        return z

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return the shares of points that hold every largest ball; None where they are many (P19).

        No more points than directions and one have shares of their own; all others are mixtures of these.
        """
        balls, found = enclosing_balls(_signals(rows, grid.steps)), list[Array]()
        largest = float(balls.radii.max(initial=0.0))
        for k in np.flatnonzero(balls.radii >= (1.0 - LONGEST_TOL) * largest) if largest else ():
            first = int(k) * grid.steps
            along = (rows[first : first + grid.steps] - balls.centres[k]) / balls.radii[k]
            at = _peaks(lengths(along))
            count = int(np.linalg.matrix_rank(_balance(along[at]), tol=SAME_WAY)) if len(at) else 0
            if math.comb(len(at), count) > MOST_KINKS:
                return None
            for few in combinations(at.tolist(), count):
                shares = _shares_of(along[[*few]])
                if shares is not None:
                    own = np.zeros_like(rows)
                    own[first + np.array(few)] = 2.0 * shares[:, None] * along[[*few]]
                    found.append(own)
        return Subdifferential(found[0], others=tuple(found[1:])) if 0 < len(found) <= MOST_KINKS else None

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return half the sum of lengths; infinite if the rows of a signal do not add up to zero."""
        sums = np.array([signal.sum(axis=0) for signal in _signals(z, grid.steps)])
        whole = float(lengths(z).sum())
        return 0.5 * whole if np.abs(sums).max(initial=0.0) <= 1e-12 * whole else math.inf

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Balance, then scale."""
        return super().dual_feasible(grid, self.balanced_dual(grid, z))

    def balanced_dual(self, grid: Grid, z: Array) -> Array:
        """Subtract the mean of every signal."""
        blocks = z.reshape(-1, grid.steps, z.shape[-1])
        return np.asarray(blocks - blocks.mean(axis=1, keepdims=True)).reshape(z.shape)

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return the solver's rows: several signals may be as large."""
        return z

    def refined_dual(self, z: Array, steps: int, times: int) -> Array:
        """Return the rows in place, with zeros at the angles between."""
        return in_place(z, steps, times)

    def cones(self, grid: Grid) -> Cones:
        """Return a single head over all rows, each signal counted from a free centre."""
        count = len(grid.weights)
        return Cones(np.full(1, 2.0), np.zeros(count, dtype=np.intp), np.ones(count), centred=True)

    def smooth_expression(self, program: EpigraphProgram, grid: Grid, rows: Any, unit: Any, share: Any) -> Any:
        """Return a variable over all radii (E22)."""
        return 2.0 * unit * self._radius(program, grid, rows / unit, share)

    def _radius(self, program: EpigraphProgram, grid: Grid, rows: Any, share: Any) -> Any:
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

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Bound by twice the sum of the amplitudes of alternating orders."""
        used = [signal for signal, share in zip(signals, shares, strict=True) if share > 0.0]
        return max((_swing(signal) for signal in used), default=0.0)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Compare all shifts of the samples, and add what curvature hides between them."""
        coarse = steps * self.refinement
        times, errors, bends = max(2, math.ceil(finest / coarse)), [0.0], [0.0]
        for signal, share in zip(signals, shares, strict=True):
            if share == 0.0:
                continue
            samples = signal.sample(coarse * times).swapaxes(0, 1)
            step = 2.0 * math.pi / float(signal.base) / (coarse * times)
            bends.append(step**2 / 8.0 * 2.0 * float(curvature(signal)[0].max(initial=0.0)))
            for place, bent in zip(samples, signal.values(signal.kink_angles).swapaxes(0, 1), strict=True):
                whole, starts = _reach(place, bent), (place[first::times] for first in range(times))
                errors.append(max(whole - _reach(start, bent) for start in starts))
        return max(errors) + max(bends)


def _signals(rows: Array, steps: int) -> Array:
    return rows.reshape(-1, steps, rows.shape[-1])


def _peaks(sizes: Array) -> NDArray[np.intp]:
    touching = np.flatnonzero(sizes >= (1.0 - LONGEST_TOL) * sizes.max(initial=0.0))
    groups = np.split(touching, np.flatnonzero(np.diff(touching) > 1) + 1)
    if len(groups) > 1 and groups[0][0] == 0 and groups[-1][-1] == len(sizes) - 1:
        groups = [np.concatenate([groups.pop(), groups[0]]), *groups[1:]]
    return np.array([group[np.argmax(sizes[group])] for group in groups if len(group)], dtype=np.intp)


def _balance(along: Array) -> Array:
    return np.vstack([along.T, np.ones(len(along))])


def _shares_of(along: Array) -> Array | None:
    system = _balance(along)
    right = np.zeros(len(system))
    right[-1] = 1.0
    shares, _, rank, _ = np.linalg.lstsq(system, right, rcond=SAME_WAY)
    near = np.abs(system @ shares - right).max() <= SAME_WAY and shares.min() >= -SAME_WAY
    return np.maximum(shares, 0.0) if near and rank == len(along) else None


def _swing(signal: Spectrum) -> float:
    alternating = signal.with_coefficients(np.concatenate([0.0 * signal.coefficients[:1], signal.coefficients[1:]]))
    return 2.0 * float(amplitudes(alternating).max(initial=0.0))


def _reach(steps: Array, bent: Array) -> float:
    return _diameter(np.concatenate([steps, bent])[None])


def _diameter(signals: Array) -> float:
    return float(2.0 * enclosing_balls(signals).radii.max(initial=0.0))
