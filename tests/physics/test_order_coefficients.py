"""Order coefficients of the slider-crank against arithmetic of many digits, FFT, and the series of textbooks."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import ClassVar

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.errors import ModelError
from laufruhe.machine import kinematics as slider_crank
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.order_coefficients import (
    inertia_roll_orders,
    orders_needed,
    piston_acceleration_orders,
    rod_roll_orders,
)

HIGHEST = 12
RELATIVE = 1e-14
Kernel = Callable[[mp.mpf, mp.mpf, mp.mpf, mp.mpf], mp.mpf]

# lambda = r/l and epsilon = e/l; the crank turns while lambda + |epsilon| < 1
CENTRAL = [1e-9, 1e-6, 1e-3, 0.1, 0.26, 0.5, 0.9, 0.99, 0.999]
OFFSET = [
    (1e-9, 1e-9),
    (1e-9, 0.5),
    (1e-6, 0.998999),
    (1e-3, 0.998),
    (0.26, 1e-12),
    (0.26, 0.03),
    (0.26, -0.03),
    (0.26, 0.739),
    (0.5, 0.499),
    (0.5, -0.499),
    (0.9, 0.05),
    (0.9, -0.099),
    (0.98, 0.019),
    (0.998, 1e-9),
    (0.998, -1e-9),
    (0.998977, -3e-6),
]


def _root(sine: mp.mpf) -> mp.mpf:
    return mp.sqrt((1 - sine) * (1 + sine))


def acceleration(c: mp.mpf, s: mp.mpf, lam: mp.mpf, eps: mp.mpf) -> mp.mpf:
    """Return s''/r at c = cos alpha, s = sin alpha from c + sqrt(1 - u^2) / lambda, u = sin psi = lambda s - eps."""
    u, slope = lam * s - eps, lam * c
    root = _root(u)
    return -c - ((slope**2 - u * lam * s) / root + (u * slope) ** 2 / root**3) / lam


def velocity(c: mp.mpf, s: mp.mpf, lam: mp.mpf, eps: mp.mpf) -> mp.mpf:
    """Return s'/r."""
    u = lam * s - eps
    return -s - u * c / _root(u)


def inertia_roll(c: mp.mpf, s: mp.mpf, lam: mp.mpf, eps: mp.mpf) -> mp.mpf:
    """Return -s''/r (s'/r + e/r), the roll moment of a reciprocating mass on a forward crank."""
    return -acceleration(c, s, lam, eps) * (velocity(c, s, lam, eps) + eps / lam)


def rod_roll(c: mp.mpf, s: mp.mpf, lam: mp.mpf, eps: mp.mpf) -> mp.mpf:
    """Return -psi'' (1 + psi'), the roll moment of a rod's inertia deficit on a forward crank."""
    u = lam * s - eps
    rate = lam * c / _root(u)
    return -(rate**2 * u - lam * s) / _root(u) * (1 + rate)


@lru_cache(maxsize=64)
def _reference(kernel: Kernel, rod_ratio: float, offset_ratio: float) -> tuple[mp.mpc, ...]:
    """Return the coefficients 0 ... 12 of a kernel, to 50 digits of the smallest that the geometry allows.

    The trapezoidal rule on equal steps is exact but for orders folded back, which fall as q^steps with q the modulus
    of the pole nearest to the unit circle; steps and digits follow from q.
    """
    lam, eps = mp.mpf(rod_ratio), mp.mpf(offset_ratio)
    nearest = max(lam / (1 - eps), lam / (1 + eps))
    decay = -mp.log10(nearest / (1 + _root(nearest)))
    digits = 60 + int(2 * HIGHEST * decay)
    steps = 2 * (HIGHEST + 2 + math.ceil(digits / decay / 2))
    with mp.workdps(digits + 20):
        waves = [mp.expjpi(mp.mpf(2 * j) / steps) for j in range(steps)]
        values = [kernel(w.real, w.imag, lam, eps) for w in waves]
        sums = [mp.fsum(f * mp.conj(waves[h * j % steps]) for j, f in enumerate(values)) for h in range(HIGHEST + 1)]
        return tuple((1 if h == 0 else 2) * total / steps for h, total in enumerate(sums))


