"""What mounts feel at most of an order above all natural frequencies, as a line in stiffness (E62).

With one loss factor eta and A not over a < W^2, the work of the springs is y* A y <= r* A r / (W^2 - a)^2, for it is
so in every mode. A spring's force is |1 + i eta| |K u| <= |1 + i eta| (t tr K + u* K u / t) / 2 for any t > 0, and
traces and r* A r are linear in s. Of a mass that is free, y0 = r / W^2, every entry of K u0 is linear in s and lies
under a chord on a box; what springs change has (y - y0)* A (y - y0) <= (|1 + i eta| a / (W^2 - a))^2 r* A r / W^4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import ALIKE, OpenMounts
from laufruhe.numerics.arrays import Array, ComplexArray


@dataclass(frozen=True, eq=False)
class AtMost:
    """A number is not over constant + slopes' s for any design of a box, nor over `most` for those that count.

    Attributes
    ----------
    near
        What the first is for the best design, or for one next to it in the box.
    """

    constant: float
    slopes: Array
    most: float = math.inf
    near: float = 0.0

    def __add__(self, other: AtMost) -> AtMost:
        """Of the sum of both numbers."""
        return AtMost(
            self.constant + other.constant, self.slopes + other.slopes, self.most + other.most, self.near + other.near
        )

    @property
    def largest(self) -> float:
        """Over all s."""
        return min(self.constant + float(np.abs(self.slopes).sum()), self.most)

    @property
    def told(self) -> AtMost:
        """The line, or the number where that is less for the best design."""
        return self if self.near < self.most else constant(self.most, self.slopes)

    def times(self, factor: float) -> AtMost:
        """A multiple of it, not under zero."""
        most = factor * self.most if factor else 0.0
        return AtMost(factor * self.constant, factor * self.slopes, most, factor * self.near)


def constant(most: float, slopes: Array) -> AtMost:
    """No line, but a number."""
    return AtMost(most, np.zeros_like(slopes), most, most)


@dataclass(frozen=True, eq=False)
class HighOrder:
    """What springs of one loss factor do in an order above all natural frequencies.

    Attributes
    ----------
    load
        r, shape (k,).
    near
        s of a design at which little should be lost.
    """

    mounts: OpenMounts
    load: ComplexArray
    omega: float
    near: Array

    @property
    def room(self) -> float:
        """W^2 less all squares of natural frequencies."""
        return self.omega**2 - self.mounts.highest

    @property
    def turning(self) -> float:
        """|1 + i eta|."""
        return float(np.hypot(1.0, self.mounts.losses[0]))

    @property
    def is_plain(self) -> bool:
        """Whether springs have one loss factor and nothing else, and the order is above all natural frequencies."""
        mounts = self.mounts
        more = mounts.dynamic or np.any(mounts.dampers) or np.any(mounts.lags)
        return self.room > 0.0 and not more and not np.any(mounts.losses != mounts.losses[0])

    @property
    def traces(self) -> AtMost:
        """The sum of tr K."""
        counts = (self.mounts.times**2)[self.mounts.stands]
        return _linear(self.mounts, counts[:, None, None] * np.eye(3), self.near)

    @property
    def work(self) -> AtMost:
        """r* A r."""
        return _linear(self.mounts, np.array([_seen(self.mounts, m, self.load) for m in range(self._count)]), self.near)

    @property
    def _count(self) -> int:
        return len(self.mounts.motions)

    @property
    def by_work(self) -> AtMost | None:
        """What springs would feel of a mass that is free is not over this, by tr K and r* A r."""
        return mean_of_both(self.traces, self.work)

    @property
    def changed(self) -> AtMost | None:
        """How much more they feel because they hold it."""
        found = self.by_work
        return None if found is None else found.times(self.turning**2 * self.mounts.highest / self.room / self.omega**2)

    @property
    def felt(self) -> AtMost | None:
        """The sum over all mounts of the problem of the amplitudes of their forces; None where this says nothing."""
        by_work, changed = self.by_work, self.changed
        if by_work is None or changed is None:
            return None
        alone = sum((chord.line(self.near) for chord in self.chords), AtMost(0.0, np.zeros(self.mounts.numbers), 0.0))
        return min(by_work.times(self.turning / self.room), alone + changed, key=lambda each: each.near)

    @property
    def chords(self) -> list[Chord]:
        """Parts of the springs' forces on a mass that is free, along motion and across it."""
        turned = self.load * np.exp(-0.5j * float(np.angle(np.sum(self.load * self.load))))
        found = []
        for m in range(self._count):
            seen = [self.mounts.motions[m] @ turned]
            seen += [h * place.arms.T @ (place.aside @ self.mounts.turns @ turned) for place in self.mounts.places
                     for k, h in place.mounts if k == m]  # fmt: skip
            factor = float(self.mounts.times[self.mounts.stands[m]]) * self.turning / self.omega**2
            found += [
                Chord(factor * given, factor * slopes)
                for each in seen for part in (each.real, each.imag) if np.any(part)
                for given, slopes in _pressed(self.mounts, m, part)
            ]  # fmt: skip
        return found

    def hidden(self, s: Array) -> Array:
        """By number, what chords are over what they cover."""
        return sum((chord.over(s) for chord in self.chords), np.zeros(self.mounts.numbers))


