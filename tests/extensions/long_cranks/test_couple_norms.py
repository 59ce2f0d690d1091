"""Objectives as functions of couples, compared with the exact model: all stars of small engines (S48)."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from lanes import first_fast
from laufruhe.extensions.long_cranks.couple_objectives import CoupleNorms, CoupleTerm, couple_norms, three_stars
from laufruhe.extensions.long_cranks.couple_search import _blocks, good_starts, search_stars, swaps
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.physics.crank_stars import Stars, star_sums
from laufruhe.problem.evaluation import evaluate, objective_value, with_fine_sampling
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.stars.even_search import enumerate_stars
from laufruhe.solvers.stars.families import Family, families_of
from phasing import engines

MOUNTS = (
    '[mounts]\npositions = [["900 mm", "200 mm", "0 mm"], ["800 mm", "-250 mm", "0 mm"], ["-700 mm", "0 mm", "0 mm"]]\n'
)
GAS = '[gas]\nmodel = "wiebe"\nimep = "5.5 bar"\nstart = -5\nduration = 50\ncompression_ratio = 17\n'
OBJECTIVES = {
    norm: f'[objective]\nminimise = "{norm} mount force"\n' for norm in ("mean", "rms", "maximum", "peak to peak")
} | {
    "sum": '[objective]\nterms = [{ quantity = "mean mount force", weight = 1 }, '
    '{ quantity = "maximum rocking couple", weight = 0.3 }]\n'
}
CASES = [
    (5, "two-stroke", "mean", False), (6, "two-stroke", "maximum", False), (6, "two-stroke", "mean", True),
    (5, "four-stroke", "maximum", True), (5, "four-stroke", "rms", True), (6, "two-stroke", "peak to peak", True),
    (5, "four-stroke", "sum", False), (8, "four-stroke", "mean", True),
]  # fmt: skip


def problem_of_norm(folder: Path, cylinders: int, cycle: str, name: str, gas: bool, phasing: str = "", rest: str = ""):
    text = MOUNTS + (GAS if gas else "") + rest + OBJECTIVES[name]
    problem = engines.problem(folder, cylinders, cycle, rest=text, phasing=phasing)
    (family,) = families_of(problem.phasing)[0]
    return problem, family


def of_star(problem: Problem, family: Family, star) -> Problem:
    return problem.phasing.problem_of(family.candidate(problem.phasing, tuple(map(int, star))))


def norms_of(problem: Problem, family: Family) -> CoupleNorms | None:
    return couple_norms(problem, family.space, [of_star(problem, family, star) for star in three_stars(family.space)])


def even_stars(family: Family) -> Stars:
    first = family.first
    found = {(0, *rest) for rest in itertools.islice(itertools.permutations(first[1:]), 2000)}
    return np.array(sorted(found)[:: max(1, len(found) // 30)], dtype=np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize(("cylinders", "cycle", "name", "gas"), CASES)
def test_couples_say_what_the_exact_model_says(cylinders, cycle, name, gas, tmp_path):
    """Check that values are at most those of the cycle and near them, and that windows hold all better stars."""
    problem, family = problem_of_norm(tmp_path, cylinders, cycle, name, gas)
    norms, stars = norms_of(problem, family), even_stars(family)
    assert norms is not None
    exact = np.array([
        objective_value(problem, with_fine_sampling(evaluate(of_star(problem, family, star)))) for star in stars
    ])  # fmt: skip
    low = norms.values(family.space, stars)
    assert (low <= exact * (1.0 + 1e-9)).all()
    assert low == pytest.approx(exact, rel=5e-3)
    assert norms.lower_bound(family.space) <= low.min() * (1.0 + 1e-9)
    assert low.max() <= norms.upper_bound(family.space)
    for maximum in np.quantile(exact, (0.0, 0.1, 0.5, 0.9)):
        window = norms.window(family.space, family.space.patterns[0], maximum)
        couples = np.abs(star_sums(stars, family.space.phases, family.space.places, window.orders)[:, :, 1])
        assert (couples <= window.reaches)[exact <= maximum].all()
        # values above the maximum may be bounded from below, others are exact
        bounded = norms.values(family.space, stars, maximum)
        assert bounded[low <= maximum] == pytest.approx(low[low <= maximum], rel=1e-12)
        assert (bounded[low > maximum] > maximum).all()
        assert (bounded <= low * (1.0 + 1e-9)).all()


@pytest.mark.parametrize(("cylinders", "cycle", "gas"), [(7, "two-stroke", True), (9, "four-stroke", False)])
def test_a_rotated_star_has_the_same_value(cylinders, cycle, gas, tmp_path):
    problem, family = problem_of_norm(tmp_path, cylinders, cycle, "rms", gas)
    norms, r = norms_of(problem, family), np.random.default_rng(4)
    stars = np.array([[0, *r.permutation(family.first[1:])] for _ in range(20)], dtype=np.uint8)
    turned = ((stars.astype(int) + 3) % family.space.phases).astype(np.uint8)
    assert norms.values(family.space, turned) == pytest.approx(norms.values(family.space, stars), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("cylinders", "name", "gas"), [(7, "mean", False), (8, "maximum", True), (7, "rms", True)])
def test_halves_find_the_best_of_all_stars(cylinders, name, gas, tmp_path):
    problem, family = problem_of_norm(tmp_path, cylinders, "two-stroke", name, gas)
    norms = norms_of(problem, family)
    found, every = (how(family.space, norms, 6) for how in (search_stars, enumerate_stars))
    assert found.complete
    np.testing.assert_allclose(found.values, every.values, rtol=1e-9)


@pytest.mark.slow
def test_weights_on_single_throws_have_no_couple_norms(tmp_path):
    weights = '[[counterweights]]\nname = "w"\nx = "200 mm"\nunbalance = "0.02 kg m"\nangle = 40\n'
    problem, family = problem_of_norm(tmp_path, 6, "two-stroke", "mean", False, rest=weights)
    assert norms_of(problem, family) is None


LENGTHS = [(11, "mean", False), (12, "maximum", True), (15, "mean", False)]


@pytest.mark.parametrize(("cylinders", "name", "gas"), first_fast(LENGTHS, 0, 2))
def test_long_cranks_are_proven(cylinders, name, gas, tmp_path):
    """Check that no drawn star, and no exchange of the best one, is below the bound."""
    problem, family = problem_of_norm(tmp_path, cylinders, "two-stroke", name, gas)
    result = solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    norms, r = norms_of(problem, family), np.random.default_rng(cylinders)
    drawn = np.array([[0, *r.permutation(family.first[1:])] for _ in range(3000)], dtype=np.uint8)
    best = np.round(np.array(result.phasing.ranking[0].throws) / (2.0 * np.pi) * cylinders).astype(np.uint8)
    near = swaps(best % cylinders)
    values = norms.values(family.space, np.concatenate([drawn, near]))
    assert values.min() >= result.certificate.lower_bound * (1.0 - 1e-4)


@pytest.mark.parametrize("phases", [1, 4, 9, 12, 15, 30, 48])
def test_blocks_are_stars(phases):
    r = np.random.default_rng(1)
    for _ in range(20):
        assert sorted(_blocks(phases, r)) == list(range(phases))


@pytest.mark.slow
@pytest.mark.parametrize("throws", [35, 45])
def test_blocks_leave_no_couple_of_many_throws(throws, tmp_path):
    """Check that each throw on its own step leaves no couple of any order."""
    problem, _ = problem_of_norm(tmp_path, throws, "two-stroke", "mean", False)
    result = solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value < 1e-3


def test_starts_are_stars_of_the_space(tmp_path):
    problem, family = problem_of_norm(tmp_path, 9, "two-stroke", "rms", False)
    starts = good_starts(family.space, norms_of(problem, family))
    assert (np.sort(starts, axis=1) == np.arange(9)).all()
    assert (starts[:, 0] == 0).all()


@pytest.mark.parametrize("norm", ["mean", "maximum", "rms"])
def test_a_plane_meets_its_term_and_is_nowhere_over_it(norm):
    """Check w N(V0 + C) of random couples by its definition, with a weight far from one."""
    r, weight, rows, orders = np.random.default_rng(8), 0.2, 12, 2
    constant, couples = r.normal(size=(rows, 3)), r.normal(size=(2 * orders, rows, 3))
    grid = Grid(np.full(rows, 1.0 / rows), rows)
    term = CoupleTerm(weight, NORMS[norm], grid, constant, couples, np.ones(orders))

    def by_hand(c):
        sizes = np.linalg.norm(constant + np.einsum("o,okd->kd", c, couples), axis=1)
        return weight * {"mean": sizes.mean(), "maximum": sizes.max(), "rms": np.sqrt((sizes**2).mean())}[norm]

    drawn = r.normal(size=(40, 2 * orders))
    assert term.values(drawn) == pytest.approx([by_hand(c) for c in drawn])
    for at in drawn[:4]:
        minimum, slope = term.linear_bound(at)
        assert minimum + slope @ at == pytest.approx(by_hand(at))
        assert all(minimum + slope @ c <= by_hand(c) * (1.0 + 1e-12) for c in drawn)
