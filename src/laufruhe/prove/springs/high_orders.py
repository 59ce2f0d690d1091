"""What mounts feel at most of an order above all natural frequencies, as a line in stiffness (E62).

With one loss factor eta and A not over a < W^2, the work of the springs is y* A y <= r* A r / (W^2 - a)^2, for it is
so in every mode. A spring's force is |1 + i eta| |K u| <= |1 + i eta| (t tr K + u* K u / t) / 2 for any t > 0, and
traces and r* A r are linear in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.prove.springs.open_mounts import STRETCH, OpenMounts


@dataclass(frozen=True, eq=False)
class AtMost:
    """A number is not over constant + slopes' s for any design of a box, nor over `most` for those that count."""

    constant: float
    slopes: Array
    most: float = math.inf

    @property
    def largest(self) -> float:
        """Over all s."""
        return min(self.constant + float(np.abs(self.slopes).sum()), self.most)

    @property
    def told(self) -> AtMost:
        """The line, or the number where that is less in the middle of the box."""
        return self if self.constant < self.most else AtMost(self.most, 0.0 * self.slopes, self.most)

    def times(self, factor: float) -> AtMost:
        """A multiple of it, not under zero."""
        return AtMost(factor * self.constant, factor * self.slopes, factor * self.most)


def felt_at_most(mounts: OpenMounts, load: ComplexArray, omega: float) -> AtMost | None:
    """The sum over all mounts of the problem of the amplitudes of their forces; None where this says nothing.

    Parameters
    ----------
    load
        r, shape (k,).
    omega
        Angular frequency [rad/s].
    """
    room, loss = omega**2 - mounts.highest, float(mounts.losses[0])
    plain = not mounts.dynamic and not np.any(mounts.dampers) and not np.any(mounts.lags)
    if room <= 0.0 or not plain or np.any(mounts.losses != loss):
        return None
    counts = (mounts.times**2)[mounts.stands]
    traces = _linear(mounts, counts[:, None, None] * np.eye(3))
    work = _linear(mounts, np.array([_seen(mounts, m, load) for m in range(len(mounts.motions))]))
    # best in the middle of the box
    t = float(np.sqrt(max(work.constant, 0.0) / traces.constant)) / room
    if t <= 0.0:
        return None
    factor = 0.5 * float(np.hypot(1.0, loss))
    parts = traces.times(factor * t), work.times(factor / t / room**2)
    return AtMost(parts[0].constant + parts[1].constant, parts[0].slopes + parts[1].slopes)


def _linear(mounts: OpenMounts, weights: Array) -> AtMost:
    """The sum of <W, K> over springs, W of shape (springs, 3, 3)."""
    slopes = np.zeros(mounts.numbers)
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            slopes[j] += float(np.sum(weights[spring.mount] * (spring.axes @ matrix @ spring.axes.T)))
    return AtMost(float(np.sum(weights * mounts.middles)), slopes)


def _seen(mounts: OpenMounts, number: int, load: ComplexArray) -> Array:
    """W with r* G' K G r <= <W, K> for a spring, wherever it stands."""
    moved = [h * place.arms.T @ (place.aside @ mounts.turns @ load) for place in mounts.places for m, h in place.mounts
             if m == number]  # fmt: skip
    seen = mounts.motions[number] @ load
    own = np.real(np.outer(seen, seen.conj()))
    if not moved:
        return np.asarray(own)
    far = sum(float(np.linalg.norm(each)) for each in moved) ** 2
    return np.asarray((1.0 + STRETCH) * own + (1.0 + 1.0 / STRETCH) * far * np.eye(3))
