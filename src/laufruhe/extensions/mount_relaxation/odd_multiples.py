"""A mean over operating points as a sum of roots, odd multiples of their orders taken off (E54, E58, E62).

With one loss factor eta and A <= a < W^2, the work of the springs is y* A y <= r* A r / (W^2 - a)^2, mode by mode. A
spring's force is |1 + i eta| |K u| <= |1 + i eta| (t tr K + u* K u / t) / 2 for any t > 0, and traces and r* A r are
linear in s. Of a mass that is free, y0 = r / W^2, every entry of K u0 is linear in s and lies under a chord on a box;
what springs change has (y - y0)* A (y - y0) <= (|1 + i eta| a / (W^2 - a))^2 r* A r / W^4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import ALIKE, OpenMounts
from laufruhe.extensions.mount_relaxation.orders import COSINE, EpigraphVariable
from laufruhe.extensions.mount_relaxation.program import ObjectiveLimit
from laufruhe.numerics.arrays import Array, ComplexArray


@dataclass(frozen=True, eq=False)
class LinearUpperBound:
    """A number is at most constant + slopes' s for all designs of a box, and at most `upper` for those that count.

    Attributes
    ----------
    near
        Of the linear bound at the best design, or at one next to it in the box.
    """

    constant: float
    slopes: Array
    upper: float = math.inf
    near: float = 0.0

    def __add__(self, other: LinearUpperBound) -> LinearUpperBound:
        """Return the bound of the sum of both numbers."""
        return LinearUpperBound(
            self.constant + other.constant, self.slopes + other.slopes, self.upper + other.upper, self.near + other.near
        )

    @property
    def largest(self) -> float:
        """Return the bound over all s."""
        return min(self.constant + float(np.abs(self.slopes).sum()), self.upper)

    @property
    def better(self) -> LinearUpperBound:
        """Return the linear bound, or the constant one if that is less at the best design."""
        return self if self.near < self.upper else constant_bound(self.upper, self.slopes)

    def times(self, factor: float) -> LinearUpperBound:
        """Return the bound of a multiple with a factor of at least zero."""
        upper = factor * self.upper if factor else 0.0
        return LinearUpperBound(factor * self.constant, factor * self.slopes, upper, factor * self.near)


def constant_bound(upper: float, slopes: Array) -> LinearUpperBound:
    """Return a bound without slopes."""
    return LinearUpperBound(upper, np.zeros_like(slopes), upper, upper)


@dataclass(frozen=True, eq=False)
class HighOrder:
    """Forces of springs of one loss factor in an order above all natural frequencies.

    Attributes
    ----------
    load
        r, shape (k,).
    near
        s of a design at which the bounds should be close.
    """

    mounts: OpenMounts
    load: ComplexArray
    omega: float
    near: Array

    @property
    def is_above(self) -> bool:
        """Return whether the order is above all natural frequencies, and springs have one loss factor and no more."""
        mounts = self.mounts
        more = mounts.dynamic or np.any(mounts.dampers) or np.any(mounts.lags)
        return self._distance > 0.0 and not more and not np.any(mounts.losses != mounts.losses[0])

    @property
    def _distance(self) -> float:
        return self.omega**2 - self.mounts.highest

    @property
    def _turning(self) -> float:
        return float(np.hypot(1.0, self.mounts.losses[0]))

    @property
    def bound(self) -> LinearUpperBound | None:
        """Return the bound of the sum of force amplitudes over all mounts of the problem; None where there is none."""
        counts = (self.mounts.times**2)[self.mounts.stands]
        traces = linear_sum(self.mounts, counts[:, None, None] * np.eye(3), self.near)
        weights = np.array([work_weight(self.mounts, m, self.load) for m in range(len(self.mounts.motions))])
        work = linear_sum(self.mounts, weights, self.near)
        # the root of the product of traces and work, under their weighted mean
        sizes = [max(each.near, 1e-9 * each.largest) for each in (traces, work)]
        if min(sizes) <= 0.0:
            return None
        t = math.sqrt(sizes[1] / sizes[0])
        by_work = traces.times(0.5 * t) + work.times(0.5 / t)
        changed = by_work.times(self._turning**2 * self.mounts.highest / self._distance / self.omega**2)
        none = LinearUpperBound(0.0, np.zeros(self.mounts.numbers), 0.0)
        free = sum((chord.bound(self.near) for chord in self.chords), none)
        return min(by_work.times(self._turning / self._distance), free + changed, key=lambda each: each.near)

    @cached_property
    def chords(self) -> list[Chord]:
        """Return parts of the springs' forces on a mass that is free, along motion and across it."""
        load = self.load * np.exp(-0.5j * float(np.angle(np.sum(self.load * self.load))))
        chords = []
        for m in range(len(self.mounts.motions)):
            deflections = [self.mounts.motions[m] @ load, *_place_deflections(self.mounts, m, load)]
            factor = float(self.mounts.times[self.mounts.stands[m]]) * self._turning / self.omega**2
            for deflection in deflections:
                for part in (deflection.real, deflection.imag):
                    if not np.any(part):
                        continue
                    # K u along u and across it
                    axes = np.linalg.svd(part[None])[2]
                    middle, slopes = axes @ self.mounts.middles[m] @ part, np.zeros((self.mounts.numbers, 3))
                    for spring in self.mounts.springs:
                        if spring.mount == m:
                            for j, matrix in spring.terms:
                                slopes[j] += axes @ spring.axes @ matrix @ spring.axes.T @ part
                    chords += [Chord(factor * float(c), factor * s) for c, s in zip(middle, slopes.T, strict=True)]
        return chords

    def looseness(self, s: Array) -> Array:
        """Return the excess of the chords over the numbers that they bound, by s."""
        return sum((chord.looseness(s) for chord in self.chords), np.zeros(self.mounts.numbers))


