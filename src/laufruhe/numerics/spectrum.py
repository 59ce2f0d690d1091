"""Periodic signals, represented by a complex coefficient for each order (C8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from math import gcd, lcm
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from laufruhe.numerics.exact_angles import Turn, phasors
from laufruhe.numerics.kinks import SAME_ANGLE, SignalKinks, join_kinks, kink_nodes, waves

MAX_SIGNAL_KINKS = 24
"""Largest number of kinks of one signal that are kept in closed form; its orders contain all others."""
JUMP_OFFSET = 1e-3 * SAME_ANGLE
"""Angle behind a jump at which samples are taken [rad]: above its rounding error, without effect on smooth parts."""
MAX_ORDER_DENOMINATOR = 1000
PER_ORDER = 1000
"""Steps in one order: orders that round to the same thousandth of crank speed are equal."""

# The C library hands pages of every array over 128 kB back to the system, and gets them anew for the next, until one
# of a few MB was given back: samples of a cycle take half the time after that.
np.empty(1 << 20)


def orders_equal(orders: ArrayLike, selection: ArrayLike) -> NDArray[np.bool_]:
    """Return the mask of orders that equal one of `selection`, shape of `orders`; the only rule of equal orders."""
    return np.isin(_thousandths(orders), _thousandths(selection))


def _thousandths(orders: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(np.round(np.asarray(orders, dtype=float) * PER_ORDER))


def as_order(order: float) -> Fraction:
    """Round an order, or the ratio of a speed to crank speed, to a fraction."""
    return Fraction(order).limit_denominator(MAX_ORDER_DENOMINATOR)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Periodic signal f(phi) = Re sum_j c_j e^{i j b phi}, with phi the crank angle [rad] and b the base order (C8).

    Attributes
    ----------
    base
        Base order b: 1 for a period of one turn, 1/2 for a four-stroke cycle. All orders are multiples of it.
    coefficients
        Complex coefficient c_j of order j b, j = 0 ... n - 1, shape (n, ...); trailing axes are those of the signal.
    kinks
        Jumps of value and derivatives; orders from n on are those of the kinks (L5a). None for a smooth signal.
    """

    base: Fraction
    coefficients: NDArray[np.complex128]
    kinks: SignalKinks | None = None

    @property
    def period(self) -> float:
        """Period 2 pi / b [rad]."""
        return math.tau / float(self.base)

    @cached_property
    def smooth(self) -> Spectrum:
        """Signal less the closed form of its kinks."""
        if self.kinks is None:
            return self
        return Spectrum(
            self.base, self.coefficients - self.kinks.coefficients(len(self.coefficients), float(self.base))
        )

    def shift(self, turn: Turn, angle: float) -> Spectrum:
        """Return the signal delayed by a crank angle [rad]; `turn` is the same delay as a fraction of the period."""
        phases = phasors([-turn], np.arange(len(self.coefficients)))
        coefficients = self.coefficients * phases.reshape(-1, *(1,) * (self.coefficients.ndim - 1))
        kinks = None if self.kinks is None else self.kinks.shift(angle).folded(self.period, 1)
        return Spectrum(self.base, coefficients, kinks)

    @property
    def series(self) -> Spectrum:
        """Signal of the listed orders alone, without kinks: its averages are exact, its samples near a kink are not."""
        return self if self.kinks is None else Spectrum(self.base, self.coefficients)

    @property
    def kink_angles(self) -> NDArray[np.float64]:
        """Angles at which the slope jumps, shape (k,) [rad]."""
        return np.zeros(0) if self.kinks is None else self.kinks.peak_angles

    def with_coefficients(self, coefficients: NDArray[np.complex128]) -> Spectrum:
        """Return the signal with other coefficients, shape (n, ...), and the same kinks."""
        return Spectrum(self.base, coefficients, self.kinks)

    def mapped(self, linear: Callable[[NDArray[Any]], NDArray[Any]]) -> Spectrum:
        """Return the signal after a real linear map of its values, a function of arrays (n, ...)."""
        kinks = None if self.kinks is None else self.kinks.mapped(linear)
        return Spectrum(self.base, linear(self.coefficients), kinks)

    def averaged(self, step: float) -> Spectrum:
        """Return the signal averaged under a triangle of half-width `step` [rad]: sinc^2 times each order (P7)."""
        share = np.sinc(self.orders * step / math.tau) ** 2
        return Spectrum(self.base, self.coefficients * share.reshape(-1, *(1,) * (self.coefficients.ndim - 1)))

    @property
    def orders(self) -> NDArray[np.float64]:
        """Orders of the coefficients as multiples of crank speed, shape (n,)."""
        return np.asarray(np.arange(len(self.coefficients)) * float(self.base))

    def at(self, order: float) -> NDArray[np.complex128]:
        """Return the coefficient of one order, shape (...); zero if the signal does not have this order."""
        indices = np.flatnonzero(orders_equal(self.orders, order))
        return np.asarray(self.coefficients[indices].sum(axis=0))

    def with_orders(self, orders: ArrayLike) -> Spectrum:
        """Return the part of the signal with these orders; coefficients of all others are zero."""
        counted = orders_equal(self.orders, orders).reshape(-1, *(1,) * (self.coefficients.ndim - 1))
        return Spectrum(self.base, np.where(counted, self.coefficients, 0.0))

    @property
    def without_mean(self) -> Spectrum:
        """Signal less its mean over the period (M7); kinks have no mean."""
        return self.with_coefficients(np.concatenate([np.zeros_like(self.coefficients[:1]), self.coefficients[1:]]))

    def sample(self, samples: int, offset: float = 0.0) -> NDArray[np.float64]:
        """Return values at `samples` equal steps over one period 2 pi / b, shape (samples, ...).

        Orders above half the number of samples are folded, so every value is that of the complete series. Kinks are
        evaluated later than each step by `offset` [rad]. With `JUMP_OFFSET` all terms of a sum take the same side of a
        jump that lies on a step; with zero, rounding decides.
        """
        if self.kinks is not None:
            angles = self.period * np.arange(samples) / samples + offset
            return self.smooth.sample(samples) + self.kinks.values(angles, self.period)
        folded = np.zeros((samples, *self.coefficients.shape[1:]), dtype=complex)
        for start in range(0, len(self.coefficients), samples):
            block = self.coefficients[start : start + samples]
            folded[: len(block)] += block
        # half of the folded orders determine a real signal
        first = samples // 2 + 1
        half = folded[:first] + folded[-np.arange(first) % samples].conj()
        return np.asarray(np.fft.irfft(0.5 * half, samples, axis=0, norm="forward"))

    def values(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signal at crank angles [rad], shape (len(angles), ...)."""
        smooth = self.smooth.coefficients
        nonzero = np.flatnonzero(smooth.reshape(len(smooth), -1).any(axis=1))
        step = max(int(np.gcd.reduce(nonzero)), 1)
        turned = waves(-float(self.base) * step * angles, (nonzero.max(initial=0) + step) // step)
        values = np.asarray(np.tensordot(turned[nonzero // step], smooth[nonzero], axes=(0, 0)).real)
        return values if self.kinks is None else values + self.kinks.values(angles, self.period)

    @property
    def integral(self) -> Spectrum:
        """Integral of the alternating part over the crank angle, with mean zero."""
        integrated = np.zeros_like(self.coefficients)
        integrated[1:] = (self.coefficients[1:].T / (1j * self.orders[1:])).T
        return Spectrum(self.base, integrated, None if self.kinks is None else self.kinks.shift(0.0, 1))

    @property
    def derivative(self) -> Spectrum:
        """Derivative by the crank angle; for a signal with jumps of value, that of the listed orders alone."""
        steep = (self.coefficients.T * (1j * self.orders)).T
        if self.kinks is None or self.kinks.jumps[:, 0].any():
            return Spectrum(self.base, steep)
        return Spectrum(self.base, steep, self.kinks.derivative)

    def padded(self, count: int) -> Spectrum:
        """Return the signal with at least `count` coefficients; further ones are those of its kinks, or zero."""
        return self + Spectrum(self.base, np.zeros((count, *self.coefficients.shape[1:]), dtype=complex))

    def with_finer_base(self, base: Fraction) -> Spectrum:
        """Return the same signal with a smaller base order, of which the present one is a multiple."""
        factor = self.base / base
        if factor.denominator != 1:
            raise ValueError(f"{base} does not divide {self.base}")
        if factor == 1:
            return self
        step = int(factor)
        spread = np.zeros(((len(self.coefficients) - 1) * step + 1, *self.coefficients.shape[1:]), dtype=complex)
        spread[::step] = self.coefficients
        kinks = None if self.kinks is None else join_kinks([self.kinks.shift(k * self.period) for k in range(step)])
        return Spectrum(base, spread, kinks)

    @cached_property
    def components(self) -> NDArray[np.bool_]:
        """Mask of the components that have a nonzero coefficient, shape (...)."""
        return np.asarray(self.coefficients.any(axis=0))

    @cached_property
    def step(self) -> int:
        """Greatest common divisor of the indices of nonzero coefficients; zero for a constant."""
        nonzero = np.logical_or.reduce(self.coefficients.reshape(len(self.coefficients), -1), axis=1)
        return gcd(*nonzero.nonzero()[0].tolist())

    def repeat_order(self, also: tuple[Fraction, ...] = ()) -> Fraction:
        """Return the base order of the shortest period in which the signal and the orders `also` repeat."""
        orders, step = [order for order in also if order > 0], self.step
        if step:
            orders.append(self.base * step)
        return common_base(orders or [Fraction(1)])

    def with_base(self, base: Fraction) -> Spectrum:
        """Return the same signal with another base order, whose period must be a period of the signal."""
        if base is self.base or base == self.base:
            return self
        ratio = base / self.base
        fine, step = self if ratio.denominator == 1 else self.with_finer_base(_common(base, self.base)), ratio.numerator
        kinks = None if fine.kinks is None else fine.kinks.folded(fine.period / step, step)
        return Spectrum(base, fine.coefficients[::step], kinks)

    def truncated(self, highest: float) -> Spectrum:
        """Return the signal without orders above `highest`; without its kinks too if any order is dropped."""
        count = int(np.sum(_thousandths(self.orders) <= _thousandths(highest)))
        return self if count == len(self.coefficients) else Spectrum(self.base, self.coefficients[:count])

    def __add__(self, other: Spectrum) -> Spectrum:
        a, b = self, other
        if a.base != b.base:
            base = _common(a.base, b.base)
            a, b = a.with_finer_base(base), b.with_finer_base(base)
        if len(a.coefficients) < len(b.coefficients):
            a, b = b, a
        total = a.coefficients.astype(complex)
        if b.kinks is not None and len(a.coefficients) > len(b.coefficients):
            # kinks have orders beyond the listed ones
            beyond = b.kinks.coefficients(len(total), float(b.base))
            total[len(b.coefficients) :] += beyond[len(b.coefficients) :]
        total[: len(b.coefficients)] += b.coefficients
        return Spectrum(a.base, total, join_kinks([a.kinks, b.kinks]))


def _common(a: Fraction, b: Fraction) -> Fraction:
    return Fraction(gcd(a.numerator, b.numerator), lcm(a.denominator, b.denominator))


def common_base(orders: Sequence[Fraction]) -> Fraction:
    """Return the largest base order of which all these orders are multiples."""
    return reduce(_common, orders)


def stacked_coefficients(spectra: Sequence[Spectrum], *bases: Fraction) -> tuple[Fraction, NDArray[np.complex128]]:
    """Return the common base order of spectra and `bases`, and the coefficients with it, shape (spectra, n, ...)."""
    base = common_base([*bases, *(spectrum.base for spectrum in spectra)])
    series = [spectrum.with_finer_base(base).coefficients for spectrum in spectra]
    count = max(map(len, series))
    sides = ((0, 0),) * (series[0].ndim - 1)
    return base, np.array([np.pad(part, ((0, count - len(part)), *sides)) for part in series])


def base_of(orders: Sequence[float]) -> Fraction:
    """Return the largest base order of the positive orders; 1 if there are none."""
    return common_base([as_order(order) for order in orders if order > 0.0] or [Fraction(1)])


def spectrum_of(samples: NDArray[np.float64], base: Fraction) -> Spectrum:
    """Return the spectrum of a real signal sampled over one period, shape (n, ...) to (n//2 + 1, ...)."""
    count = len(samples)
    coefficients = np.fft.rfft(samples, axis=0) * (2.0 / count)
    coefficients[0] /= 2.0
    if count % 2 == 0:
        coefficients[-1] /= 2.0
    return Spectrum(base, coefficients)


def spectrum_with_kinks(
    signal: Callable[[NDArray[np.float64]], NDArray[np.float64]], samples: int, base: Fraction,
    breaks: NDArray[np.float64], maximum: int = MAX_SIGNAL_KINKS,
) -> Spectrum:  # fmt: skip
    """Return the spectrum of a function of the angle whose derivatives jump (L5a).

    Parameters
    ----------
    signal
        Function of angles (n,) [rad] that returns values (n, ...).
    samples
        Number of samples over the period.
    base
        Base order, 2 pi over the period.
    breaks
        Angles where a derivative may jump, shape (k,) [rad].
    maximum
        Largest number of kinks in closed form; the strongest ones are kept.
    """
    period = math.tau / float(base)
    angles = period * np.arange(samples) / samples
    if len(breaks) > samples:
        # pieces between breaks are shorter than a step: finer samples, and no kinks
        finer = samples * math.ceil(len(breaks) / samples)
        whole = spectrum_of(signal(period * np.arange(finer) / finer), base)
        return Spectrum(base, whole.coefficients[: samples // 2 + 1])
    # samples on a jump are taken on its later side
    later, nodes = angles + SAME_ANGLE, kink_nodes(breaks, period)
    values = signal(np.concatenate([nodes.angles, later]))
    kinks = nodes.kinks(values[:-samples])
    if kinks is None:
        return spectrum_of(signal(angles), base)
    if len(kinks.angles) > maximum:
        kinks = kinks.strongest(maximum)
    remainder = spectrum_of(values[-samples:] - kinks.values(later, period), base)
    smooth = (remainder.coefficients.T * np.exp(-1j * SAME_ANGLE * remainder.orders)).T
    return Spectrum(base, smooth + kinks.coefficients(len(smooth), float(base)), kinks)


def order_amplitude(coefficient: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the largest length of the vector Re c e^{i h phi} over the angle phi (M5).

    c are complex coefficients, shape (..., components) to (...).
    """
    total = np.sum(np.abs(coefficient) ** 2, axis=-1)
    # an undamped resonance has infinite coefficients and an infinite amplitude
    finite = np.where(np.isfinite(total)[..., None], coefficient, 0.0)
    alternating = np.abs(np.sum(finite**2, axis=-1))
    return np.asarray(np.sqrt(0.5 * (total + alternating)))
