"""Intervals, discs and sectors: least values and nearest points against brute force."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from laufruhe.problem.decision import Decision, Domain, domains_of
from laufruhe.problem.sets import Interval, Sector

Array = NDArray[np.float64]
OFFSET = 3  # columns of others before this one


def domain(lower: float, upper: float, low: float, high: float) -> Domain:
    own = Interval(lower, upper, low) if low == high else Sector(upper, (low, high))
    return Domain(Decision("d", "kg m", own, 0j, ()), OFFSET)


INTERVALS = st.tuples(st.floats(-5.0, 5.0), st.floats(0.0, 5.0), st.floats(-7.0, 7.0)).map(
    lambda t: domain(t[0], t[0] + t[1], t[2], t[2])
)
DISCS = st.tuples(st.floats(0.0, 5.0), st.floats(-7.0, 7.0)).map(lambda t: domain(0.0, t[0], t[1], t[1] + math.tau))
SECTORS = st.tuples(st.floats(0.0, 5.0), st.floats(-7.0, 7.0), st.floats(0.05, math.pi)).map(
    lambda t: domain(0.0, t[0], t[1], t[1] + t[2])
)
DOMAINS = st.one_of(INTERVALS, DISCS, SECTORS)
FACTORS = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


def vector(d: Domain, pair: tuple[float, float]) -> Array:
    x = np.full(OFFSET + 2, 99.0)
    x[d.columns] = pair[: d.width]
    return x


def points(d: Domain) -> Array:
    """Return a fine grid over the set, corners and the arc's own points among them, shape (n, width)."""
    decision = d.decision
    if d.width == 1:
        return np.linspace(decision.lower, decision.upper, 201)[:, None]
    low, high = d.set.angles
    sizes, angles = np.linspace(0.0, decision.upper, 9), np.linspace(low, high, 4001)
    grid = (sizes[:, None] * np.exp(1j * angles)).ravel()
    return np.column_stack([grid.real, grid.imag])


class TestLeast:
    @given(DOMAINS, FACTORS)
    def test_against_a_grid(self, d: Domain, factors: tuple[float, float]) -> None:
        """No point of the grid is lower, and some come as near as the grid is fine."""
        gradient = vector(d, factors)
        brute = float((points(d) @ gradient[d.columns]).min())
        size = d.scale * float(np.abs(gradient[d.columns]).max()) * 1.5
        minimum = d.minimum(gradient)
        assert minimum <= brute + 1e-12 * size
        assert brute - minimum <= 2e-6 * size + 1e-300

    @given(DOMAINS, FACTORS)
    def test_is_attained_in_the_set(self, d: Domain, factors: tuple[float, float]) -> None:
        """The projection of a far step against the gradient is where the least value is."""
        gradient = vector(d, factors)
        if float(np.hypot.reduce(gradient[d.columns])) < 1e-3:
            return
        result = d.project(-1e9 * gradient)
        assert float(result @ gradient[d.columns]) == pytest.approx(d.minimum(gradient), abs=1e-6 * (1.0 + d.scale))


class TestProject:
    @given(DOMAINS, FACTORS)
    def test_idempotent(self, d: Domain, factors: tuple[float, float]) -> None:
        """A point of the set stays."""
        once = d.project(vector(d, tuple(5.0 * f for f in factors)))
        twice = d.project(vector(d, (*once, 0.0)))
        np.testing.assert_allclose(twice, once, rtol=0.0, atol=1e-14 * d.scale)

    @given(DOMAINS, FACTORS)
    def test_nearest(self, d: Domain, factors: tuple[float, float]) -> None:
        """In the set, and no point of a grid over it is nearer."""
        x = vector(d, tuple(3.0 * f for f in factors))
        result = d.project(x)
        distance = float(np.hypot.reduce(result - x[d.columns]))
        to_grid = np.sqrt(((points(d) - x[d.columns]) ** 2).sum(axis=1))
        assert distance <= float(to_grid.min()) + 1e-12
        assert float(np.sqrt(((points(d) - result) ** 2).sum(axis=1)).min()) <= 0.15 * d.scale
        self._assert_inside(d, result)

    @staticmethod
    def _assert_inside(d: Domain, found: Array) -> None:
        decision = d.decision
        if d.width == 1:
            assert decision.lower <= found[0] <= decision.upper
            return
        size = float(np.hypot(*found))
        assert size <= decision.upper * (1.0 + 1e-14)
        if size > 1e-9 * d.scale and not d.set.free_angle:
            low, high = d.set.angles
            behind = (cmath.phase(complex(*found)) - low) % math.tau
            assert min(behind, math.tau - behind) < 1e-6 or behind <= high - low + 1e-6

    @given(DOMAINS)
    def test_points_of_the_set_stay(self, d: Domain) -> None:
        for inside in points(d)[::997]:
            np.testing.assert_allclose(d.project(vector(d, (*inside, 0.0))), inside, atol=1e-14 * d.scale)


class TestColumns:
    @given(DOMAINS, FACTORS)
    def test_columns_and_complex_value_are_inverse(self, d: Domain, factors: tuple[float, float]) -> None:
        x = vector(d, factors)
        u = d.complex_value(x)
        np.testing.assert_allclose(d.columns_of(u), x[d.columns], atol=1e-15 * 10)
        if d.width == 1:
            assert u == pytest.approx(cmath.rect(factors[0], d.set.angles[0]))
        else:
            assert u == complex(*factors)

    def test_side_by_side(self) -> None:
        """Check one column with the angle fixed, two with it open, and none shared."""
        kinds = [domain(0.0, 1.0, 0.3, 0.3), domain(0.0, 1.0, 0.0, 1.0), domain(-1.0, 0.5, 0.0, 0.0)]
        result = domains_of(tuple(d.decision for d in kinds))
        assert [(d.start, d.width) for d in result] == [(0, 1), (1, 2), (3, 1)]
        assert [d.columns for d in result] == [slice(0, 1), slice(1, 3), slice(3, 4)]
        assert [d.scale for d in result] == [1.0, 1.0, 1.0]

    def test_a_decision_of_no_size_has_a_scale(self) -> None:
        assert domain(0.0, 0.0, 0.0, math.tau).scale == 1.0
