"""Lower bound of a mean over operating points as a sum of roots, less odd multiples of their orders (E54, E58, E62).

Let a load r with angular frequency W cause the motion y of the block on springs with the stiffness matrix A and one
loss factor eta. With A <= a < W^2, the work of the springs is y* A y <= r* A r / (W^2 - a)^2, mode by mode. The force
of a spring with stiffness K and deflection u is |1 + i eta| |K u| <= |1 + i eta| (t tr K + u* K u / t) / 2 for any
t > 0; traces and r* A r are linear in the shared numbers s. A free mass has y0 = r / W^2 and deflections u0, so that
each entry of K u0 is linear in s and lies below a chord on a box. The change by springs has
(y - y0)* A (y - y0) <= (|1 + i eta| a / (W^2 - a))^2 r* A r / W^4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import ZERO_LEVEL, OpenMounts
from laufruhe.extensions.mount_relaxation.orders import COSINE, EpigraphVariable
from laufruhe.numerics.arrays import Array, ComplexArray


@dataclass(frozen=True, eq=False)
class LinearUpperBound:
    """Upper bound constant + slopes' s over a box with numbers s, and upper bound `upper` for better designs alone.

    Attributes
    ----------
    constant, slopes
        Coefficients of s, slopes of shape (numbers,).
    upper
        Upper bound over better designs.
    at_reference
        Linear bound at the design of the box nearest to the best.
    """

    constant: float
    slopes: Array
    upper: float = math.inf
    at_reference: float = 0.0

    def __add__(self, other: LinearUpperBound) -> LinearUpperBound:
        """Return an upper bound of the sum of two bounded numbers."""
        return LinearUpperBound(
            self.constant + other.constant,
            self.slopes + other.slopes,
            self.upper + other.upper,
            self.at_reference + other.at_reference,
        )

    @property
    def largest(self) -> float:
        """Upper bound over all s."""
        return min(self.constant + float(np.abs(self.slopes).sum()), self.upper)

    @property
    def tighter(self) -> LinearUpperBound:
        """The linear bound, or the constant bound `upper` if that is smaller at the best design."""
        return self if self.at_reference < self.upper else constant_bound(self.upper, self.slopes)

    def times(self, factor: float) -> LinearUpperBound:
        """Return the bound of the bounded number times `factor`, which is not negative."""
        upper = factor * self.upper if factor else 0.0
        return LinearUpperBound(factor * self.constant, factor * self.slopes, upper, factor * self.at_reference)


def constant_bound(upper: float, slopes: Array) -> LinearUpperBound:
    """Return the bound `upper` for all s, with zero slopes in the shape of `slopes`."""
    return LinearUpperBound(upper, np.zeros_like(slopes), upper, upper)


@dataclass(frozen=True, eq=False)
class HighOrder:
    """Forces of springs of one loss factor, in an order above all natural frequencies.

    Attributes
    ----------
    load
        Load r, shape (k,).
    omega
        Angular frequency [rad/s].
    reference
        Numbers s of a design at which the bounds are tight, shape (numbers,).
    """

    mounts: OpenMounts
    load: ComplexArray
    omega: float
    reference: Array

    @property
    def is_above(self) -> bool:
        """True if the order is above all natural frequencies, and damping is one loss factor alone."""
        mounts = self.mounts
        has_other_damping = mounts.dynamic or np.any(mounts.dampers) or np.any(mounts.lags)
        return self._distance > 0.0 and not has_other_damping and not np.any(mounts.losses != mounts.losses[0])

    @property
    def _distance(self) -> float:
        return self.omega**2 - self.mounts.highest

    @property
    def _turning(self) -> float:
        return float(np.hypot(1.0, self.mounts.losses[0]))

    @property
    def bound(self) -> LinearUpperBound | None:
        """Upper bound of the sum of force amplitudes over all mounts of the problem [N]; None without one."""
        counts = (self.mounts.symmetry_factors**2)[self.mounts.spring_mounts]
        traces = linear_sum(self.mounts, counts[:, None, None] * np.eye(3), self.reference)
        weights = np.array([work_weight(self.mounts, m, self.load) for m in range(len(self.mounts.motions))])
        work = linear_sum(self.mounts, weights, self.reference)
        # the root of traces times work is at most their weighted mean
        sizes = [max(bound.at_reference, 1e-9 * bound.largest) for bound in (traces, work)]
        if min(sizes) <= 0.0:
            return None
        ratio = math.sqrt(sizes[1] / sizes[0])
        by_work = traces.times(0.5 * ratio) + work.times(0.5 / ratio)
        spring_change = by_work.times(self._turning**2 * self.mounts.highest / self._distance / self.omega**2)
        zero = LinearUpperBound(0.0, np.zeros(self.mounts.numbers), 0.0)
        free_mass = sum((chord.bound(self.reference) for chord in self.chords), zero)
        return min(
            by_work.times(self._turning / self._distance),
            free_mass + spring_change,
            key=lambda bound: bound.at_reference,
        )

    @cached_property
    def chords(self) -> list[Chord]:
        """Components of the spring forces from the motion of a free mass, along its deflections and across."""
        load = self.load * np.exp(-0.5j * float(np.angle(np.sum(self.load * self.load))))
        chords = []
        for m in range(len(self.mounts.motions)):
            deflections = [self.mounts.motions[m] @ load, *_place_deflections(self.mounts, m, load)]
            factor = float(self.mounts.symmetry_factors[self.mounts.spring_mounts[m]]) * self._turning / self.omega**2
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
                    chords += [
                        Chord(factor * float(constant), factor * slope)
                        for constant, slope in zip(middle, slopes.T, strict=True)
                    ]
        return chords

    def looseness(self, s: Array) -> Array:
        """Return the excess of the chords over the components at the numbers s, shared among s, shape (numbers,)."""
        return sum((chord.looseness(s) for chord in self.chords), np.zeros(self.mounts.numbers))


@dataclass(frozen=True, eq=False)
class Chord:
    """Absolute value |constant + slopes' s| over a box, bounded above by the chord between its values at the bounds."""

    constant: float
    slopes: Array

    def bound(self, reference: Array) -> LinearUpperBound:
        """Return the linear upper bound of the force component.

        `reference` are the numbers s of a design, (numbers,).
        """
        reach = float(np.abs(self.slopes).sum())
        low, high = self.constant - reach, self.constant + reach
        factor = (abs(high) - abs(low)) / (high - low) if high > low else 0.0
        constant, slopes = abs(low) + factor * (self.constant - low), factor * self.slopes
        return LinearUpperBound(constant, slopes, math.inf, constant + float(slopes @ reference))

    def looseness(self, s: Array) -> Array:
        """Return the excess of the chord at the numbers s, shared in proportion to the slopes, shape (numbers,)."""
        reach = np.abs(self.slopes)
        excess = self.bound(s).at_reference - abs(self.constant + float(self.slopes @ s))
        return np.asarray(max(excess, 0.0) * reach / max(float(reach.sum()), 1e-300))


