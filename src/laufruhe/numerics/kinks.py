"""Kinks of a periodic signal: angles at which its derivatives jump, in closed form (L5a).

No sum of finitely many orders bends at an angle; it rounds the kink off. The function of period P
whose m-th derivative jumps by one at zero, and by nothing else anywhere, is a polynomial between its jumps,

    f_m(phi) = -P^m B_(m+1)(phi / P) / (m + 1)!,    c_j = (2 / P) / (i j b)^(m+1),    b = 2 pi / P,

B the Bernoulli polynomials. With the jumps of its first derivatives taken away so, a signal is smooth,
and its orders fall off fast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array

DEGREES = 4
"""The value itself and as many derivatives but one, whose jumps are found."""
SAME_ANGLE = 1e-10
_WIDTH = 0.06
"""Longest stretch beside a kink from which its derivatives are taken [rad]."""
_NODES = 6
_PLACES = 0.5 - 0.5 * np.cos(math.pi * (np.arange(_NODES) + 0.5) / _NODES)
# least stretch, and the degree of a polynomial whose coefficients it determines to enough digits
_DEGREES_OF = ((0.01, _NODES - 1), (1e-3, 3), (1e-5, 2), (0.0, 1))
_FACTORIALS = np.array([float(math.factorial(m)) for m in range(DEGREES)])
_CANCELLED = 1e-12
_MET = 1e-7
_STEPS = 360
_BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class SignalKinks:
    """Jumps of the derivatives of a signal.

    Attributes
    ----------
    angles
        Shape (k,) [rad], each within one period.
    jumps
        Of the value and its derivatives 1, 2, ... by the angle, shape (k, degrees, ...), of a signal of any shape.
    """

    angles: Array
    jumps: Array

    @property
    def peak_angles(self) -> Array:
        """Angles where a peak may stand: jumps of the slope, and both sides of jumps of the value."""
        size = np.abs(self.jumps).reshape(*self.jumps.shape[:2], -1).max(axis=2)
        # what is left of the jumps of higher derivatives is a rounding
        steps, slopes = size[:, 0] > 1e-9 * size.max(), size[:, 1] > 1e-6 * size.max()
        beside = self.angles[steps]
        return np.concatenate([self.angles[slopes & ~steps], beside - SAME_ANGLE, beside + SAME_ANGLE])

    def values(self, angles: Array, period: float, derivative: int = 0) -> Array:
        """Return the sum of f_m times the jumps, or a derivative of it, shape (len(angles), ...)."""
        k = len(self.jumps)
        weights = self.pieces(period, derivative)
        weights = weights.reshape(*weights.shape[:2], -1)
        out = np.empty((len(angles), weights.shape[2]))
        step = max(_BLOCK // k, 1)
        for start in range(0, len(angles), step):
            x = np.mod((angles[start : start + step, None] - self.angles) / period, 1.0) - 0.5
            found, power = weights[0].sum(axis=0), np.ones_like(x)
            for own in weights[1:]:
                power *= x
                found = found + power @ own
            out[start : start + step] = found
        return out.reshape(len(angles), *self.jumps.shape[2:])

    def pieces(self, period: float, derivative: int = 0) -> Array:
        """Return the factors of the powers of phi / P - 1/2 after every kink, shape (powers, k, ...)."""
        k, degrees = self.jumps.shape[:2]
        powers = [m - derivative for m in range(degrees)]
        table: Array = np.array([period**m * _kernel(m, degrees + 2) for m in powers])
        found = np.einsum("mp,kmd->pkd", table, self.jumps.reshape(k, degrees, -1))
        return np.asarray(found.reshape(-1, k, *self.jumps.shape[2:]))

    def coefficients(self, count: int, base: float) -> NDArray[np.complex128]:
        """Return the coefficients of orders 0, b, ... (count - 1) b, shape (count, ...); zero at order 0."""
        k, degrees = self.jumps.shape[:2]
        flat, orders = self.jumps.reshape(k, degrees, -1), np.arange(count) * base
        waves = np.exp(-1j * np.outer(orders, self.angles))
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = base / math.pi / (1j * orders[:, None]) ** np.arange(1, 1 + degrees)
        shares[:1] = 0.0
        together = (waves @ flat.reshape(k, -1)).reshape(count, degrees, -1)
        total, size = (shares[:, None] @ together)[:, 0], np.abs(shares) @ np.abs(flat).sum(axis=0)
        # what a star cancels is nothing, and not a rounding
        return np.where(np.abs(total) > _CANCELLED * size, total, 0.0).reshape(count, *self.jumps.shape[2:])

    def beyond(self, count: int, base: float) -> tuple[Array, Array]:
        """Bound all orders from `count` b on: their sum, and the root of their mean square."""
        total = power = np.zeros(self.jumps.shape[2:])
        for m, jumps in enumerate(np.abs(self.jumps).sum(axis=0)):
            unit, last = jumps / (math.pi * base**m), max(count - 1, 0.5)
            # what any number of orders leaves of a jump is no more than the half of it and their overshoot
            total = total + (unit / (m * last**m) if m else 0.6 * jumps)
            power = power + unit / math.sqrt((4 * m + 2) * last ** (2 * m + 1))
        return total, power

    def beyond_averaged(self, count: int, base: float, steps: float) -> Array:
        """Bound the orders from `count` b on of averages about `steps` angles in a period (P7)."""
        total, last = np.zeros(self.jumps.shape[2:]), max(count - 1, 0.5)
        for m, jumps in enumerate(np.abs(self.jumps).sum(axis=0)):
            # sinc^2 leaves of order j no more than (steps / (pi j))^2
            total = total + jumps / (math.pi * base**m) * (steps / math.pi) ** 2 / ((m + 2) * last ** (m + 2))
        return np.minimum(total, self.beyond(count, base)[0])

    def curvature(self, period: float) -> Array:
        """Return the second derivative on both sides of every kink and at steps between, shape (n, ...)."""
        steps = period * np.arange(_STEPS) / _STEPS
        return self.values(np.concatenate([steps, self.angles - SAME_ANGLE, self.angles + SAME_ANGLE]), period, 2)

    def mapped(self, linear: Callable[[Array], Array]) -> SignalKinks | None:
        """Return the kinks through a real linear map of values (n, ...), or None without any."""
        k, degrees = self.jumps.shape[:2]
        flat = np.asarray(linear(self.jumps.reshape(k * degrees, *self.jumps.shape[2:])))
        return _left(self.angles, flat.reshape(k, degrees, *flat.shape[1:]))

    def shift(self, by: float, degrees: int = 0) -> Self:
        """Shift the kinks later by an angle, and integrate them `degrees` times."""
        none = np.zeros((len(self.angles), degrees, *self.jumps.shape[2:]))
        return type(self)(self.angles + by, np.concatenate([none, self.jumps], axis=1))

    @property
    def derivative(self) -> SignalKinks | None:
        """Kinks of the derivative of a continuous signal."""
        return _left(self.angles, self.jumps[:, 1:])

    def repeated(self, period: float, times: int) -> SignalKinks | None:
        """Return the kinks of the same signal counted over several of its periods."""
        return join_kinks([self.shift(k * period) for k in range(times)])

    def folded(self, period: float, times: int) -> SignalKinks | None:
        """Return the kinks of a signal that repeats `times` within `period`, over its own period."""
        return merge_kinks(_within(self.angles, period), self.jumps / times)

    def strongest(self, count: int) -> SignalKinks | None:
        """Return the `count` kinks that bend most over a degree."""
        steps = math.radians(1.0) ** np.arange(self.jumps.shape[1])
        size = np.einsum("km,m->k", np.abs(self.jumps).reshape(*self.jumps.shape[:2], -1).max(axis=2), steps)
        kept = np.sort(np.argsort(-size, kind="stable")[:count])
        return merge_kinks(self.angles[kept], self.jumps[kept])


def join_kinks(parts: Sequence[SignalKinks | None]) -> SignalKinks | None:
    """Return the kinks of a sum of signals."""
    found = [kinks for kinks in parts if kinks is not None]
    if len(found) < 2:
        return found[0] if found else None
    degrees = max(kinks.jumps.shape[1] for kinks in found)
    jumps = [_pad(kinks.jumps, degrees) for kinks in found]
    return merge_kinks(np.concatenate([kinks.angles for kinks in found]), np.concatenate(jumps))


def _pad(jumps: Array, degrees: int) -> Array:
    out = np.zeros((len(jumps), degrees, *jumps.shape[2:]))
    out[:, : jumps.shape[1]] = jumps
    return out


def merge_kinks(angles: Array, jumps: Array) -> SignalKinks | None:
    """Merge kinks at equal angles; None if nothing is left."""
    _, first, inverse = np.unique(np.round(angles / SAME_ANGLE), return_index=True, return_inverse=True)
    total = np.zeros((len(first), *jumps.shape[1:]))
    np.add.at(total, inverse, jumps)
    return _left(angles[first], total)


def _left(angles: Array, jumps: Array) -> SignalKinks | None:
    used = jumps.reshape(len(jumps), -1).any(axis=1)
    if len(angles) and used.all():
        return SignalKinks(angles, jumps)
    return SignalKinks(angles[used], jumps[used]) if used.any() else None


def find_kinks(signal: Callable[[Array], Array], breaks: Array, period: float) -> SignalKinks | None:
    """Find the kinks of a function of the angle at the angles where its derivatives may jump.

    The derivatives on either side are those of polynomials through values beside the kink.

    Parameters
    ----------
    signal
        From angles (n,) to values (n, ...), smooth between the breaks.
    breaks
        Shape (k,) [rad].
    """
    at = _within(breaks, period)
    at = at[np.unique(np.round(at / SAME_ANGLE), return_index=True)[1]]
    if not len(at):
        return None
    # a stretch ends at the next kink
    after = np.diff(at, append=at[0] + period)
    stretches = np.minimum(np.stack([after, np.roll(after, 1)], axis=1), _WIDTH)
    sides = np.array([1.0, -1.0])
    angles = at[:, None, None] + (sides * stretches)[:, :, None] * _PLACES
    values = np.asarray(signal(angles.ravel()))
    values = values.reshape(len(at), 2, _NODES, *values.shape[1:])
    found = np.zeros((*stretches.shape, DEGREES, *values.shape[3:]))
    longest = math.inf
    for minimum, degree in _DEGREES_OF:
        own = (minimum <= stretches) & (stretches < longest)
        longest, count = minimum, min(degree + 1, DEGREES)
        series = np.tensordot(values[own], _fit(degree)[:count], axes=(1, 1))
        # shapes (n, ..., degrees): a power of the stretch, with its side, below every one
        signed = (sides * stretches)[own].reshape(-1, *(1,) * (series.ndim - 1))
        series *= np.sign(signed) * _FACTORIALS[:count] / signed ** np.arange(count)
        found[own, :count] = np.moveaxis(series, -1, 1)
    jumps = found[:, 0] + found[:, 1]
    # polynomials meet to a rounding where nothing jumps
    jumps[:, 0] *= np.abs(jumps[:, 0]) > _MET * np.abs(values).max(initial=0.0)
    return merge_kinks(at, jumps)


def _within(angles: Array, period: float) -> Array:
    return np.asarray(np.mod(angles + 0.5 * SAME_ANGLE, period) - 0.5 * SAME_ANGLE)


@lru_cache(maxsize=8)
def _fit(degree: int) -> Array:
    return np.asarray(np.linalg.pinv(np.vander(_PLACES, degree + 1, increasing=True)))


@lru_cache(maxsize=64)
def _kernel(degree: int, count: int) -> Array:
    own = [-1.0] if degree >= -1 else [0.0]
    for _ in range(degree + 1):
        own = [0.0, *(c / k for k, c in enumerate(own, 1))]
        # the mean of y^k is 2^-k / (k + 1) where k is even
        own[0] = -sum(c * 0.5**k / (k + 1) for k, c in enumerate(own) if k % 2 == 0)
    return np.array(own + [0.0] * (count - len(own)))