@dataclass(frozen=True, eq=False)
class Chord:
    """|constant + slopes' s| over a box, under the chord between its ends."""

    constant: float
    slopes: Array

    @property
    def _ends(self) -> tuple[float, float]:
        reach = float(np.abs(self.slopes).sum())
        return self.constant - reach, self.constant + reach

    def line(self, near: Array) -> AtMost:
        """The chord."""
        low, high = self._ends
        factor = (abs(high) - abs(low)) / (high - low) if high > low else 0.0
        given, slopes = abs(low) + factor * (self.constant - low), factor * self.slopes
        return AtMost(given, slopes, math.inf, given + float(slopes @ near))

    def over(self, s: Array) -> Array:
        """What it is over the number at s, shared by what every s changes."""
        line, reach = self.line(s), np.abs(self.slopes)
        apart = line.near - abs(self.constant + float(self.slopes @ s))
        return np.asarray(max(apart, 0.0) * reach / max(float(reach.sum()), 1e-300))


def mean_of_both(first: AtMost, second: AtMost) -> AtMost | None:
    """The root of the product of two numbers is not over this, which it is at the best design."""
    sizes = [max(each.near, 1e-9 * each.largest) for each in (first, second)]
    if min(sizes) <= 0.0:
        return None
    t = math.sqrt(sizes[1] / sizes[0])
    return first.times(0.5 * t) + second.times(0.5 / t)


def _pressed(mounts: OpenMounts, number: int, seen: Array) -> list[tuple[float, Array]]:
    """Parts of K a along a and across it, each linear in s."""
    axes = np.linalg.svd(seen[None])[2]
    middle, slopes = axes @ mounts.middles[number] @ seen, np.zeros((mounts.numbers, 3))
    for spring in mounts.springs:
        if spring.mount == number:
            for j, matrix in spring.terms:
                slopes[j] += axes @ spring.axes @ matrix @ spring.axes.T @ seen
    return [(float(value), slope) for value, slope in zip(middle, slopes.T, strict=True)]


def _linear(mounts: OpenMounts, weights: Array, near: Array) -> AtMost:
    """The sum of <W, K> over springs, W of shape (springs, 3, 3)."""
    slopes = np.zeros(mounts.numbers)
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            slopes[j] += float(np.sum(weights[spring.mount] * (spring.axes @ matrix @ spring.axes.T)))
    given = float(np.sum(weights * mounts.middles))
    return AtMost(given, slopes, math.inf, given + float(slopes @ near))


def _seen(mounts: OpenMounts, number: int, load: ComplexArray) -> Array:
    """W with r* G' K G r <= <W, K> for a spring, wherever it stands."""
    moved = [h * place.arms.T @ (place.aside @ mounts.turns @ load) for place in mounts.places for m, h in place.mounts
             if m == number]  # fmt: skip
    seen = mounts.motions[number] @ load
    own = np.real(np.outer(seen, seen.conj()))
    if not moved:
        return np.asarray(own)
    far = sum(float(np.linalg.norm(each)) for each in moved)
    stretch = max(far, ALIKE * float(np.linalg.norm(mounts.motions[number])) * float(np.linalg.norm(load))) / max(
        float(np.linalg.norm(seen)), 1e-300
    )
    return np.asarray((1.0 + stretch) * own + (1.0 + 1.0 / stretch) * far**2 * np.eye(3))