def _place_deflections(mounts: OpenMounts, m: int, load: ComplexArray) -> list[ComplexArray]:
    return [
        reach * place.arms.T @ (place.turn_axes @ mounts.turns @ load)
        for place in mounts.places for mount, reach in place.mounts if mount == m
    ]  # fmt: skip


def linear_sum(mounts: OpenMounts, weights: Array, reference: Array) -> LinearUpperBound:
    """Return the sum of <W, K> over springs of stiffness K as a bound affine in s; W is `weights`, (springs, 3, 3)."""
    slopes = np.zeros(mounts.numbers)
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            slopes[j] += float(np.sum(weights[spring.mount] * (spring.axes @ matrix @ spring.axes.T)))
    constant = float(np.sum(weights * mounts.middles))
    return LinearUpperBound(constant, slopes, math.inf, constant + float(slopes @ reference))


def work_weight(mounts: OpenMounts, number: int, load: ComplexArray) -> Array:
    """Return the matrix W, shape (3, 3), with r* G' K G r <= <W, K> for the load r and any open place of a spring.

    K is the stiffness of the spring and G its map from motion to deflection; `number` is the index of the spring.
    """
    place_deflections = _place_deflections(mounts, number, load)
    deflection = mounts.motions[number] @ load
    weight = np.real(np.outer(deflection, deflection.conj()))
    if not place_deflections:
        return np.asarray(weight)
    place_part = sum(float(np.linalg.norm(part)) for part in place_deflections)
    scale = float(np.linalg.norm(mounts.motions[number])) * float(np.linalg.norm(load))
    stretch = max(place_part, ZERO_LEVEL * scale) / max(float(np.linalg.norm(deflection)), 1e-300)
    return np.asarray((1.0 + stretch) * weight + (1.0 + 1.0 / stretch) * place_part**2 * np.eye(3))