def _error(computed: complex, exact: mp.mpc) -> float:
    return float(abs(mp.mpc(complex(computed)) - exact))


class TestAgainstManyDigits:
    @pytest.mark.parametrize("rod_ratio", CENTRAL)
    def test_central(self, rod_ratio: float) -> None:
        """Without an offset: order 1 and the even orders, each to 1e-14 of itself, the others exactly zero."""
        exact = _reference(acceleration, rod_ratio, 0.0)
        computed = piston_acceleration_orders(rod_ratio, 0.0, HIGHEST)
        assert computed[1] == -1.0
        for h in (2, 4, 6, 8, 10, 12):
            assert _error(computed[h], exact[h]) <= RELATIVE * abs(exact[h]), f"order {h}"
        assert not computed[[0, 3, 5, 7, 9, 11]].any()

    @pytest.mark.parametrize(("rod_ratio", "offset_ratio"), OFFSET)
    def test_offset(self, rod_ratio: float, offset_ratio: float) -> None:
        """Check every order with a pin offset to 1e-14 of itself, also orders of 1e-90 of the largest."""
        exact = _reference(acceleration, rod_ratio, offset_ratio)
        computed = piston_acceleration_orders(rod_ratio, offset_ratio, HIGHEST)
        assert computed[0] == 0.0
        for h in range(1, HIGHEST + 1):
            assert _error(computed[h], exact[h]) <= RELATIVE * abs(exact[h]), f"order {h}"

    def test_vanishing_offset(self) -> None:
        """Check that odd orders are linear in offsets down to the smallest floats, and even ones constant."""
        tiny, small = (piston_acceleration_orders(0.26, offset_ratio, HIGHEST) for offset_ratio in (1e-300, 1e-12))
        for h in range(3, HIGHEST, 2):
            assert tiny[h].imag / 1e-300 == pytest.approx(small[h].imag / 1e-12, rel=RELATIVE)
        assert tiny[2::2] == pytest.approx(small[2::2], rel=RELATIVE)

    @pytest.mark.parametrize(("kernel", "orders"), [(inertia_roll, inertia_roll_orders), (rod_roll, rod_roll_orders)])
    @pytest.mark.parametrize(
        ("rod_ratio", "offset_ratio"), [(0.26, 0.0), (0.26, 0.03), (0.5, -0.499), (0.9, 0.05), (0.99, 0.0)]
    )
    def test_roll_moments(
        self,
        kernel: Kernel,
        orders: Callable[[float, float, float, int], np.ndarray],
        rod_ratio: float,
        offset_ratio: float,
    ) -> None:
        """Products of series: each order is a sum of terms as large as the largest, so it is exact to that."""
        exact = _reference(kernel, rod_ratio, offset_ratio)
        computed = orders(rod_ratio, offset_ratio, 1.0, HIGHEST)
        largest = max(map(abs, exact))
        for h in range(HIGHEST + 1):
            assert _error(computed[h], exact[h]) <= RELATIVE * largest, f"order {h}"

    def test_scotch_yoke(self) -> None:
        """lambda = 0: simple harmonic motion."""
        assert piston_acceleration_orders(0.0, 0.0, 6).tolist() == [0, -1, 0, 0, 0, 0, 0]

    def test_cranks_that_all_but_lock_are_refused(self) -> None:
        with pytest.raises(ModelError, match="too close to 1"):
            orders_needed(1.0 - 1e-9)


