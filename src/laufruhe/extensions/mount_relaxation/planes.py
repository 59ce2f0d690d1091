"""Stiffness of a mount that turns in a plane, as three numbers of a matrix in axes that do not turn (E63).

With k1 and k2 its own stiffnesses, b the angle of its first axis from the first of these, p = (k1 + k2) / 2 and
d = (k1 - k2) / 2,

    K11 = p + d cos 2b,    K22 = p - d cos 2b,    K12 = d sin 2b.                            (E63)

All three are linear in what springs do, so that boxes of them are divided, in place of stiffnesses and angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array

# of the largest stiffness, what roundings may take
ROUNDING = 1e-9
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Plane:
    """What a mount may have in its plane.

    Attributes
    ----------
    low, high
        Of k1 and k2 [N/m].
    angles
        Least and largest b [rad].
    near
        k1 and k2 of the design whose own axes these are [N/m].
    """

    low: Array
    high: Array
    angles: tuple[float, float]
    near: Array

    @property
    def whole(self) -> Array:
        """Least and largest K11, K22 and K12, shape (3, 2)."""
        (low1, low2), (high1, high2) = self.low, self.high
        shares = _ends_of_square_cosine(*self.angles)
        first = [(low1 * c + low2 * (1.0 - c), high1 * c + high2 * (1.0 - c)) for c in shares]
        second = [(low2 * c + low1 * (1.0 - c), high2 * c + high1 * (1.0 - c)) for c in shares]
        sines = _ends_of_sine(2.0 * self.angles[0], 2.0 * self.angles[1])
        across = [d * s for d in (0.5 * (low1 - high2), 0.5 * (high1 - low2)) for s in sines]
        ends = [(min(a for a, _ in own), max(b for _, b in own)) for own in (first, second)]
        return np.array([*ends, (min(across), max(across))])

    def own(self, box: Array) -> tuple[float, float]:
        """What neither k1 nor k2 is under, and over, of a box."""
        (low1, low2), (high1, high2) = self.low, self.high
        side = self._side(box)
        if side > 0.0:
            return low2, high1
        if side < 0.0:
            return low1, high2
        return min(low1, low2), max(high1, high2)

    def _turned(self, box: Array) -> tuple[tuple[float, float], tuple[float, float], float]:
        """d cos and d sin of twice the angle from its middle, and the tangent that these are not apart by; or more."""
        half, middle = self.angles[1] - self.angles[0], self.angles[0] + self.angles[1]
        along = 0.5 * (box[0] - box[1][::-1])
        cosine, sine = math.cos(middle), math.sin(middle)
        near = np.sort(np.outer([cosine, 0.0], along)[0]) + np.sort(sine * box[2])
        aside = np.sort(-sine * along) + np.sort(cosine * box[2])
        steep = math.tan(half) if half < 0.5 * math.pi - 1e-6 else math.inf
        return (float(near[0]), float(near[1])), (float(aside[0]), float(aside[1])), steep

    def _side(self, box: Array) -> float:
        """The sign of k1 - k2 all over a box; zero where that is not known."""
        near, _, steep = self._turned(box)
        if steep == math.inf:
            return 0.0
        return 1.0 if near[0] > 0.0 else -1.0 if near[1] < 0.0 else 0.0

    def kept(self, box: Array) -> Array | None:
        """The part of a box that holds all that is possible in it; None where nothing is."""
        found, room = box.copy(), ROUNDING * float(self.high.max())
        for _ in range(ROUNDS):
            near, aside, steep = self._turned(found)
            least = max(aside[0], -aside[1], 0.0)
            if least - room > steep * max(-near[0], near[1], 0.0):
                return None
            low, high = self.own(found)
            found = _of_trace(found, float(self.low.sum()) - room, float(self.high.sum()) + room)
            found = _of_roots(found, low - room, high + room)
            if np.any(found[:, 0] > found[:, 1] + room):
                return None
            found = np.sort(found, axis=1)
        return found


def _of_trace(box: Array, low: float, high: float) -> Array:
    found = box.copy()
    for own, other in ((0, 1), (1, 0)):
        found[own] = max(box[own, 0], low - box[other, 1]), min(box[own, 1], high - box[other, 0])
    return found


def _of_roots(box: Array, low: float, high: float) -> Array:
    """With K - low and high - K nowhere indefinite."""
    found = box.copy()
    across = max(box[2, 0], -box[2, 1], 0.0)
    over, under = box[:2, 1] - low, high - box[:2, 0]
    if min(over.min(), under.min()) < 0.0:
        found[0] = 1.0, -1.0
        return np.asarray(found * high)
    for own, other in ((0, 1), (1, 0)):
        least = low + (across**2 / over[other] if over[other] > 0.0 else 0.0)
        most = high - (across**2 / under[other] if under[other] > 0.0 else 0.0)
        found[own] = max(box[own, 0], least), min(box[own, 1], most)
    reach = math.sqrt(min(over[0] * over[1], under[0] * under[1]))
    found[2] = max(box[2, 0], -reach), min(box[2, 1], reach)
    return found


def _ends_of_square_cosine(low: float, high: float) -> tuple[float, float]:
    ends = _ends_of_sine(2.0 * low + 0.5 * math.pi, 2.0 * high + 0.5 * math.pi)
    return 0.5 * (1.0 + ends[0]), 0.5 * (1.0 + ends[1])


def _ends_of_sine(low: float, high: float) -> tuple[float, float]:
    """Over a range of angles."""
    turn, ends = 2.0 * math.pi, (math.sin(low), math.sin(high))
    top = math.ceil((low - 0.5 * math.pi) / turn) * turn + 0.5 * math.pi <= high
    bottom = math.ceil((low + 0.5 * math.pi) / turn) * turn - 0.5 * math.pi <= high
    return (-1.0 if bottom else min(ends), 1.0 if top else max(ends))