@dataclass(frozen=True, eq=False)
class MeanBound:
    """Two lower bounds of a mean over operating points: prices' roots + slopes' s + constant, and `floor`.

    Attributes
    ----------
    prices
        Coefficients of the roots in their units.
    slopes, constant
        Coefficients of s, shape (numbers,), and constant.
    floor
        Bound by the lower bounds of the roots alone.
    lower, upper
        Bounds of the roots in their units.
    """

    prices: Array
    slopes: Array
    constant: float
    floor: float
    lower: Array
    upper: Array


def mean_bound(
    variables: Sequence[EpigraphVariable], multiples: Sequence[Sequence[LinearUpperBound]], lower: Array, norm: float,
    numbers: int,
) -> MeanBound:  # fmt: skip
    """Return a lower bound of a mean of mount forces over the designs in which this mean is at most `norm`.

    Parameters
    ----------
    variables
        Epigraph variables of the mean.
    multiples
        Upper bounds of the odd multiples of each variable.
    lower
        Lower bounds of the roots, shape (variables,).
    norm
        Upper bound of the mean.
    numbers
        Count of shared numbers s.
    """
    shares, units = (np.array([getattr(variable, name) for variable in variables]) for name in ("share", "unit"))
    options = []
    for variable, bounds in zip(variables, multiples, strict=True):
        # options (ratio, loss, largest loss): the norm is at least ratio * root - loss
        choices = [(1.0, constant_bound(variable.loss, np.zeros(numbers)), variable.loss)]
        if bounds:
            weights = variable.multiple_weights
            parts = [bound.tighter.times(weight) for bound, weight in zip(bounds, weights, strict=True)]
            maximum = sum(weight * bound.largest for bound, weight in zip(bounds, weights, strict=True))
            total = sum(parts, LinearUpperBound(0.0, np.zeros(numbers), 0.0))
            choices = [(COSINE / variable.factor, constant_bound(0.0, np.zeros(numbers)), 0.0), (1.0, total, maximum)]
        options.append(choices)
    norms = np.array([
        max([0.0, *(ratio * root - largest_loss for ratio, _, largest_loss in choices)])
        for choices, root in zip(options, lower, strict=True)
    ])  # fmt: skip
    floor = float(shares @ norms)
    norm_limits = (norm - floor) / shares + norms
    upper = np.array(
        [
            min((norm_limit + maximum) / ratio for ratio, _, maximum in choices)
            for choices, norm_limit in zip(options, norm_limits, strict=True)
        ]
    )
    # the option with the largest bound at the best design
    chosen = [
        max(choices, key=lambda option: option[0] * unit - option[1].at_reference)
        for choices, unit in zip(options, units, strict=True)
    ]
    ratios = np.array([ratio for ratio, _, _ in chosen])
    slopes = -sum((share * loss.slopes for share, (_, loss, _) in zip(shares, chosen, strict=True)), np.zeros(numbers))
    constant = -float(sum(share * loss.constant for share, (_, loss, _) in zip(shares, chosen, strict=True)))
    return MeanBound(shares * units * ratios, slopes, constant, floor, lower / units, np.maximum(upper, lower) / units)
