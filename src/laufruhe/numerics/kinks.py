"""Kinks of a periodic signal: angles at which its derivatives jump, in closed form (L5a).

A finite sum of orders rounds a kink off. The function of period P whose m-th derivative jumps by one at zero, and that
has no other jump, is a polynomial between its jumps,

    f_m(phi) = -P^m B_(m+1)(phi / P) / (m + 1)!,    c_j = (2 / P) / (i j b)^(m+1),    b = 2 pi / P,

with B the Bernoulli polynomials. A signal less these functions for its jumps is smooth, and its orders decay fast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, Indices

DEGREES = 4
"""Number of functions whose jumps are computed: the value and its first three derivatives."""
SAME_ANGLE = 1e-10
_WIDTH = 0.06
"""Longest interval next to a kink on which a polynomial is fitted for the derivatives [rad]."""
_NODES = 6
_PLACES = 0.5 - 0.5 * np.cos(math.pi * (np.arange(_NODES) + 0.5) / _NODES)
# shortest interval, and the largest degree of a polynomial that it determines to enough digits
_DEGREES_OF = ((0.01, _NODES - 1), (1e-3, 3), (1e-5, 2), (0.0, 1))
_SHORTEST = np.array([minimum for minimum, _ in _DEGREES_OF])
_FACTORIALS = np.array([float(math.factorial(m)) for m in range(DEGREES)])
_CANCELLED = 1e-12
_MET = 1e-7
_STEPS = 360
_QUARTERS = np.array([-1j, -1.0, 1j, 1.0])
"""Powers 1, 2, 3 and 4 of 1 / i."""
_RUN = 32
_BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class SignalKinks:
    """Kinks of a periodic signal: angles at which its value or derivatives jump.

    Attributes
    ----------
    angles
        Crank angles of the kinks, shape (k,) [rad], each within one period.
    jumps
        Jumps of the value and of its derivatives 1, 2, ... by the angle, shape (k, degrees, ...); trailing axes are
        those of the signal.
    """

    angles: Array
    jumps: Array

    @property
    def peak_angles(self) -> Array:
        """Angles where a peak may lie [rad]: jumps of slope, and both sides of jumps of value."""
        size = np.abs(self.jumps).reshape(*self.jumps.shape[:2], -1).max(axis=2)
        # jumps below these are rounding errors of higher derivatives
        steps, slopes = size[:, 0] > 1e-9 * size.max(), size[:, 1] > 1e-6 * size.max()
        breaks = self.angles[steps]
        return np.concatenate([self.angles[slopes & ~steps], breaks - SAME_ANGLE, breaks + SAME_ANGLE])

    def values(self, angles: Array, period: float, derivative: int = 0) -> Array:
        """Return the part of a signal that its kinks cause, or its derivative, at angles [rad], shape (angles, ...)."""
        k = len(self.jumps)
        weights = self.pieces(period, derivative)
        weights = weights.reshape(*weights.shape[:2], -1)
        values = np.empty((len(angles), weights.shape[2]))
        step = max(_BLOCK // k, 1)
        for start in range(0, len(angles), step):
            x = (angles[start : start + step, None] - self.angles) / period
            x -= np.floor(x)
            x -= 0.5
            piece, power = weights[0].sum(axis=0), np.ones_like(x)
            for factors in weights[1:]:
                power *= x
                piece = piece + power @ factors
            values[start : start + step] = piece
        return values.reshape(len(angles), *self.jumps.shape[2:])

    def pieces(self, period: float, derivative: int = 0) -> Array:
        """Return coefficients of the polynomial after each kink in powers of phi / P - 1/2, shape (powers, k, ...).

        phi is the angle from the kink, and P the period; the polynomials sum up to the closed form or its derivative.
        """
        k, degrees = self.jumps.shape[:2]
        powers = [m - derivative for m in range(degrees)]
        table: Array = np.array([period**m * _kernel(m, degrees + 2) for m in powers])
        factors = (table.T @ self.jumps.reshape(k, degrees, -1)).swapaxes(0, 1)
        return np.asarray(factors.reshape(-1, k, *self.jumps.shape[2:]))

    def coefficients(self, count: int, base: float) -> NDArray[np.complex128]:
        """Return the coefficients of the closed form in orders 0, b, ... (count - 1) b, shape (count, ...).

        b is the base order `base`; the coefficient of order 0 is zero.
        """
        k, degrees = self.jumps.shape[:2]
        flat = self.jumps.reshape(k, degrees, -1)
        size, shares = _shares(count, base, degrees)
        weighted = (waves(self.angles * base, count) @ flat.reshape(k, -1)).reshape(count, degrees, -1)
        total = (shares[:, None] @ weighted)[:, 0]
        largest = size @ np.abs(flat).sum(axis=0)
        # sums that a crank star cancels are exactly zero
        return np.where(np.abs(total) > _CANCELLED * largest, total, 0.0).reshape(count, *self.jumps.shape[2:])

    def beyond(self, count: int, base: float) -> tuple[Array, Array]:
        """Return upper bounds of the orders from `count` x base on in the closed form, shape (...) each.

        The first bounds the maximum of their sum over the period, the second its root mean square.
        """
        total = power = np.zeros(self.jumps.shape[2:])
        for m, jumps in enumerate(np.abs(self.jumps).sum(axis=0)):
            unit, last = jumps / (math.pi * base**m), max(count - 1, 0.5)
            # the remainder of a jump is at most half of it plus the Gibbs overshoot
            total = total + (unit / (m * last**m) if m else 0.6 * jumps)
            power = power + unit / math.sqrt((4 * m + 2) * last ** (2 * m + 1))
        return total, power

    def beyond_averaged(self, count: int, base: float, steps: float) -> Array:
        """Return an upper bound of the orders from `count` x base on, averaged at `steps` samples of a period (P7)."""
        total, last = np.zeros(self.jumps.shape[2:]), max(count - 1, 0.5)
        for m, jumps in enumerate(np.abs(self.jumps).sum(axis=0)):
            # the factor sinc^2 of order j is at most (steps / (pi j))^2
            total = total + jumps / (math.pi * base**m) * (steps / math.pi) ** 2 / ((m + 2) * last ** (m + 2))
        return np.minimum(total, self.beyond(count, base)[0])

    def curvature(self, period: float) -> Array:
        """Return the second derivative of the closed form at equal steps and at both sides of kinks, shape (n, ...)."""
        steps = period * np.arange(_STEPS) / _STEPS
        return self.values(np.concatenate([steps, self.angles - SAME_ANGLE, self.angles + SAME_ANGLE]), period, 2)

    def mapped(self, linear: Callable[[Array], Array]) -> SignalKinks | None:
        """Return the kinks after a real linear map of values, shape (n, ...); None if no kink remains."""
        k, degrees = self.jumps.shape[:2]
        flat = np.asarray(linear(self.jumps.reshape(k * degrees, *self.jumps.shape[2:])))
        return _kinks_with_jumps(self.angles, flat.reshape(k, degrees, *flat.shape[1:]))

    def shift(self, angle: float, degrees: int = 0) -> Self:
        """Return the kinks delayed by `angle` [rad] and integrated `degrees` times."""
        zeros = np.zeros((len(self.angles), degrees, *self.jumps.shape[2:]))
        return type(self)(self.angles + angle, np.concatenate([zeros, self.jumps], axis=1))

    def repeated(self, delays: Sequence[float], period: float) -> SignalKinks | None:
        """Return the kinks of the sum of the signal at these delays [rad], with angles reduced to `period` [rad]."""
        angles = np.add.outer(delays, self.angles).ravel()
        return merge_kinks(_within(angles, period), np.concatenate([self.jumps] * len(delays)))

    @property
    def derivative(self) -> SignalKinks | None:
        """Kinks of the derivative of a continuous signal; None if it has no kinks."""
        return _kinks_with_jumps(self.angles, self.jumps[:, 1:])

    def folded(self, period: float, times: int) -> SignalKinks | None:
        """Return the kinks of a signal averaged over `times` shifts, with the angles reduced to `period` [rad]."""
        return merge_kinks(_within(self.angles, period), self.jumps / times)

    def strongest(self, count: int) -> Self:
        """Return the `count` kinks with the largest effect within one degree."""
        steps = math.radians(1.0) ** np.arange(self.jumps.shape[1])
        size = np.einsum("km,m->k", np.abs(self.jumps).reshape(*self.jumps.shape[:2], -1).max(axis=2), steps)
        selection = np.sort(np.argsort(-size, kind="stable")[:count])
        return type(self)(self.angles[selection], self.jumps[selection])


def join_kinks(parts: Sequence[SignalKinks | None]) -> SignalKinks | None:
    """Return the kinks of a sum of signals from the kinks of each; None if it has no kinks."""
    present = [kinks for kinks in parts if kinks is not None]
    if len(present) < 2:
        return present[0] if present else None
    jumps = np.zeros(
        (sum(len(k.jumps) for k in present), max(k.jumps.shape[1] for k in present), *present[0].jumps.shape[2:])
    )
    start = 0
    for kinks in present:
        jumps[start : start + len(kinks.jumps), : kinks.jumps.shape[1]] = kinks.jumps
        start += len(kinks.jumps)
    return merge_kinks(np.concatenate([kinks.angles for kinks in present]), jumps)


def merge_kinks(angles: Array, jumps: Array) -> SignalKinks | None:
    """Return the kinks with those at equal angles added up; None if all jumps are zero."""
    first, order = _distinct(angles)
    return (
        _kinks_with_jumps(angles[order[first]], np.add.reduceat(jumps[order], first, axis=0)) if len(angles) else None
    )


def _distinct(angles: Array) -> tuple[Indices, Indices]:
    # starts of equal angles in their order
    steps = np.round(angles / SAME_ANGLE)
    order = np.argsort(steps, kind="stable")
    steps = steps[order]
    is_first = np.ones(len(steps), dtype=bool)
    is_first[1:] = steps[1:] != steps[:-1]
    return np.flatnonzero(is_first), order


def _kinks_with_jumps(angles: Array, jumps: Array) -> SignalKinks | None:
    nonzero = jumps.reshape(len(jumps), -1).any(axis=1)
    if len(angles) and nonzero.all():
        return SignalKinks(angles, jumps)
    return SignalKinks(angles[nonzero], jumps[nonzero]) if nonzero.any() else None


@dataclass(frozen=True, eq=False)
class KinkNodes:
    """Angles near breaks, at which a signal has to be known for its kinks.

    Derivatives on both sides of a break are those of polynomials through values near it.

    Attributes
    ----------
    places
        Angles where a derivative may jump, shape (k,) [rad], each within one period.
    intervals
        Signed length after and before each, over which a polynomial is fitted, shape (k, 2) [rad].
    """

    places: Array
    intervals: Array

    @property
    def angles(self) -> Array:
        """Angles of the nodes, shape (n,) [rad]."""
        return np.asarray((self.places[:, None, None] + self.intervals[:, :, None] * _PLACES).ravel())

    def kinks(self, values: Array) -> SignalKinks | None:
        """Return the kinks of a signal from its values at the nodes, shape (n, ...); None if no derivative jumps."""
        if not len(self.places):
            return None
        flat = values.reshape(len(self.places), 2, _NODES, -1)
        series = _fits()[np.searchsorted(-_SHORTEST, -np.abs(self.intervals))] @ flat
        powers = _FACTORIALS / self.intervals[:, :, None] ** np.arange(DEGREES)
        jumps = np.sum(series * (np.sign(self.intervals)[:, :, None] * powers)[..., None], axis=1)
        # without a jump the polynomials of both sides meet to a rounding error
        jumps[:, 0] *= np.abs(jumps[:, 0]) > _MET * np.abs(values).max(initial=0.0)
        return _kinks_with_jumps(self.places, jumps.reshape(*jumps.shape[:2], *values.shape[1:]))


def kink_nodes(breaks: Array, period: float) -> KinkNodes:
    """Return the nodes of a signal whose derivatives may jump at the angles `breaks`, shape (k,) [rad]."""
    places = _within(breaks, period)
    first, order = _distinct(places)
    places = places[order[first]]
    # an interval ends at the next kink
    ends = np.concatenate([places[-1:] - period, places, places[:1] + period])
    gaps = np.minimum(ends[1:] - ends[:-1], _WIDTH)
    return KinkNodes(places, np.stack([gaps[1:], -gaps[:-1]], axis=1))


def _within(angles: Array, period: float) -> Array:
    return np.asarray(np.mod(angles + 0.5 * SAME_ANGLE, period) - 0.5 * SAME_ANGLE)


@lru_cache(maxsize=16)
def _shares(count: int, base: float, degrees: int) -> tuple[Array, NDArray[np.complex128]]:
    # (b / pi) / (i j b)^(m + 1) for order j b and degree m, zero at order 0, with its absolute value
    inverse = np.zeros(count)
    inverse[1:] = 1.0 / (np.arange(1, count) * base)
    size = np.asarray(base / math.pi * inverse[:, None] ** np.arange(1, 1 + degrees))
    return size, size * _QUARTERS[np.arange(degrees) % 4]


def waves(angles: Array, count: int) -> NDArray[np.complex128]:
    """Return e^{-i j angle} for j = 0 ... count - 1 as products of two exponentials, shape (count, angles)."""
    low = np.exp(-1j * np.outer(np.arange(min(_RUN, count)), angles))
    high = np.exp(-1j * np.outer(np.arange(0, count, _RUN), angles))
    return np.asarray((high[:, None] * low).reshape(len(high) * len(low), len(angles))[:count])


@lru_cache(maxsize=1)
def _fits() -> Array:
    # polynomials of each degree from values at the nodes, shape (classes, DEGREES, nodes)
    fits = np.zeros((len(_DEGREES_OF), DEGREES, _NODES))
    for k, (_, degree) in enumerate(_DEGREES_OF):
        count = min(degree + 1, DEGREES)
        fits[k, :count] = np.linalg.pinv(np.vander(_PLACES, degree + 1, increasing=True))[:count]
    return fits


@lru_cache(maxsize=64)
def _kernel(degree: int, count: int) -> Array:
    polynomial = [-1.0] if degree >= -1 else [0.0]
    for _ in range(degree + 1):
        polynomial = [0.0, *(c / k for k, c in enumerate(polynomial, 1))]
        # the mean of y^k is 2^-k / (k + 1) where k is even
        polynomial[0] = -sum(c * 0.5**k / (k + 1) for k, c in enumerate(polynomial) if k % 2 == 0)
    return np.array(polynomial + [0.0] * (count - len(polynomial)))