class TestAgainstTextbookSeries:
    """A_2, A_4, A_6 of s'' = -r w^2 (cos a + A_2 cos 2a + A_4 cos 4a + ...), as in books on engine dynamics."""

    PRINTED: ClassVar = {
        2: {1: Fraction(1), 3: Fraction(1, 4), 5: Fraction(15, 128)},
        4: {3: Fraction(-1, 4), 5: Fraction(-3, 16)},
        6: {5: Fraction(9, 128)},
    }

    @staticmethod
    def coefficient(order: int, power: int) -> Fraction:
        """Return the factor of lambda^power in A_order from the binomial series of sqrt(1 - lambda^2 sin^2 a)."""
        n, half = (power + 1) // 2, order // 2
        if n < half:
            return Fraction(0)
        binomial = Fraction(1)
        for k in range(n):
            binomial *= (Fraction(1, 2) - k) / Fraction(k + 1)
        cosine = Fraction(2 * math.comb(2 * n, n - half), 4**n)
        return binomial * cosine * order**2 * (-1 if (n + half) % 2 else 1)

    @pytest.mark.parametrize("order", [2, 4, 6])
    def test_printed_terms(self, order: int) -> None:
        """A_2 = lambda + lambda^3/4 + 15 lambda^5/128, A_4 = -(lambda^3/4 + 3 lambda^5/16), A_6 = 9 lambda^5/128."""
        for power in (1, 3, 5):
            assert self.coefficient(order, power) == self.PRINTED[order].get(power, 0)

    @pytest.mark.parametrize("order", [2, 4, 6, 8, 10, 12])
    @pytest.mark.parametrize("rod_ratio", [0.05, 0.25, 0.5])
    def test_whole_series(self, order: int, rod_ratio: float) -> None:
        """Summed until nothing is added at 16 digits: lambda^121 at most, all terms of one sign."""
        lam = Fraction(rod_ratio)
        series = sum(self.coefficient(order, power) * lam**power for power in range(1, 122, 2))
        computed = piston_acceleration_orders(rod_ratio, 0.0, order)[order]
        assert computed.imag == 0.0
        assert -computed.real == pytest.approx(float(series), rel=RELATIVE)

    @pytest.mark.parametrize("rod_ratio", [0.2, 0.25, 0.3])
    def test_omitted_terms_of_the_textbook_exceed_the_tolerance(self, rod_ratio: float) -> None:
        """The textbook's A_2 = lambda alone is wrong by lambda^2 / 4, and no tolerance here would let it pass."""
        second = piston_acceleration_orders(rod_ratio, 0.0, 2)[2]
        assert abs(second + rod_ratio) > 1e10 * RELATIVE * rod_ratio
        assert abs(second + rod_ratio + rod_ratio**3 / 4) > 1e9 * RELATIVE * rod_ratio


class TestAgainstFFT:
    @pytest.mark.parametrize(
        ("rod_ratio", "offset_ratio"), [(0.05, 0.0), (0.26, 0.0), (0.26, 0.05), (0.6, -0.2), (0.9, 0.0)]
    )
    def test_exact_kernel(self, rod_ratio: float, offset_ratio: float) -> None:
        """4096 steps, orders to 40, 1e-13 of the largest value: rounding of the samples, amplified by 1/cos^3 psi."""
        alpha = math.tau * np.arange(4096) / 4096
        samples = slider_crank.piston_acceleration(np, alpha, rod_ratio, offset_ratio)
        transformed = spectrum_of(samples, Fraction(1)).coefficients
        computed = piston_acceleration_orders(rod_ratio, offset_ratio, 40)
        np.testing.assert_allclose(computed, transformed[:41], rtol=0.0, atol=1e-13 * np.abs(samples).max())

    def test_offset_and_higher_orders_are_not_left_out(self) -> None:
        """An offset of a tenth of the throw, and the orders from 3 on, each move the coefficients by over 1e-3."""
        rod_ratio, offset_ratio = 0.26, 0.026
        full, central = (piston_acceleration_orders(rod_ratio, offset, 8) for offset in (offset_ratio, 0.0))
        assert np.abs(full - central).max() > 1e-3
        assert abs(full[1].imag) > 1e-4
        assert abs(full[3]) > 1e-3
        assert abs(full[4]) > 1e-3
        assert abs(full[1] + 1.0) > 1e-4


