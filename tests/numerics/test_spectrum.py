"""Spectra: one signal, however its coefficients are counted, sampled or added."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from laufruhe.numerics.spectrum import (
    JUMP_OFFSET,
    Spectrum,
    common_base,
    orders_equal,
    spectrum_of,
    spectrum_with_kinks,
)

BASES = st.sampled_from([Fraction(1), Fraction(1, 2), Fraction(2), Fraction(3, 2), Fraction(1, 3)])
NUMBERS = st.complex_numbers(max_magnitude=10.0, allow_subnormal=False)


@st.composite
def spectra(draw: st.DrawFn, highest: int = 9) -> Spectrum:
    coefficients = draw(st.lists(st.lists(NUMBERS, min_size=2, max_size=2), min_size=1, max_size=highest + 1))
    array = np.array(coefficients)
    # the mean of a real signal is real
    array[0] = array[0].real
    return Spectrum(draw(BASES), array)


def direct(spectrum: Spectrum, angles: np.ndarray) -> np.ndarray:
    """Return the sum of definition C8, order by order."""
    total = np.zeros((len(angles), *spectrum.coefficients.shape[1:]))
    for j, c in enumerate(spectrum.coefficients):
        waves = j * float(spectrum.base) * angles
        total += np.cos(waves)[:, None] * c.real - np.sin(waves)[:, None] * c.imag
    return total


def period(spectrum: Spectrum, samples: int) -> np.ndarray:
    return math.tau / float(spectrum.base) * np.arange(samples) / samples


ANGLES = np.array([-7.3, -1.0, 0.0, 0.4, 2.0, 11.9])


class TestOneSignal:
    @given(spectra())
    def test_values_are_the_definition(self, s: Spectrum) -> None:
        np.testing.assert_allclose(s.values(ANGLES), direct(s, ANGLES), atol=1e-11)

    @given(spectra(), st.integers(1, 40))
    def test_samples_are_values_even_with_orders_above_half(self, s: Spectrum, samples: int) -> None:
        """Few samples fold high orders; each sample is still the whole series at its angle."""
        np.testing.assert_allclose(s.sample(samples), direct(s, period(s, samples)), atol=1e-11)

    def test_folding_is_not_dropping(self) -> None:
        """An order of the number of samples looks like a mean, and stays."""
        s = Spectrum(Fraction(1), np.array([[0.0], [0.0], [0.0], [0.0], [5.0]], dtype=complex))
        assert s.sample(4)[:, 0] == pytest.approx(5.0)

    @given(spectra(), st.integers(1, 4))
    def test_counting_in_a_finer_order(self, s: Spectrum, factor: int) -> None:
        finer = s.with_finer_base(s.base / factor)
        assert finer.base * factor == s.base
        np.testing.assert_allclose(finer.values(ANGLES), s.values(ANGLES), atol=1e-11)
        assert finer.coefficients[::factor].tolist() == s.coefficients.tolist()

    def test_a_coarser_order_is_refused(self) -> None:
        s = Spectrum(Fraction(1, 2), np.ones((3, 1), dtype=complex))
        with pytest.raises(ValueError, match="1 does not divide 1/2"):
            s.with_finer_base(Fraction(1))

    @given(spectra(), st.integers(1, 4))
    def test_over_its_own_period_it_is_the_same_signal(self, s: Spectrum, factor: int) -> None:
        """A signal counted too finely comes back to its own period, to the last bit."""
        fine = s.with_finer_base(s.base / factor)
        reduced = fine.with_base(fine.repeat_order())
        np.testing.assert_allclose(reduced.values(ANGLES), s.values(ANGLES), atol=1e-11)
        used = [j for j, c in enumerate(reduced.coefficients) if j and c.any()]
        assert math.gcd(*used) == 1 if used else reduced.base == 1

    def test_its_period_keeps_room_for_other_orders(self) -> None:
        """The period of second orders is half a turn, unless it has to hold a 3/2."""
        c = np.zeros((9, 1), dtype=complex)
        c[[0, 4, 8]] = [[1.0], [2.0], [3.0]]
        s = Spectrum(Fraction(1, 2), c)
        assert s.repeat_order() == 2
        assert s.repeat_order((Fraction(3, 2), Fraction(0))) == Fraction(1, 2)
        assert s.with_base(s.repeat_order()).at(4) == 3.0

    @given(spectra(), spectra())
    def test_addition(self, a: Spectrum, b: Spectrum) -> None:
        total = a + b
        np.testing.assert_allclose(total.values(ANGLES), a.values(ANGLES) + b.values(ANGLES), atol=1e-11)
        assert (a.base / total.base).denominator == (b.base / total.base).denominator == 1
        assert np.array_equal((b + a).coefficients, total.coefficients)

    @given(spectra(), spectra())
    def test_addition_leaves_its_parts_alone(self, a: Spectrum, b: Spectrum) -> None:
        before = a.coefficients.copy(), b.coefficients.copy()
        assert (a + b).base <= a.base
        assert np.array_equal(a.coefficients, before[0])
        assert np.array_equal(b.coefficients, before[1])


class TestOrders:
    @given(spectra())
    def test_at(self, s: Spectrum) -> None:
        """Check that an order is found by its number, and that orders between, below and above are zero."""
        for order, c in zip(s.orders, s.coefficients, strict=True):
            assert (s.at(float(order)) == c).all()
        assert (s.at(float(s.base) / 2) == 0.0).all()
        assert (s.at(-float(s.base)) == 0.0).all()
        assert (s.at(float(len(s.coefficients) * s.base)) == 0.0).all()
        assert s.at(0.123).shape == (2,)

    @pytest.mark.parametrize("highest", [0.0, 0.4, 0.5, 2.0, 2.49, 100.0])
    def test_kept(self, highest: float) -> None:
        s = Spectrum(Fraction(1, 2), np.arange(1, 12, dtype=complex)[:, None])
        truncated = s.truncated(highest)
        assert truncated.orders.tolist() == [order for order in s.orders if order <= highest]
        assert truncated.coefficients[:, 0].tolist() == list(range(1, len(truncated.orders) + 1))

    @pytest.mark.parametrize(
        ("orders", "base"),
        [
            ([Fraction(1), Fraction(2)], Fraction(1)),
            ([Fraction(2), Fraction(4), Fraction(6)], Fraction(2)),
            ([Fraction(1, 2), Fraction(2)], Fraction(1, 2)),
            ([Fraction(2, 3), Fraction(1, 2)], Fraction(1, 6)),
            ([Fraction(5)], Fraction(5)),
        ],
    )
    def test_common_base(self, orders: list[Fraction], base: Fraction) -> None:
        assert common_base(orders) == base


class TestSpectrumOf:
    @given(spectra(), st.booleans())
    def test_finds_the_coefficients_back(self, s: Spectrum, odd: bool) -> None:
        count = 2 * len(s.coefficients) + odd
        result = spectrum_of(s.sample(count), s.base)
        assert result.base == s.base
        expected = np.zeros_like(result.coefficients)
        expected[: len(s.coefficients)] = s.coefficients
        np.testing.assert_allclose(result.coefficients, expected, atol=1e-12)

    @given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=17))
    def test_goes_through_every_sample(self, samples: list[float]) -> None:
        """Check even and odd numbers of samples, one and two among them."""
        values = np.array(samples)[:, None]
        np.testing.assert_allclose(spectrum_of(values, Fraction(1, 2)).sample(len(values)), values, atol=1e-12)

    @given(spectra())
    def test_mean_and_power(self, s: Spectrum) -> None:
        """The mean is order zero; Parseval: mean square is c0^2 + half the squares of the others."""
        assume(len(s.coefficients) > 1)
        values = s.sample(4 * len(s.coefficients))
        np.testing.assert_allclose(values.mean(axis=0), s.coefficients[0].real, atol=1e-12)
        power = s.coefficients[0].real ** 2 + 0.5 * (np.abs(s.coefficients[1:]) ** 2).sum(axis=0)
        np.testing.assert_allclose((values**2).mean(axis=0), power, rtol=1e-12, atol=1e-12)


def test_orders_differ_from_a_thousandth() -> None:
    orders = [0.0, 0.5, 1.0 / 3.0, 1.0, 1.001]
    assert orders_equal(orders, (0.3333, 1.0)).tolist() == [False, False, True, True, False]
    signal = Spectrum(Fraction(1, 2), np.arange(1.0, 6.0).astype(complex))
    assert signal.with_orders((0.5, 2.0004)).coefficients.real.tolist() == [0.0, 2.0, 0.0, 0.0, 5.0]
    assert signal.at(1.5).real == 4.0
    assert signal.at(0.7) == 0.0
    assert len(signal.truncated(1.4999999).coefficients) == len(signal.truncated(1.5).coefficients) == 4


@pytest.mark.parametrize("steps", [96, 144, 1440])
def test_a_step_on_a_jump_is_read_behind_it_wherever_the_signal_was_moved(steps: int) -> None:
    """Parts of a sum that jump at one angle have to agree on the side."""
    saw = spectrum_with_kinks(lambda angles: np.mod(angles, math.tau), 720, Fraction(1), np.array([0.0]))
    assert saw.sample(steps, JUMP_OFFSET)[0] == pytest.approx(0.0, abs=1e-6)
    for moved in range(1, steps, max(steps // 48, 1)):
        share = Fraction(moved, steps)
        there = saw.shift(share, math.tau * float(share))
        assert there.sample(steps, JUMP_OFFSET) == pytest.approx(
            np.roll(saw.sample(steps, JUMP_OFFSET), moved), abs=1e-6
        )
