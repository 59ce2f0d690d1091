"""Norms of rows and their duals: the inequalities that every proof of this project stands on.

A norm is tested by being in the table: what every norm promises is checked of all of them, a definition where
it has a short one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import casadi as ca
import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from laufruhe.numerics.norms import NORMS, Cones, Grid, Norm, lengths
from laufruhe.numerics.spectrum import Spectrum
from smooth import AtItsValues, WithVariables

every_norm = pytest.mark.parametrize("norm", NORMS.values(), ids=str)
SEEDS = st.integers(0, 2**32 - 1)
PLACES = 2
FINE = 1440
ROUNDING = 1e-12
FINITE = st.floats(-1e3, 1e3, allow_subnormal=False)


@st.composite
def rows(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights, V and Z of one shape; zero rows and zero weights occur."""
    count, width = draw(st.integers(1, 5)), draw(st.integers(1, 3))
    weights = draw(arrays(float, count, elements=st.one_of(st.just(0.0), st.floats(1e-3, 10.0))))
    keep = draw(arrays(bool, count))[:, None]
    v, z = (draw(arrays(float, (count, width), elements=FINITE)) for _ in range(2))
    return weights, v * keep, z


def one_signal(weights: np.ndarray) -> Grid:
    """Return the rows that follow each other over one period."""
    return Grid(weights, len(weights))


def scene(seed: int) -> tuple[Grid, list[Spectrum], np.random.Generator]:
    """Return the signals of a few operating points at two places each, and a grid of equal steps."""
    rng = np.random.default_rng(seed)
    signals = []
    for _ in range(int(rng.integers(1, 4))):
        c = rng.standard_normal((int(rng.integers(2, 7)), PLACES, 2, 2)) @ np.array([1.0, 1.0j])
        c[0] = c[0].real
        signals.append(Spectrum(Fraction(1), c * 10.0 ** rng.uniform(-2, 2)))
    return grid_of(shares(rng, len(signals)), int(rng.integers(3, 9))), signals, rng