@st.composite
def turning_cranks(draw: st.DrawFn) -> tuple[float, float]:
    """Return lambda and epsilon with lambda + |epsilon| <= 0.97."""
    rod_ratio = draw(st.floats(1e-3, 0.95))
    return rod_ratio, draw(st.floats(-1.0, 1.0)) * (0.97 - rod_ratio)


class TestProperties:
    @given(crank=turning_cranks(), angle=st.floats(0.0, math.tau))
    def test_series_is_the_kernel(self, crank: tuple[float, float], angle: float) -> None:
        """Re sum c_h e^{i h alpha} = s''/r at any angle."""
        coefficients = piston_acceleration_orders(*crank)
        kernel = float(slider_crank.piston_acceleration(np, angle, *crank))
        summed = Spectrum(Fraction(1), coefficients).values(np.array([angle]))[0]
        # orders up to h feel a rounding of the angle h-fold; s'' near locking its 1/cos^3 psi
        size = float(np.abs(coefficients * np.arange(1, len(coefficients) + 1)).sum())
        assert summed == pytest.approx(kernel, abs=1e-14 * size)

    @given(crank=turning_cranks())
    def test_reflection(self, crank: tuple[float, float]) -> None:
        """An offset to the other side is the same crank turned backwards: conjugate coefficients."""
        rod_ratio, offset_ratio = crank
        forward = piston_acceleration_orders(rod_ratio, offset_ratio, 20)
        backward = piston_acceleration_orders(rod_ratio, -offset_ratio, 20)
        np.testing.assert_allclose(backward, forward.conj(), rtol=1e-13, atol=0.0)

    @given(crank=turning_cranks())
    def test_parity(self, crank: tuple[float, float]) -> None:
        """cos psi depends on sin alpha alone: even orders are real, odd ones imaginary but for the -1 of the throw."""
        coefficients = piston_acceleration_orders(*crank, 20)
        assert not coefficients[::2].imag.any()
        assert coefficients[1].real == -1.0
        assert not coefficients[3::2].real.any()

    @given(crank=turning_cranks())
    def test_part_and_whole(self, crank: tuple[float, float]) -> None:
        """Check that few orders equal the first of many, with a remainder below rounding."""
        whole = piston_acceleration_orders(*crank)
        part = piston_acceleration_orders(*crank, 6)
        count = min(len(whole), len(part))
        np.testing.assert_allclose(part[:count], whole[:count], rtol=1e-13, atol=0.0)
        longer = piston_acceleration_orders(*crank, 2 * len(whole))
        assert np.abs(longer[len(whole) :]).sum() <= 1e-14 * np.abs(whole).sum()

    @given(rod_ratio=st.floats(0.05, 0.95), share=st.floats(0.05, 1.0), sign=st.sampled_from([-1.0, 1.0]))
    def test_leaving_offset_or_higher_orders_out_shows(self, rod_ratio: float, share: float, sign: float) -> None:
        """Check that the comparison of the series fails without the offset or above order 2."""
        offset_ratio = sign * share * (0.97 - rod_ratio)
        alpha = np.linspace(0.0, math.tau, 73)
        kernel = slider_crank.piston_acceleration(np, alpha, rod_ratio, offset_ratio)
        whole = piston_acceleration_orders(rod_ratio, offset_ratio)
        central = piston_acceleration_orders(rod_ratio, 0.0)
        for wrong in (whole[:3], central):
            assert np.abs(Spectrum(Fraction(1), wrong).values(alpha) - kernel).max() > 1e-6
        tolerance = 1e-14 * float(np.abs(whole * np.arange(1, len(whole) + 1)).sum())
        assert np.abs(Spectrum(Fraction(1), whole).values(alpha) - kernel).max() < min(1e-6, 10 * tolerance)