@dataclass(frozen=True, eq=False)
class Chord:
    """|constant + slopes' s| over a box, under the chord between its ends."""

    constant: float
    slopes: Array

    def bound(self, near: Array) -> LinearUpperBound:
        """Return the chord."""
        reach = float(np.abs(self.slopes).sum())
        low, high = self.constant - reach, self.constant + reach
        factor = (abs(high) - abs(low)) / (high - low) if high > low else 0.0
        constant, slopes = abs(low) + factor * (self.constant - low), factor * self.slopes
        return LinearUpperBound(constant, slopes, math.inf, constant + float(slopes @ near))

    def looseness(self, s: Array) -> Array:
        """Return the excess over the number at s, shared by the change that every s makes."""
        reach = np.abs(self.slopes)
        violation = self.bound(s).near - abs(self.constant + float(self.slopes @ s))
        return np.asarray(max(violation, 0.0) * reach / max(float(reach.sum()), 1e-300))


def _place_deflections(mounts: OpenMounts, m: int, load: ComplexArray) -> list[ComplexArray]:
    return [
        h * place.arms.T @ (place.aside @ mounts.turns @ load)
        for place in mounts.places for k, h in place.mounts if k == m
    ]  # fmt: skip


def linear_sum(mounts: OpenMounts, weights: Array, near: Array) -> LinearUpperBound:
    """Return the sum of <W, K> over springs, W of shape (springs, 3, 3)."""
    slopes = np.zeros(mounts.numbers)
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            slopes[j] += float(np.sum(weights[spring.mount] * (spring.axes @ matrix @ spring.axes.T)))
    constant = float(np.sum(weights * mounts.middles))
    return LinearUpperBound(constant, slopes, math.inf, constant + float(slopes @ near))


def work_weight(mounts: OpenMounts, number: int, load: ComplexArray) -> Array:
    """Return W with r* G' K G r <= <W, K> for a spring, wherever it stands."""
    moved = _place_deflections(mounts, number, load)
    deflection = mounts.motions[number] @ load
    weight = np.real(np.outer(deflection, deflection.conj()))
    if not moved:
        return np.asarray(weight)
    far = sum(float(np.linalg.norm(each)) for each in moved)
    size = float(np.linalg.norm(mounts.motions[number])) * float(np.linalg.norm(load))
    stretch = max(far, ALIKE * size) / max(float(np.linalg.norm(deflection)), 1e-300)
    return np.asarray((1.0 + stretch) * weight + (1.0 + 1.0 / stretch) * far**2 * np.eye(3))


@dataclass(frozen=True, eq=False)
class MeanBound:
    """The mean is at least prices' roots + slopes' s + constant, and at least `floor`.

    Attributes
    ----------
    prices
        Of the roots, in their units.
    lower, upper
        Bounds of the roots, in their units.
    """

    prices: Array
    slopes: Array
    constant: float
    floor: float
    lower: Array
    upper: Array

    def limit(self, size: float, norm: float) -> ObjectiveLimit:
        """Return the limit of designs with a mean that is not over a number, in a unit."""
        return ObjectiveLimit(self.slopes / size, (norm - self.constant) / size)


def mean_bound(
    variables: Sequence[EpigraphVariable], multiples: Sequence[Sequence[LinearUpperBound]], lower: Array, norm: float,
    numbers: int,
) -> MeanBound:  # fmt: skip
    """Return the bound of a mean over the designs in which it is not over `norm`.

    Parameters
    ----------
    multiples
        Bounds of the odd multiples of every variable.
    lower
        Bounds of the roots.
    numbers
        Count of s.
    """
    shares, units = (np.array([getattr(variable, name) for variable in variables]) for name in ("share", "unit"))
    options = []
    for variable, bounds in zip(variables, multiples, strict=True):
        # a norm is at least ratio root - what is taken off: by the plain order, and by its cosine
        own = [(1.0, constant_bound(variable.loss, np.zeros(numbers)), variable.loss)]
        if bounds:
            weights = variable.multiple_weights
            parts = [bound.better.times(weight) for bound, weight in zip(bounds, weights, strict=True)]
            maximum = sum(weight * bound.largest for bound, weight in zip(bounds, weights, strict=True))
            total = sum(parts, LinearUpperBound(0.0, np.zeros(numbers), 0.0))
            own = [(COSINE / variable.factor, constant_bound(0.0, np.zeros(numbers)), 0.0), (1.0, total, maximum)]
        options.append(own)
    norms = np.array([
        max([0.0, *(ratio * root - limit for ratio, _, limit in own)]) for own, root in zip(options, lower, strict=True)
    ])  # fmt: skip
    floor = float(shares @ norms)
    rest = (norm - floor) / shares + norms
    upper = np.array(
        [min((r + maximum) / ratio for ratio, _, maximum in own) for own, r in zip(options, rest, strict=True)]
    )
    # the option that shows most of the best design
    best = [
        max(own, key=lambda option: option[0] * unit - option[1].near) for own, unit in zip(options, units, strict=True)
    ]
    ratios = np.array([ratio for ratio, _, _ in best])
    slopes = -sum((share * taken.slopes for share, (_, taken, _) in zip(shares, best, strict=True)), np.zeros(numbers))
    constant = -float(sum(share * taken.constant for share, (_, taken, _) in zip(shares, best, strict=True)))
    return MeanBound(shares * units * ratios, slopes, constant, floor, lower / units, np.maximum(upper, lower) / units)