def shares(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return the weights of operating points, one in all."""
    weights = rng.uniform(0.1, 1.0, count)
    return np.asarray(weights / weights.sum())


def grid_of(points: np.ndarray, steps: int) -> Grid:
    """Return the rows of (points, places, steps) in that order."""
    return Grid(np.repeat(points, PLACES * steps) / (PLACES * steps), steps, points=len(points))


def sampled(signals: list[Spectrum], steps: int) -> np.ndarray:
    """Return the rows of that order."""
    return np.concatenate([s.sample(steps).swapaxes(0, 1).reshape(-1, 2) for s in signals])


def fine_value(norm: Norm, signals: list[Spectrum], points: np.ndarray) -> float:
    """Return the norm over the whole cycle, from many samples."""
    return norm.value(grid_of(points, FINE), sampled(signals, FINE))


DEFINITIONS: dict[str, Callable[[np.ndarray, list[float]], float]] = {
    "mean": lambda weights, sizes: float(weights @ sizes),
    "maximum": lambda weights, sizes: max(sizes),
    "rms": lambda weights, sizes: math.sqrt(weights @ np.square(sizes)),
    "rmq": lambda weights, sizes: float(weights @ np.square(np.square(sizes))) ** 0.25,
}
ATTAINING: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "mean": lambda weights, z: z * (np.arange(len(z)) == np.argmax(lengths(z) / weights))[:, None],
    "maximum": lambda weights, z: z / np.where(lengths(z) > 0.0, lengths(z), 1.0)[:, None],
    "rms": lambda weights, z: z / weights[:, None],
    "rmq": lambda weights, z: (
        z / (np.cbrt(np.where(lengths(z) > 0.0, lengths(z), 1.0)) ** 2 * np.cbrt(weights))[:, None]
    ),
}
"""Rows V for which <Z, V> is the dual norm of Z times the norm of V."""


def centre_of(cones: Cones, v: np.ndarray) -> np.ndarray:
    """Return the free vector at which the norm of one signal is least."""
    c, heads = cp.Variable(v.shape[1]), cp.Variable(len(cones.value))
    scaled = [factor * (row - c) for factor, row in zip(cones.factors, v, strict=True)]
    parts = [cp.hstack(scaled)] if cones.is_single else scaled
    held = [cp.norm(part) <= heads[head] for head, part in zip(cones.head, parts, strict=True)]
    cp.Problem(cp.Minimize(cones.value @ heads), held).solve(solver=cp.CLARABEL)
    return np.asarray(c.value)


@every_norm
class TestEveryNorm:
    @given(rows())
    def test_dual_inequality(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """<Z, V> <= dual(Z) norm(V) for every Z and V (P3)."""
        weights, v, z = data
        z = norm.balanced_dual(one_signal(weights), z)
        dual = norm.dual_norm(one_signal(weights), z)
        if math.isfinite(dual):
            slack = ROUNDING * (1.0 + float(np.abs(z * v).sum()))
            assert float((z * v).sum()) <= dual * norm.value(one_signal(weights), v) + slack

    @given(rows())
    def test_subgradient_attains_the_norm(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """<Z, V> = norm(V) with dual(Z) at most one (P2)."""
        weights, v, _ = data
        z = norm.subgradient(one_signal(weights), v)
        whole = norm.value(one_signal(weights), v)
        assert float((z * v).sum()) == pytest.approx(whole, rel=ROUNDING, abs=1e-300)
        assert norm.dual_norm(one_signal(weights), z) <= 1.0 + ROUNDING
        if norm.is_monotone_in_lengths:
            assert not z[lengths(v) == 0.0].any()

    @given(rows())
    def test_kinks_touch_the_norm(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """Check that each of the dual rows attains the norm to the tolerance of touching (P19)."""
        weights, v, _ = data
        grid = one_signal(weights)
        whole, z = norm.value(grid, v), norm.subgradient(grid, v)
        kinks = norm.subdifferential(grid, v, z)
        for own in () if kinks is None or whole <= 1e-200 else (kinks.base, *kinks.others):
            # zero level of a row, a length or a direction
            assert float((own * v).sum()) == pytest.approx(whole, rel=5e-3)
            assert norm.dual_norm(grid, norm.balanced_dual(grid, own)) <= 1.0 + 5e-3

    @given(rows())
    def test_subgradient_lies_below_the_norm(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """norm(W) >= norm(V) + <Z, W - V> for any W."""
        weights, v, w = data
        z = norm.subgradient(one_signal(weights), v)
        slack = ROUNDING * (1.0 + float(np.abs(z * w).sum() + np.abs(z * v).sum()))
        assert (
            norm.value(one_signal(weights), w)
            >= norm.value(one_signal(weights), v) + float((z * (w - v)).sum()) - slack
        )

    @given(rows(), st.floats(1e-3, 1e3))
    def test_dual_feasible_is_feasible(self, norm: Norm, data: tuple[np.ndarray, ...], scale: float) -> None:
        """Check that the output is in the unit ball, and equal to an input in it."""
        weights, _, z = data
        inside = norm.dual_feasible(one_signal(weights), scale * z)
        assert norm.dual_norm(one_signal(weights), inside) <= 1.0 + ROUNDING
        assert (
            norm.dual_norm(one_signal(weights), norm.dual_feasible(one_signal(weights), 1.5 * inside)) <= 1.0 + ROUNDING
        )
        again = norm.dual_feasible(one_signal(weights), 0.9 * inside)
        if norm.is_monotone_in_lengths:
            assert np.array_equal(again, 0.9 * inside)
        np.testing.assert_allclose(again, 0.9 * inside, rtol=0.0, atol=ROUNDING * (1.0 + np.abs(inside).max()))

    @given(rows())
    def test_dual_feasible_keeps_directions(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """Rows are shortened, never turned."""
        if not norm.is_monotone_in_lengths:
            return
        weights, _, z = data
        inside = norm.dual_feasible(one_signal(weights), z)
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
        assert norm.value(one_signal(weights), scaled) == pytest.approx(
            size * norm.value(one_signal(weights), v), rel=ROUNDING, abs=0.0
        )
        assert norm.dual_norm(one_signal(weights), scaled) == pytest.approx(
            size * norm.dual_norm(one_signal(weights), v), rel=ROUNDING, abs=0.0
        )
        z = norm.subgradient(one_signal(weights), scaled)
        np.testing.assert_allclose(z, norm.subgradient(one_signal(weights), v), rtol=ROUNDING, atol=0.0)
        inside = norm.dual_feasible(one_signal(weights), scaled)
        if not math.isfinite(norm.dual_norm(one_signal(weights), v)):
            return
        assert norm.dual_norm(one_signal(weights), inside) == pytest.approx(
            min(1.0, size * norm.dual_norm(one_signal(weights), v)), rel=ROUNDING, abs=0.0
        )

    def test_sizes_side_by_side(self, norm: Norm) -> None:
        """Check a row of 1e200 beside one of 1e-200."""
        grid, v = Grid(np.array([0.5, 0.5]), 2), np.array([[1e200, 0.0], [0.0, 1e-200]])
        assert norm.value(grid, v) == pytest.approx(1e200 * norm.value(grid, np.array([[1.0], [0.0]])), rel=ROUNDING)
        assert lengths(v).tolist() == [1e200, 1e-200]

    def test_no_rows_at_all(self, norm: Norm) -> None:
        """An engine without rotors has the mass zero."""
        empty, none = np.zeros((0, 2)), np.zeros(0)
        assert norm.value(Grid(none, 1), empty) == 0.0
        assert norm.dual_norm(Grid(none, 1), empty) == 0.0
        assert norm.subgradient(Grid(none, 1), empty).shape == (0, 2)
        assert norm.dual_feasible(Grid(none, 1), empty).shape == (0, 2)


@pytest.mark.parametrize("name", DEFINITIONS)
class TestDefinitions:
    @given(rows())
    def test_value_is_the_definition(self, name: str, data: tuple[np.ndarray, ...]) -> None:
        weights, v, _ = data
        expected = DEFINITIONS[name](weights, [math.hypot(*row) for row in v])
        assert NORMS[name].value(one_signal(weights), v) == pytest.approx(expected, rel=ROUNDING)

    @given(rows())
    def test_dual_norm_is_attained(self, name: str, data: tuple[np.ndarray, ...]) -> None:
        """Check that some V reaches the dual norm."""
        weights, _, z = data
        grid, norm = Grid(weights + 0.1, 1), NORMS[name]
        v = ATTAINING[name](grid.weights, z)
        dual = norm.dual_norm(grid, z)
        assert float((z * v).sum()) == pytest.approx(dual * norm.value(grid, v), rel=ROUNDING)

    def test_sizes_side_by_side(self, name: str) -> None:
        expected = {"mean": 0.5e200, "maximum": 1e200, "rms": math.sqrt(0.5) * 1e200, "rmq": 0.5**0.25 * 1e200}[name]
        v = np.array([[1e200, 0.0], [0.0, 1e-200]])
        assert NORMS[name].value(Grid(np.array([0.5, 0.5]), 1), v) == pytest.approx(expected, rel=ROUNDING)


@every_norm
class TestForms:
    """Forms of a norm in cone programs, smooth programs and batches."""

    @given(rows(), st.floats(-10.0, 10.0))
    def test_it_is_a_norm(self, norm: Norm, data: tuple[np.ndarray, ...], factor: float) -> None:
        weights, v, w = data
        grid = one_signal(weights)
        one, other = norm.value(grid, v), norm.value(grid, w)
        # a sum is rounded in its own size, of which a seminorm may see nothing
        rounded = (
            np.finfo(float).eps * (np.abs(v).max() + np.abs(w).max()) * (0.0 if norm.is_monotone_in_lengths else 2.0)
        )
        assert norm.value(grid, v + w) <= (one + other) * (1.0 + ROUNDING) + rounded
        assert norm.value(grid, factor * v) == pytest.approx(abs(factor) * one, rel=ROUNDING, abs=1e-300)

    @given(rows())
    def test_cones_have_its_value(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        """The least heads over all cones give the norm (P1)."""
        weights, v, _ = data
        cones = norm.cones(one_signal(weights))
        if cones.centred:
            v = v - centre_of(cones, v)
        scaled = cones.factors[:, None] * v
        sizes = [float(np.hypot.reduce(scaled, axis=None))] if cones.is_single else lengths(scaled).tolist()
        heads = np.zeros(len(cones.value))
        for head, size in zip(cones.head, sizes, strict=True):
            heads[head] = max(heads[head], size)
        if cones.squares is not None:
            # a square over the last head, which is the norm
            heads[-1] = norm.value(one_signal(weights), v)
            for square, other, top in zip(*cones.squares, strict=True):
                heads[other] = heads[square] * (heads[square] / (heads[top] or 1.0))
        if cones.linear_rows is not None:
            # the heads over others are as large as what stands under them
            row, head, factor = cones.linear_rows
            for top in set(head[factor < 0.0]):
                sums = np.bincount(row, np.where(head == top, 0.0, factor * heads[head]))
                heads[top] = float((sums / -np.bincount(row, np.where(head == top, factor, 0.0))).max())
        assert (cones.value >= 0.0).all()
        exact = norm.value(one_signal(weights), v)
        rounding = (1e-6, 1e-6) if cones.centred else (ROUNDING, 1e-300)
        assert float(cones.value @ heads) == pytest.approx(exact, rel=rounding[0], abs=rounding[1])

    @given(rows())
    def test_batches_have_its_value(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        if not norm.is_monotone_in_lengths:
            return
        weights, v, w = data
        many = np.stack([lengths(v), lengths(w)])
        expected = [norm.value(one_signal(weights), each) for each in (v, w)]
        assert norm.norm_from_lengths(many, weights).tolist() == pytest.approx(expected, rel=ROUNDING, abs=1e-100)

    @given(rows())
    def test_claimed_properties_of_a_norm_hold(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        weights, v, _ = data
        grid, parts = one_signal(weights), [v * (np.arange(len(v)) == k)[:, None] for k in range(len(v))]
        if norm.is_euclidean:
            # squares of small numbers vanish, their hypotenuse does not
            exact = math.hypot(*(np.sqrt(weights) * lengths(v)))
            assert norm.value(grid, v) == pytest.approx(exact, rel=ROUNDING, abs=1e-300)
        if norm.sums_lengths:
            assert norm.value(grid, v) == pytest.approx(sum(norm.value(grid, each) for each in parts), rel=ROUNDING)

    @given(rows(), st.floats(0.1, 10.0))
    def test_smooth_form_is_off_by_its_share(self, norm: Norm, data: tuple[np.ndarray, ...], unit: float) -> None:
        """Check that it is not above the norm, nor below by more than the share of the unit (N3, E22)."""
        weights, v, _ = data
        grid, share, program = Grid((weights + 0.1) / (weights + 0.1).sum(), len(weights)), 1e-3, AtItsValues()
        exact, smooth = norm.value(grid, v), float(norm.smooth_expression(program, grid, ca.DM(v), unit, share))
        slack = ROUNDING * (exact + unit)
        assert exact - share * unit - slack <= smooth
        assert smooth <= exact + slack or program.has_free
        assert all(float(ca.mmax(each)) <= slack for each in program.held)

    @given(rows(), st.floats(0.1, 10.0))
    def test_smooth_limit_is_the_limit(self, norm: Norm, data: tuple[np.ndarray, ...], size: float) -> None:
        """Check points just inside and outside, and the slope of each side."""
        weights, v, _ = data
        grid = Grid((weights + 0.1) / (weights + 0.1).sum(), len(weights))
        whole = norm.value(grid, v)
        if whole < 1e-6:
            return
        for factor in (0.999, 1.001):
            rows = ca.DM(size * v / whole)
            program = AtItsValues()
            value, maximum, _ = norm.smooth_limit(program, grid, rows, factor * size, 1e-7)
            if factor < 1.0 or not program.has_free:
                assert (float(ca.mmax(value)) <= maximum) == (factor > 1.0)
        sides = [norm.smooth_limit(AtItsValues(), grid, rows, size + step, 1e-7)[1] for step in (-1e-4, 1e-4)]
        slope = norm.smooth_limit(AtItsValues(), grid, rows, size, 1e-7)[2]
        assert (sides[1] - sides[0]) / 2e-4 == pytest.approx(slope, rel=2e-6)

    @given(rows())
    def test_smooth_limit_has_a_slope_at_zero(self, norm: Norm, data: tuple[np.ndarray, ...]) -> None:
        weights, v, _ = data
        rows, program = ca.SX.sym("rows", *v.shape), WithVariables()
        value, _, _ = norm.smooth_limit(program, one_signal(weights), rows, 1.0, 1e-7)
        expressions = ca.vertcat(ca.reshape(value, -1, 1), *program.held)
        given_so = [rows, *program.variables]
        slopes = ca.Function("slopes", given_so, [ca.jacobian(expressions, ca.veccat(*given_so))])
        assert np.isfinite(np.array(slopes(*(np.zeros(each.shape) for each in given_so)))).all()


@every_norm
class TestDualRows:
    """Dual rows of a solver as proofs use them (P6)."""

    @given(SEEDS)
    def test_aligned_rows_are_allowed_and_no_worse(self, norm: Norm, seed: int) -> None:
        grid, signals, rng = scene(seed)
        v = sampled(signals, grid.steps)
        if rng.random() < 0.5:
            v[rng.integers(len(v))] = 0.0
        z = norm.dual_feasible(grid, rng.standard_normal(v.shape) * grid.weights[:, None] * 10.0 ** rng.uniform(-2, 2))
        better = norm.aligned_dual(grid, v, z)
        assert norm.dual_norm(grid, better) <= 1.0 + ROUNDING
        assert float((better * v).sum()) >= float((z * v).sum()) - 1e-5 * norm.value(grid, v)

    @given(SEEDS, st.integers(1, 5))
    def test_spread_rows_stay_in_the_dual_ball(self, norm: Norm, seed: int, times: int) -> None:
        grid, signals, rng = scene(seed)
        z = norm.dual_feasible(grid, rng.standard_normal((len(grid.weights), 2)) * 10.0 ** rng.uniform(-2, 2))
        fine = Grid(np.repeat(grid.weights / times, times), grid.steps * times, points=grid.points)
        spread = norm.refined_dual(z, grid.steps, times)
        assert spread.shape == (len(fine.weights), 2)
        assert norm.dual_norm(fine, spread) <= norm.dual_norm(grid, z) * (1.0 + ROUNDING)
        # spreading over equal rows changes no sum
        still = np.repeat(rng.standard_normal((len(signals) * PLACES, 1, 2)), grid.steps * times, axis=1)
        found, given_so = (float((rows.reshape(still.shape[0], -1, 2) * still[:, :1]).sum()) for rows in (spread, z))
        assert found == pytest.approx(given_so, abs=1e-12 * (1.0 + float(np.abs(z).sum())))
        if times == 1:
            np.testing.assert_allclose(spread, z, rtol=ROUNDING)

    @given(SEEDS)
    def test_subgradient_spread_bounds_the_finer_norm(self, norm: Norm, seed: int) -> None:
        """Check that <Z, V> on the finer grid is not above the norm there."""
        grid, signals, _ = scene(seed)
        z = norm.refined_dual(norm.subgradient(grid, sampled(signals, grid.steps)), grid.steps, 4)
        v = sampled(signals, 4 * grid.steps)
        whole = norm.value(Grid(np.repeat(grid.weights / 4, 4), 4 * grid.steps, points=grid.points), v)
        assert float((z * v).sum()) <= whole * (1.0 + 1e-10)


@every_norm
class TestSignals:
    """Bounds without a sample, and of what samples miss."""

    @given(SEEDS)
    def test_the_norm_is_not_above(self, norm: Norm, seed: int) -> None:
        _, signals, rng = scene(seed)
        points = shares(rng, len(signals))
        assert fine_value(norm, signals, points) <= norm.upper_bound(signals, points) * (1.0 + 1e-9)

    @given(SEEDS, st.sampled_from([5, 12, 24, 60]))
    def test_samples_are_off_by_no_more_than_said(self, norm: Norm, seed: int, steps: int) -> None:
        _, signals, rng = scene(seed)
        points = shares(rng, len(signals))
        taken = norm.refinement * steps
        result = norm.value(grid_of(points, taken), sampled(signals, taken))
        truth = fine_value(norm, signals, points)
        assert abs(result - truth) <= norm.sampling_bound(signals, points, steps, 720) + 1e-4 * truth / FINE


class TestWeightless:
    @pytest.mark.parametrize("norm", [NORMS["mean"], NORMS["rms"]])
    def test_a_row_without_weight_bounds_nothing(self, norm: Norm) -> None:
        """No multiple of the norm bounds a row that it does not count."""
        weights, z = np.array([1.0, 0.0]), np.array([[1.0], [1.0]])
        assert norm.dual_norm(Grid(weights, 1), z) == math.inf
        assert not norm.dual_feasible(Grid(weights, 1), z)[1].any()

    def test_a_maximum_has_no_weights(self) -> None:
        assert NORMS["maximum"].dual_norm(Grid(np.zeros(2), 1), np.array([[3.0], [4.0]])) == 7.0


class TestWorstMean:
    """Worst mean over operating points as groups, whose shares the dual rows give."""

    @given(SEEDS)
    def test_it_is_the_largest_of_the_means(self, seed: int) -> None:
        grid, signals, rng = scene(seed)
        v = sampled(signals, grid.steps)
        blocks = np.split(v, grid.points)
        assert NORMS["worst mean"].value(grid, v) == pytest.approx(
            max(lengths(own).mean() for own in blocks), rel=1e-12
        )
        # its dual adds up what each mean has alone
        z = rng.standard_normal(v.shape)
        alone = sum(len(own) * lengths(own).max() for own in np.split(z, grid.points))
        assert NORMS["worst mean"].dual_norm(grid, z) == pytest.approx(alone, rel=1e-12)

    @given(SEEDS)
    def test_its_cones_hold_every_point(self, seed: int) -> None:
        grid, signals, _ = scene(seed)
        v = sampled(signals, grid.steps)
        cones = NORMS["worst mean"].cones(grid)
        heads = np.append(lengths(v), NORMS["worst mean"].value(grid, v))
        row, head, factor = cones.linear_rows
        sums = np.bincount(row, factor * heads[head])
        assert sums.max() == pytest.approx(0.0, abs=1e-12 * heads.max())
        assert len(sums) == grid.points
