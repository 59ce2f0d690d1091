"""Norms of rows and their duals: the inequalities that every proof of this project stands on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from laufruhe.numerics.norms import NORMS, Grid, Norm, lengths

every_norm = pytest.mark.parametrize("norm", NORMS.values(), ids=str)
ROUNDING = 1e-12
FINITE = st.floats(-1e3, 1e3, allow_subnormal=False)


@st.composite
def rows(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights, V and Z of one shape; zero rows and zero weights occur."""
    count, width = draw(st.integers(1, 5)), draw(st.integers(1, 3))
    weights = draw(arrays(float, count, elements=st.one_of(st.just(0.0), st.floats(1e-3, 10.0))))
    keep = draw(arrays(bool, count))[:, None]
    v, z = (draw(arrays(float, (count, width), elements=FINITE)) for _ in range(2))
    return weights, v * keep, z


def naive(norm: Norm, weights: np.ndarray, v: np.ndarray) -> float:
    size = [math.hypot(*row) for row in v]
    if norm is NORMS["maximum"]:
        return max(size)
    powers = {NORMS["mean"]: 1, NORMS["rms"]: 2}
    total = sum(w * s ** powers[norm] for w, s in zip(weights, size, strict=True))
    return total ** (1 / powers[norm])


@every_norm
class TestEveryNorm:
    @given(rows())
    def test_value_is_the_definition(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        weights, v, _ = data
        assert norm.value(Grid(weights, 1), v) == pytest.approx(naive(norm, weights, v), rel=ROUNDING)

    @given(rows())
    def test_dual_inequality(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """<Z, V> <= dual(Z) norm(V) for every Z and V (P3)."""
        weights, v, z = data
        dual = norm.dual_norm(Grid(weights, 1), z)
        if math.isfinite(dual):
            slack = ROUNDING * (1.0 + float(np.abs(z * v).sum()))
            assert float((z * v).sum()) <= dual * norm.value(Grid(weights, 1), v) + slack

    @given(rows())
    def test_dual_norm_is_attained(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """It is the smallest such factor: some V reaches it."""
        weights, _, z = data
        weights = weights + 0.1
        size = lengths(z)
        if norm is NORMS["mean"]:
            v = z * (np.arange(len(z)) == np.argmax(size / weights))[:, None]
        elif norm is NORMS["maximum"]:
            v = z / np.where(size > 0.0, size, 1.0)[:, None]
        else:
            v = z / weights[:, None]
        dual = norm.dual_norm(Grid(weights, 1), z)
        assert float((z * v).sum()) == pytest.approx(dual * norm.value(Grid(weights, 1), v), rel=ROUNDING)

    @given(rows())
    def test_subgradient_attains_the_norm(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """<Z, V> = norm(V) with dual(Z) at most one (P2)."""
        weights, v, _ = data
        z = norm.subgradient(Grid(weights, 1), v)
        whole = norm.value(Grid(weights, 1), v)
        assert float((z * v).sum()) == pytest.approx(whole, rel=ROUNDING, abs=1e-300)
        assert norm.dual_norm(Grid(weights, 1), z) <= 1.0 + ROUNDING
        assert not z[lengths(v) == 0.0].any()

    @given(rows())
    def test_subgradient_lies_below_the_norm(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """norm(W) >= norm(V) + <Z, W - V> for any W."""
        weights, v, w = data
        z = norm.subgradient(Grid(weights, 1), v)
        slack = ROUNDING * (1.0 + float(np.abs(z * w).sum() + np.abs(z * v).sum()))
        assert norm.value(Grid(weights, 1), w) >= norm.value(Grid(weights, 1), v) + float((z * (w - v)).sum()) - slack

    @given(rows(), st.floats(1e-3, 1e3))
    def test_dual_feasible_is_feasible(self, norm: Norm, data: tuple[np.ndarray, ...], scale: float) -> None:
        """Whatever is proposed, what comes out is in the unit ball; what is in it already is left alone."""
        weights, _, z = data
        inside = norm.dual_feasible(Grid(weights, 1), scale * z)
        assert norm.dual_norm(Grid(weights, 1), inside) <= 1.0 + ROUNDING
        assert norm.dual_norm(Grid(weights, 1), norm.dual_feasible(Grid(weights, 1), 1.5 * inside)) <= 1.0 + ROUNDING
        again = norm.dual_feasible(Grid(weights, 1), 0.9 * inside)
        assert np.array_equal(again, 0.9 * inside)

    @given(rows())
    def test_dual_feasible_keeps_directions(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """Rows are shortened, never turned."""
        weights, _, z = data
        inside = norm.dual_feasible(Grid(weights, 1), z)
        assert (lengths(inside) <= lengths(z) * (1.0 + ROUNDING)).all()
        along = (inside * z).sum(axis=1)
        np.testing.assert_allclose(along, lengths(inside) * lengths(z), rtol=ROUNDING, atol=1e-300)

    @pytest.mark.parametrize("size", [1e-200, 1e-160, 1.0, 1e160, 1e200])
    def test_far_from_one(self, norm: Norm, size: float) -> None:
        """Squares would overflow or vanish; norms and duals scale as they should."""
        weights = np.array([0.2, 0.3, 0.5])
        v = np.array([[3.0, 4.0], [0.0, 0.0], [-1.0, 2.0]])
        scaled = size * v
        assert lengths(scaled) == pytest.approx(size * lengths(v), rel=ROUNDING, abs=0.0)
        assert norm.value(Grid(weights, 1), scaled) == pytest.approx(
            size * norm.value(Grid(weights, 1), v), rel=ROUNDING, abs=0.0
        )
        assert norm.dual_norm(Grid(weights, 1), scaled) == pytest.approx(
            size * norm.dual_norm(Grid(weights, 1), v), rel=ROUNDING, abs=0.0
        )
        z = norm.subgradient(Grid(weights, 1), scaled)
        np.testing.assert_allclose(z, norm.subgradient(Grid(weights, 1), v), rtol=ROUNDING, atol=0.0)
        inside = norm.dual_feasible(Grid(weights, 1), scaled)
        assert norm.dual_norm(Grid(weights, 1), inside) == pytest.approx(
            min(1.0, size * norm.dual_norm(Grid(weights, 1), v)), rel=ROUNDING, abs=0.0
        )

    def test_sizes_side_by_side(self, norm: Norm) -> None:
        """A row of 1e200 beside one of 1e-200 hides it and breaks nothing."""
        weights = np.array([0.5, 0.5])
        v = np.array([[1e200, 0.0], [0.0, 1e-200]])
        expected = {NORMS["mean"]: 0.5e200, NORMS["maximum"]: 1e200, NORMS["rms"]: math.sqrt(0.5) * 1e200}[norm]
        assert norm.value(Grid(weights, 1), v) == pytest.approx(expected, rel=ROUNDING)
        assert lengths(v).tolist() == [1e200, 1e-200]

    def test_no_rows_at_all(self, norm: Norm) -> None:
        """An engine without rotors has the mass zero."""
        empty, none = np.zeros((0, 2)), np.zeros(0)
        assert norm.value(Grid(none, 1), empty) == 0.0
        assert norm.dual_norm(Grid(none, 1), empty) == 0.0
        assert norm.subgradient(Grid(none, 1), empty).shape == (0, 2)
        assert norm.dual_feasible(Grid(none, 1), empty).shape == (0, 2)


class TestWeightless:
    @pytest.mark.parametrize("norm", [NORMS["mean"], NORMS["rms"]])
    def test_a_row_without_weight_bounds_nothing(self, norm: Norm) -> None:
        """No multiple of the norm bounds a row that it does not count."""
        weights, z = np.array([1.0, 0.0]), np.array([[1.0], [1.0]])
        assert norm.dual_norm(Grid(weights, 1), z) == math.inf
        assert not norm.dual_feasible(Grid(weights, 1), z)[1].any()

    def test_a_maximum_has_no_weights(self) -> None:
        assert NORMS["maximum"].dual_norm(Grid(np.zeros(2), 1), np.array([[3.0], [4.0]])) == 7.0
