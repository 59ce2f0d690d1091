"""Angles as exact parts of a turn: symmetric to the last bit, and right."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.numerics.exact_angles import MAX_DENOMINATOR, angle_of, as_turn, cancelling_sums, cis, phasors, star_sum

EPS = float(np.finfo(float).eps)
PARTS = st.builds(Fraction, st.integers(-60_000, 60_000), st.integers(1, MAX_DENOMINATOR))
ANGLES = st.floats(-100.0, 100.0)


def _bits(z: complex) -> tuple[float, float]:
    # minus zero equals zero: a mirrored zero is still zero
    return z.real + 0.0, z.imag + 0.0


class TestCis:
    @given(PARTS)
    def test_every_symmetry_of_the_circle(self, turn: Fraction) -> None:
        """Turns by quarters, mirror images in axes and diagonals, and whole turns are the same to the last bit."""
        z = cis(turn)
        assert _bits(cis(-turn)) == _bits(z.conjugate())
        assert _bits(cis(turn + Fraction(1, 4))) == _bits(complex(-z.imag, z.real))
        assert _bits(cis(turn + Fraction(1, 2))) == _bits(-z)
        assert _bits(cis(Fraction(1, 4) - turn)) == _bits(complex(z.imag, z.real))
        assert _bits(cis(turn + 3)) == _bits(z)

    @given(st.one_of(PARTS, st.floats(-3.0, 3.0)))
    def test_agrees_with_many_digits(self, turn: Fraction | float) -> None:
        """Check exact parts to a rounding of the angle, floats to a rounding of 2 pi times it."""
        with mp.workdps(40):
            exact_turn = mp.mpf(turn.numerator) / turn.denominator if isinstance(turn, Fraction) else mp.mpf(turn)
            error = float(abs(mp.mpc(cis(turn)) - mp.expjpi(2 * exact_turn)))
        size = 1.0 if isinstance(turn, Fraction) else 1.0 + math.tau * abs(turn)
        assert error <= EPS * size

    @pytest.mark.parametrize(
        ("turn", "value"),
        [
            (Fraction(0), 1 + 0j),
            (Fraction(1, 4), 1j),
            (Fraction(1, 2), -1 + 0j),
            (Fraction(3, 4), -1j),
            (Fraction(1, 6), complex(0.5, math.sqrt(3) / 2)),
            (Fraction(1, 12), complex(math.sqrt(3) / 2, 0.5)),
            (Fraction(1, 8), complex(math.sqrt(0.5), math.sqrt(0.5))),
        ],
    )
    def test_known_values(self, turn: Fraction, value: complex) -> None:
        assert _bits(cis(turn)) == _bits(value)

    def test_an_equal_float_changes_no_fraction(self) -> None:
        cis.cache_clear()
        cis(0.125)
        assert _bits(cis(Fraction(1, 8))) == _bits(complex(math.sqrt(0.5), math.sqrt(0.5)))


class TestAsTurn:
    @given(PARTS)
    def test_a_rounded_fraction_is_taken_for_it(self, turn: Fraction) -> None:
        """Radians of any part of a turn with a denominator in range find back to it."""
        assert as_turn(math.tau * float(turn)) == turn
        assert as_turn(angle_of(turn)) == turn

    @pytest.mark.parametrize("degrees", [0, 1, 45, 60, 72, 90, 102.857142857142857, 120, 137.5, 0.1, 719.9, -240])
    def test_degrees_are_exact(self, degrees: float) -> None:
        turn = as_turn(math.radians(degrees))
        assert isinstance(turn, Fraction)
        assert float(turn) == pytest.approx(degrees / 360, abs=1e-14)

    @given(ANGLES)
    def test_moves_no_angle_by_more_than_roundings(self, angle: float) -> None:
        moved = abs(angle_of(as_turn(angle)) - angle)
        assert moved <= 8 * EPS * max(abs(angle), math.tau)

    @pytest.mark.parametrize("angle", [1.0, math.sqrt(2.0), math.radians(120) + 1e-9, 1e-7])
    def test_other_angles_stay(self, angle: float) -> None:
        """A nanoradian beside a fraction is not that fraction."""
        turn = as_turn(angle)
        assert isinstance(turn, float)
        assert turn == angle / math.tau


class TestStarSum:
    @pytest.mark.parametrize("count", [*range(2, 14), 24, 48])
    def test_even_stars(self, count: int) -> None:
        """Check zeros for multiples that are no whole number of turns apart, and the count for the others."""
        turns = [Fraction(k, count) for k in range(count)]
        multiples = np.arange(4 * count + 1)
        sums = star_sum(np.ones((count, 1)), turns, multiples)[:, 0]
        whole = multiples % count == 0
        assert (sums[whole] == count).all()
        assert (sums[~whole] == 0.0).all()

    @given(
        st.lists(st.tuples(st.one_of(PARTS, st.floats(-2.0, 2.0)), st.floats(-10.0, 10.0)), min_size=1, max_size=9),
        st.integers(-40, 40),
    )
    def test_agrees_with_many_digits(self, members: list[tuple[Fraction | float, float]], multiple: int) -> None:
        turns, weights = [m[0] for m in members], np.array([[m[1]] for m in members])
        result = star_sum(weights, turns, np.array([multiple]))[0, 0]
        with mp.workdps(40):
            exact = mp.fsum(
                mp.mpf(w)
                * mp.expjpi(
                    2 * multiple * (mp.mpf(t.numerator) / t.denominator if isinstance(t, Fraction) else mp.mpf(t))
                )
                for t, w in members
            )
            error = float(abs(mp.mpc(complex(result)) - exact))
        rounding = (len(members) + 4) + 20 * abs(multiple)
        assert error <= rounding * EPS * float(np.abs(weights).sum())

    def test_remainders_above_rounding_stay(self) -> None:
        """A remainder of a hundred roundings is a load, not a zero."""
        weights = np.array([[1.0], [1.0 + 100 * EPS]])
        result = star_sum(weights, [Fraction(0), Fraction(1, 2)], np.array([1]))[0, 0]
        assert result.real == pytest.approx(-100 * EPS, rel=1e-3, abs=0.0)

    def test_each_column_has_a_rounding_of_its_own(self) -> None:
        """A small column beside a large one is not flushed with it."""
        weights = np.array([[1e9, 1e-9], [-1e9, 1e-9]])
        result = star_sum(weights, [Fraction(0), Fraction(0)], np.array([0]))[0]
        assert result.tolist() == [0.0, 2e-9]

    @pytest.mark.slow
    @given(st.lists(PARTS, min_size=1, max_size=6), st.integers(-10_000, 10_000))
    def test_phasors_of_exact_turns_are_table_values(self, turns: list[Fraction], multiple: int) -> None:
        """A multiple of an exact angle is exact as well, however large."""
        result = phasors(turns, np.array([multiple]))[0]
        assert [_bits(z) for z in result] == [_bits(cis(multiple * t % 1)) for t in turns]

    def test_large_denominators_do_without_a_table(self) -> None:
        turn = Fraction(1, 10**7)
        assert abs(phasors([turn], np.array([3]))[0, 0] - cis(3 * turn)) < 4 * EPS


class TestCancellingSums:
    def test_zero_where_terms_cancel(self) -> None:
        terms = np.array([[0.1 + 1j], [0.2 + 1j], [-0.3 + 1j]])
        assert terms.sum(axis=0)[0].real != 0.0
        assert cancelling_sums(terms, (0, 0, 0))[0, 0] == 3j

    @given(st.lists(st.complex_numbers(max_magnitude=1e3), min_size=1, max_size=8))
    def test_a_plain_sum_otherwise(self, terms: list[complex]) -> None:
        result = cancelling_sums(np.array(terms)[:, None], (0,) * len(terms))[0, 0]
        size = sum(abs(t.real) + abs(t.imag) for t in terms)
        assert abs(complex(result) - sum(terms)) <= 4 * len(terms) * EPS * size

    def test_each_index_has_its_own(self) -> None:
        terms = np.array([[1.0, 2j], [0.5, 0.0], [-1.0, 1j], [0.25, 0.0]], dtype=complex)
        assert np.array_equal(cancelling_sums(terms, (2, 0, 2, 0)), [[0.75, 0.0], [0.0, 0.0], [0.0, 3j]])
