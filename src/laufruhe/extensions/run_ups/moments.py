"""Moments of the loads of a run over long steps, valid for any mounting (E65).

Under z' = A z + B p(t), with the state z and the wrench p, a step of length H ends at e^{A H} z + sum_k A^k B m_k. The
moment m_k is the integral of (H - s)^k / k! p(s) over the step. The wrench p is given by the polynomials of the exact
model for its short steps (E28a). With enough moments, long steps end exactly where the short ones do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.run_ups.linear_run import NODES, Sweep, largest_share, step_moments
from laufruhe.numerics.arrays import Array

MOMENTS = 14
"""Count of moments of a long step."""


@dataclass(frozen=True, eq=False)
class LongSteps:
    """Loads of a run in long time steps, each of several short steps.

    Attributes
    ----------
    moments
        Moments of the wrench about the origin, shape (moments, 6, steps).
    impulses, peak_loads
        Bounds of the integral and of the maximum of the load's length in a step, shape (steps,).
    """

    moments: Array
    impulses: Array
    peak_loads: Array


class RunMoments:
    """Moments of the loads of one run in long time steps, each of several short steps.

    Parameters
    ----------
    wrenches
        Wrenches as `Sweep.wrenches` returns them.
    load
        Matrix from a wrench to the driven coordinates, shape (n, 6).
    times
        Count of short steps in a long one.
    """

    def __init__(self, sweep: Sweep, wrenches: Array, load: Array, times: int) -> None:
        self.sweep, self.times = sweep, times
        self._wrenches = wrenches.reshape(NODES, 6, -1)
        lengths_of_loads = np.linalg.norm(np.einsum("ni,ais->ans", load, self._wrenches), axis=1).max(axis=0)
        self._highest = largest_share() * lengths_of_loads
        self._known: dict[int, LongSteps] = {}

    @property
    def step(self) -> float:
        """Length of a long step [s]."""
        return self.times * self.sweep.step

    def ending_at(self, short_step: int) -> LongSteps:
        """Return long time steps of the run, placed so that one of them ends at the short step with this index.

        There is no load before the start of the run.
        """
        first = short_step % self.times
        if first not in self._known:
            self._known[first] = self._long_steps(first)
        return self._known[first]

    def short(self, indices: Array) -> Array:
        """Return time moments of the wrenches in short time steps, shape (..., moments, 6).

        They are zero for `indices` outside the run.
        """
        inside = (indices >= 0) & (indices < self.sweep.count)
        wrenches = self._wrenches[..., np.where(inside, indices, 0)] * inside
        shares = step_moments(MOMENTS) * self.sweep.step ** np.arange(1, MOMENTS + 1)[:, None]
        return np.asarray(np.moveaxis(np.tensordot(shares, wrenches, axes=1), (0, 1), (-2, -1)))

    def _long_steps(self, first: int) -> LongSteps:
        padding = (self.times - first) % self.times
        count = (padding + self.sweep.count) // self.times

        def cut(rows: Array) -> Array:
            padded = np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(padding, 0)])[..., : count * self.times]
            return np.asarray(padded.reshape(*rows.shape[:-1], count, self.times))

        moments = np.einsum("kat,aint->kin", self._weights, cut(self._wrenches), optimize=True)
        highest = cut(self._highest)
        return LongSteps(moments, self.sweep.step * highest.sum(axis=1), highest.max(axis=1))

    @property
    def _weights(self) -> Array:
        h, weights = self.sweep.step, []
        shares = step_moments(MOMENTS)
        for later in range(self.times - 1, -1, -1):
            # (l h + u)^k / k! = sum of (l h)^i / i! u^(k - i) / (k - i)!
            powers = [(later * h) ** i / math.factorial(i) for i in range(MOMENTS)]
            row = [sum(powers[i] * h ** (k - i + 1) * shares[k - i] for i in range(k + 1)) for k in range(MOMENTS)]
            weights.append(np.array(row))
        return np.stack(weights, axis=-1)
