"""Lower bounds for any multipliers of a solver, and proofs of zero and without loads."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.norms import NORMS, Grid, Norm
from laufruhe.problem.decision import Decision, Domain, domains_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.numerical_zero import OF_ORDERS, ROUNDING, numerical_zero
from laufruhe.problem.sets import Interval, Sector
from laufruhe.prove.certificate import (
    Multipliers,
    Proof,
    ProofStrength,
    best_bound,
    gap_of,
    kkt_residual,
    lower_bound,
    make_certificate,
)
from mounts.files import problem_of

Array = NDArray[np.float64]
SIX = """
title = "six"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.27
reciprocating_mass = "0.8 kg"
cylinder_spacing = "100 mm"
throws = [0, 120, 240, 240, 120, 0]
[[operating_points]]
speed = "3000 rpm"
[objective]
minimise = "rms shaking force"
orders = [1, 2]
"""
TORQUE = "crank torque"
SEEDS = st.integers(0, 2**32 - 1)
EVERY = tuple(NORMS.values())


def random_norm(rng: np.random.Generator, size: int) -> AffineNorm:
    rows, width = int(rng.integers(1, 9)), int(rng.integers(1, 4))
    norm = EVERY[int(rng.integers(len(EVERY)))]
    weights = rng.random(rows) + 0.01
    slope = rng.standard_normal((rows, width, size)) * (rng.random(size) < 0.8)
    return AffineNorm(norm, rng.standard_normal((rows, width)), slope, Grid(weights / weights.sum(), 1))


def random_domains(rng: np.random.Generator) -> tuple[Domain, ...]:
    decisions = []
    for k in range(int(rng.integers(1, 4))):
        low, kind = float(rng.uniform(-4, 4)), int(rng.integers(3))
        width = (0.0, math.tau, float(rng.uniform(0.1, math.pi)))[kind]
        lower = float(rng.uniform(-2, 1)) if kind == 0 else 0.0
        upper = max(lower, 0.0) + float(rng.uniform(0.1, 3))
        own = Interval(lower, upper, low) if kind == 0 else Sector(upper, (low, low + width))
        decisions.append(Decision(f"d{k}", "kg m", own, 0j, ()))
    return domains_of(tuple(decisions))


def random_point(rng: np.random.Generator, problem: AffineProblem) -> Array:
    x = rng.standard_normal(problem.size) * 2.0 * problem.scales
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    return x


def random_problem(rng: np.random.Generator) -> tuple[AffineProblem, Array]:
    """Return a problem and a design that keeps its limits, some of them just so."""
    domains = random_domains(rng)
    size = sum(domain.width for domain in domains)
    terms = tuple((float(rng.uniform(0.1, 3)), random_norm(rng, size)) for _ in range(int(rng.integers(1, 4))))
    open_problem = AffineProblem(terms, (), domains, 1)
    x = random_point(rng, open_problem)
    limits = tuple(
        (norm.value(x) * (1.0 + float(rng.choice([0.0, 0.3]))), norm)
        for norm in (random_norm(rng, size) for _ in range(int(rng.integers(0, 3))))
    )
    return replace(open_problem, limits=limits), x


def random_multipliers(rng: np.random.Generator, problem: AffineProblem, x: Array) -> Multipliers:
    """Return random multipliers, or some near those of a solver."""

    def rows(norm: AffineNorm) -> Array:
        own = norm.subgradient(x)
        noise = rng.standard_normal(norm.constant.shape)
        return np.asarray(rng.choice([0.0, 1.0]) * own + 10.0 ** rng.uniform(-8, 3) * rng.choice([0.0, 1.0]) * noise)

    return Multipliers(
        tuple(rows(norm) for _, norm in problem.terms),
        tuple(10.0 ** rng.uniform(-4, 2) * rows(norm) for _, norm in problem.limits),
    )


class TestGap:
    def test_is_a_share_of_the_value(self) -> None:
        result = make_certificate(2.0, 1.5, 1e-9, 1e-4, ProofStrength.EXACT, 0.0, "")
        assert result.gap == pytest.approx(0.25)
        assert result.kind is Proof.WITHIN_GAP

    @pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
    def test_is_the_same_share_in_every_unit(self, unit: float) -> None:
        assert gap_of(2.0 * unit, 1.5 * unit, 0.0) == pytest.approx(0.25)

    def test_values_at_the_zero_level_count_as_zero(self) -> None:
        assert make_certificate(1e-10, 0.0, 1e-9, 1e-4, ProofStrength.RELAXED, 0.0, "").kind is Proof.GLOBAL
        assert make_certificate(0.0, 0.0, 0.0, 1e-4, ProofStrength.RELAXED, 0.0, "").kind is Proof.GLOBAL
        assert make_certificate(1e-6, 0.0, 1e-9, 1e-4, ProofStrength.RELAXED, 0.0, "").kind is Proof.LOCAL

    def test_a_difference_that_counts_as_zero_is_stated(self) -> None:
        """It proves the optimum; a reader still sees that value and bound differ."""
        result = make_certificate(1e-6, 0.9999e-6, 1e-9, 1e-6, ProofStrength.RELAXED, 0.0, "")
        assert result.kind is Proof.GLOBAL
        assert result.gap == pytest.approx(1e-4)

    def test_zero_is_a_rounding_of_the_parts_not_of_the_sum(self, tmp_path: Path) -> None:
        """A balanced six has the parts of a single cylinder six times; soft mounts have no resonance of their own."""
        six = problem_of(tmp_path, SIX)
        assert objective_value(six, evaluate(six)) < numerical_zero(six)
        single = problem_of(tmp_path, SIX.replace("[0, 120, 240, 240, 120, 0]", "[0]"))
        parts = objective_value(single, evaluate(single))
        all_orders = problem_of(tmp_path, SIX.replace("[0, 120, 240, 240, 120, 0]", "[0]").replace("orders", "#"))
        whole = objective_value(all_orders, evaluate(all_orders))
        assert numerical_zero(six) == pytest.approx(6.0 * (ROUNDING * parts + OF_ORDERS * whole), rel=1e-9)

    @pytest.mark.parametrize(("order", "none"), [(1, True), (2, False)])
    def test_an_order_absent_from_a_part_counts_as_zero(self, order: int, none: bool, tmp_path: Path) -> None:
        """A scotch yoke turns its crank by the second order alone: of the first there is a rounding of that."""
        yoke = SIX.replace("0.27", "0.0").replace("orders = [1, 2]", f"orders = [{order}]")
        problem = problem_of(
            tmp_path, yoke.replace("[0, 120, 240, 240, 120, 0]", "[0]").replace("shaking force", TORQUE)
        )
        assert (0.0 < objective_value(problem, evaluate(problem)) <= numerical_zero(problem)) is none


class TestBound:
    @given(SEEDS)
    def test_holds_for_any_multipliers(self, seed: int) -> None:
        """No allowed design lies below a bound, be the multipliers as wrong as they like (P4)."""
        rng = np.random.default_rng(seed)
        problem, allowed = random_problem(rng)
        designs = [allowed]
        for _ in range(30):
            x = random_point(rng, problem)
            if all(norm.value(x) <= maximum for maximum, norm in problem.limits):
                designs.append(x)
        for _ in range(5):
            bound = lower_bound(problem, random_multipliers(rng, problem, designs[-1]))
            for x in designs:
                value = problem.objective(x)
                assert bound.value <= value + 1e-9 * (1.0 + value + np.abs(bound.gradient).sum())

    @given(SEEDS)
    def test_is_affine_minorant_everywhere(self, seed: int) -> None:
        """Its value is the least of a plane that lies under the objective, found here on random designs."""
        rng = np.random.default_rng(seed)
        problem, x = random_problem(rng)
        unlimited = replace(problem, limits=())
        bound = lower_bound(unlimited, random_multipliers(rng, unlimited, x))
        constant = sum(
            weight * float((z * norm.constant).sum())
            for (weight, norm), z in zip(unlimited.terms, bound.multipliers.terms, strict=True)
        )
        for _ in range(20):
            y = random_point(rng, unlimited)
            plane = constant + float(bound.gradient @ y)
            assert plane <= unlimited.objective(y) + 1e-10 * (1.0 + abs(plane))
            assert bound.value <= max(plane, 0.0) + 1e-10 * (1.0 + abs(plane))

    def test_is_tight_where_it_can_be(self) -> None:
        """Check |x - 1| on [2, 3]: the bound and the objective at 2 are 1."""
        norm = AffineNorm(NORMS["mean"], np.array([[-1.0]]), np.array([[[1.0]]]), Grid(np.ones(1), 1))
        domains = domains_of((Decision("d", "kg m", Interval(2.0, 3.0), 0j, ()),))
        problem = AffineProblem(((1.0, norm),), (), domains, 1)
        bound = lower_bound(problem, Multipliers((np.array([[1.0]]),), ()))
        assert bound.value == problem.objective(np.array([2.0])) == 1.0
        assert kkt_residual(problem, np.array([2.0]), bound) == 0.0
        assert kkt_residual(problem, np.array([2.5]), bound) > 0.1
        opposite = lower_bound(problem, Multipliers((np.array([[-1.0]]),), ()))
        assert opposite.value == 0.0

    def test_limits_raise_it(self) -> None:
        """|x - 3| with |x| <= 1 on a disc: the price of the limit is the slope, and the bound is 2."""
        unit = np.eye(2)[None]
        far = AffineNorm(NORMS["mean"], np.array([[-3.0, 0.0]]), unit, Grid(np.ones(1), 1))
        near = AffineNorm(NORMS["maximum"], np.zeros((1, 2)), unit, Grid(np.ones(1), 1))
        domains = domains_of((Decision("d", "kg m", Sector(5.0), 0j, ()),))
        problem = AffineProblem(((1.0, far),), ((1.0, near),), domains, 1)
        multipliers = Multipliers((np.array([[-1.0, 0.0]]),), (np.array([[1.0, 0.0]]),))
        bound = lower_bound(problem, multipliers)
        x = np.array([1.0, 0.0])
        assert bound.value == problem.objective(x) == 2.0
        assert multipliers.shadow_prices(problem) == (1.0,)
        assert kkt_residual(problem, x, bound) == 0.0
        assert lower_bound(problem, Multipliers(multipliers.terms, (np.zeros((1, 2)),))).value == 0.0
        outside = np.array([2.0, 0.0])
        assert kkt_residual(problem, outside, bound) >= 1.0

    @given(SEEDS)
    def test_best_bound_is_a_bound(self, seed: int) -> None:
        """On a grid twice as fine, dual rows of the coarse one make a bound below every design."""
        rng = np.random.default_rng(seed)
        domains = random_domains(rng)
        size, samples, groups = sum(d.width for d in domains), 8, 2
        norm = EVERY[int(rng.integers(len(EVERY)))]
        waves = rng.standard_normal((groups, 3, 2, size + 1)) + 1j * rng.standard_normal((groups, 3, 2, size + 1))

        def at(count: int) -> AffineProblem:
            turns = np.exp(2j * np.pi * np.outer(np.arange(count), np.arange(3)) / count)
            rows = np.einsum("sh,ghdn->gsdn", turns, waves).real.reshape(groups * count, 2, size + 1)
            weights = np.full(groups * count, 1.0 / (groups * count))
            result = AffineNorm(norm, rows[..., 0], rows[..., 1:], Grid(weights, count))
            return AffineProblem(((1.0, result),), (), domains, count)

        coarse, fine = at(samples), at(2 * samples)
        x = random_point(rng, coarse)
        bound = best_bound(fine, x, random_multipliers(rng, coarse, x))
        for _ in range(20):
            assert bound.value <= fine.objective(random_point(rng, fine)) * (1.0 + 1e-12)

    def test_never_below_zero(self) -> None:
        """A norm is not negative, and no bound needs to be."""
        rng = np.random.default_rng(0)
        for _ in range(50):
            problem, x = random_problem(rng)
            assert lower_bound(problem, random_multipliers(rng, problem, x)).value >= 0.0


class TestPrices:
    @pytest.mark.parametrize("norm", EVERY, ids=str)
    def test_price_is_the_dual_norm(self, norm: Norm) -> None:
        """mu Z with Z in the unit sphere of the dual norm has the price mu (P5)."""
        rng = np.random.default_rng(3)
        grid = Grid(np.array([0.2, 0.3, 0.5]), 3)
        v = rng.standard_normal((3, 2))
        z = norm.subgradient(grid, v)
        limit = AffineNorm(norm, v, np.zeros((3, 2, 1)), grid)
        domains = domains_of((Decision("d", "kg m", Interval(0.0, 1.0), 0j, ()),))
        problem = AffineProblem((), ((1.0, limit),), domains, 1)
        assert Multipliers((), (7.0 * z,)).shadow_prices(problem) == (pytest.approx(7.0),)
