"""Uneven throws: never worse than the start, never beyond the intervals, exact where it counts."""

import itertools
import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from laufruhe.files.reader import load
from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.prove.certificate import Proof
from laufruhe.prove.throws.firing_windows_bound import minimum_bound, star_bounds, throw_costs, uneven_bound
from laufruhe.solvers import solve
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum
from laufruhe.solvers.smooth.program import SmoothProgram
from laufruhe.solvers.stars.even_search import enumerate_stars
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.throws import uneven_throws
from laufruhe.solvers.throws.uneven_throws import local_optimum
from phasing import engines
from problem_files import PROBLEMS, loaded
from ready import solved
from smooth import AtItsValues, smooth_value

SPLIT = "bank_angle = { between = [60, 100] }\nsplit_pin_angle = { between = [0, 60] }\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["inline-seven-uneven", "inline-nine-uneven", "two-stroke-eight-uneven"])
def test_slightly_uneven_angles_cut_the_couple(name):
    """Check that a few degrees take most of the couple, as in marine engines."""
    problem, result = load(PROBLEMS / f"{name}.toml"), solved(name)
    allowed = problem.phasing.intervals
    intervals = result.final.engine.firing_intervals
    assert allowed.holds(intervals, 1e-7)
    assert max(intervals) - min(intervals) > math.radians(0.5)
    assert result.objective.value < 0.5 * result.phasing.even_value
    assert problem.limits
    for limit in problem.limits:
        assert result.final.value(limit.measure) <= limit.maximum * (1.0 + 1e-6)
    trade = result.phasing.trade
    values = [point.value for point in trade]
    assert values == sorted(values, reverse=True)
    assert trade[0].value == pytest.approx(result.phasing.even_value, rel=1e-12)
    assert all(point.deviation <= point.allowed + 1e-7 for point in trade)
    assert all(point.kkt_residual < 1e-6 for point in trade)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap <= 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["inline-seven-uneven", "two-stroke-eight-uneven"])
def test_a_ranking_has_no_crank_twice(name):
    """Check ranks by throws and firing order, where several starts end at one crank."""
    ranked = solved(name).phasing.ranking
    assert len(ranked) > 3
    for one, other in itertools.combinations(ranked, 2):
        turned = np.exp(1j * np.subtract(one.throws, other.throws))
        fires_alike = one.firing_orders[0].order == other.firing_orders[0].order
        assert not fires_alike or np.abs(np.angle(turned)).max() > 1e-4, (one.throws, other.throws)


@pytest.mark.slow
def test_zero_is_reached_cleanly():
    """Check a four-stroke nine: both couples vanish within the intervals, with a bound of zero."""
    result = solved("inline-nine-uneven")
    assert result.objective.value <= 1e-6 * result.phasing.even_value
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.kkt_residual < 1e-6


@pytest.mark.slow
def test_hardly_any_freedom_gives_the_even_optimum(tmp_path):
    even = solve(engines.problem(tmp_path, 5, "four-stroke"))
    almost = 'intervals = { largest_deviation = "0.0001 deg" }'
    few = engines.COUPLE + "[search]\nboxes = 2\n"
    uneven = solve(engines.problem(tmp_path, 5, "four-stroke", phasing=almost, rest=few))
    assert uneven.objective.value <= even.objective.value
    assert uneven.objective.value == pytest.approx(even.objective.value, rel=1e-3)


def test_forbidden_unevenness_is_even_firing(tmp_path):
    even = solve(engines.problem(tmp_path, 5, "four-stroke"))
    none = solve(engines.problem(tmp_path, 5, "four-stroke", phasing='intervals = { largest_deviation = "0 deg" }'))
    assert none.objective.value == even.objective.value
    assert none.certificate.kind is Proof.GLOBAL


@pytest.mark.parametrize("seed", range(4))
def test_no_optimum_lies_above_its_start(tmp_path, seed):
    phasing = engines.problem(tmp_path, 6, phasing='intervals = { largest_deviation = "8 deg" }').phasing
    steps = np.random.default_rng(seed).permutation(np.arange(1, 6))
    throws = tuple(math.tau * p / 6 for p in (0, *steps))
    order = tuple(int(k) + 1 for k in np.argsort([-angle % math.tau for angle in throws]))
    start = Candidate(throws, order)
    problem = phasing.problem_of(start)
    initial_value = evaluate(problem).value(problem.objective[0].measure)
    actual = local_optimum(phasing, start, phasing.intervals)
    assert actual.value <= initial_value
    assert actual.has_moved_throws
    assert actual.kkt_residual < 1e-6
    assert phasing.intervals.holds(actual.result.final.engine.firing_intervals)
    still = local_optimum(phasing, start, Intervals(phasing.even_interval, phasing.even_interval))
    assert still.value == pytest.approx(initial_value, rel=1e-12)


def test_prices_are_those_of_an_end_as_good_as_the_best_crank(tmp_path, monkeypatch):
    """Check that prices are computed only at the better of two ends on both sides of a crank."""
    phasing = engines.problem(tmp_path, 6, phasing='intervals = { largest_deviation = "8 deg" }').phasing
    throws = tuple(math.tau * p / 6 for p in (0, 3, 1, 5, 2, 4))
    order = tuple(int(k) + 1 for k in np.argsort([-angle % math.tau for angle in throws]))
    start, none, better = Candidate(throws, order), np.zeros(0), []
    for side in (-0.05, 0.0, 0.05):
        calls = []

        def ended(program, starts, side=side, **_):
            x = starts[0] + side * (starts[1] - starts[0])
            return [LocalOptimum(x, 1.0, none, none, 0.0, 0.0, 1, 0.0, Ending.CONVERGED, 0)]

        monkeypatch.setattr(uneven_throws, "solve_nonlinear", ended)
        monkeypatch.setattr(SmoothProgram, "prices", lambda *_, calls=calls: calls.append(1) or {})
        better.append(local_optimum(phasing, start, phasing.intervals).candidate != start)
        assert bool(calls) is (better[-1] or side == 0.0)
    assert sorted(better) == [False, False, True]


def test_a_start_that_fires_too_unevenly_leads_to_a_crank_that_does_not(tmp_path):
    """Check that an infeasible start ends at intervals within limits, no worse than the even star."""
    weight = engines.WEIGHTS.partition('[[counterweights]]\nname = "rear"')[0]
    allowed = 'intervals = { largest_deviation = "5 deg" }'
    phasing = engines.problem(tmp_path, 3, "two-stroke", phasing=allowed, rest=weight + engines.COUPLE).phasing
    even, bent = (
        Candidate(tuple(math.radians(a) for a in throws), (1, 3, 2)) for throws in ((0, 120, 240), (0, 100, 220))
    )
    assert not phasing.intervals.holds(phasing.problem_of(bent).engine.firing_intervals)
    actual = local_optimum(phasing, bent, phasing.intervals)
    assert phasing.intervals.holds(actual.result.final.engine.firing_intervals, 1e-7)
    assert actual.value <= solve(replace(phasing.problem_of(even), phasing=None)).objective.value * (1.0 + 1e-6)


MODELS = {
    "couple": (engines.COUPLE, 1e-9),
    "all orders": ('[objective]\nminimise = "rms rocking couple"\n', 1e-6),
    "mount": (engines.MOUNTS + engines.MOUNT_FORCE.replace("mean", "rms"), 1e-6),
    "mean": (engines.MOUNTS + engines.MOUNT_FORCE, 1e-4),
    "fraction": (
        engines.MOUNTS
        + '[[counterweights]]\nname = "all"\nbalance_factor = 0.3\n'
        + engines.MOUNT_FORCE.replace("mean", "rms"),
        1e-6,
    ),
    "weights": (engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE.replace("mean", "rms"), 1e-6),
}


@pytest.mark.parametrize("layout", ["inline", "vee"])
@pytest.mark.parametrize("name", MODELS)
def test_smooth_model_equals_the_exact_one(tmp_path, layout, name):
    rest, tolerance = MODELS[name]
    open_ = engines.OPEN + (SPLIT if layout == "vee" else "")
    allowed = 'intervals = { largest_deviation = "40 deg" }'
    phasing = engines.problem(tmp_path, 6, "four-stroke", open_, allowed, rest, layout, 480).phasing
    rng = np.random.default_rng(11)
    bank, split = (math.radians(81.0), math.radians(22.0)) if layout == "vee" else (None, None)
    count = 3 if layout == "vee" else 6
    start = Candidate(tuple(rng.uniform(0.0, math.tau, count)), None, bank, split)
    problem = replace(phasing.problem_of(start), phasing=None)
    domains, moves = (
        domains_of(problem.unbalances),
        ThrowMoves(phasing, phasing.layout(bank, split), start, phasing.intervals),
    )
    x = rng.uniform(0.0, math.tau, moves.size)
    x[count - 1 :] = np.radians([-11.0, 19.0])[: moves.size - count + 1]
    columns = np.concatenate([[0.0], *(0.3 * d.scale * rng.uniform(0.1, 1.0, d.width) for d in domains)])[1:]
    model = UnevenModel(problem, moves, x, ca.DM(columns))
    quantity = problem.objective[0].measure
    smooth = float(smooth_value(model, quantity, 1e-9))
    exact = phasing.problem_of(moves.candidate(x))
    design = exact.design([d.complex_value(columns) for d in domains])
    assert smooth == pytest.approx(evaluate(exact, design).value(quantity), rel=tolerance)
    rows, grid = model.rows(quantity)
    value, maximum, _ = quantity.norm.smooth_limit(AtItsValues(), grid, rows, smooth, 1e-9)
    assert float(ca.mmax(value)) == pytest.approx(maximum, rel=1e-6)


def test_throws_between_bounds_of_their_own(tmp_path):
    engine = "throws = [0, { between = [60, 180] }, { between = [180, 300] }]\nfiring_order = [1, 3, 2]"
    result = solve(engines.problem(tmp_path, 3, "two-stroke", engine, 'intervals = { largest_deviation = "25 deg" }'))
    for decision in result.decisions:
        assert decision.lower - 1e-9 <= decision.value <= decision.upper + 1e-9
    assert result.objective.value <= result.objective.initial * (1.0 + 1e-9)


@pytest.mark.slow
def test_bank_and_split_pins_move_within_bounds(tmp_path):
    engine = SPLIT + engines.OPEN
    allowed, few = 'intervals = { largest_deviation = "10 deg" }\nbest = 2', "[search]\nboxes = 4\n"
    result = solve(
        engines.problem(tmp_path, 6, "four-stroke", engine, allowed, engines.WEIGHTS + engines.COUPLE + few, "vee")
    )
    values = {d.name: d for d in result.decisions}
    for name in ("bank angle", "split pin angle"):
        assert values[name].lower - 1e-9 <= values[name].value <= values[name].upper + 1e-9
    assert result.objective.value <= result.phasing.even_value


@pytest.mark.parametrize("directions", [1, 31, 32, 33, 100])
def test_the_least_bound_of_stars_is_that_of_all_directions(directions):
    """Compare the least bound of stars, also with a known bound, with the bounds of all directions."""
    rng = np.random.default_rng(directions)
    for size in (1e-3, 1.0, 1e3):
        costs = size * rng.normal(size=(directions, 4, 5))
        stars = rng.integers(0, 5, (60, 4)).astype(np.uint8)
        every = star_bounds(costs, stars)
        assert minimum_bound(costs, stars, np.inf) == every.min()
        for known in (every.min() - size, np.median(every)):
            assert minimum_bound(costs, stars, known) == min(known, every.min())
        assert minimum_bound(costs, stars[:0], size) == size


@pytest.mark.parametrize("cycle", ["two-stroke", "four-stroke"])
@pytest.mark.parametrize("cylinders", [4, 5, 6])
def test_no_uneven_star_goes_under_the_bound(tmp_path, cycle, cylinders):
    """Random intervals between the bounds, random orders: every one lies above the bound of its own star."""
    allowed = 'intervals = { min = "%s deg", max = "%s deg" }'
    even = (720.0 if cycle == "four-stroke" else 360.0) / cylinders
    problem = engines.problem(tmp_path, cylinders, cycle, phasing=allowed % (even - 3.0, even + 2.0))
    phasing = problem.phasing
    (family,), _ = families_of(phasing)
    objective = amplitude_objective(problem, phasing, family.layout)
    costs = throw_costs(phasing, family.space, objective, phasing.intervals)
    minimum = uneven_bound(phasing, family.space, objective, phasing.intervals)
    every = replace(family.space, mirror=True, reflect=True).blocks()
    assert minimum == pytest.approx(max(min(star_bounds(costs, block).min() for block in every), 0.0), rel=1e-12)
    rng = np.random.default_rng(cylinders)
    x, orders = np.array(family.space.places), np.array(objective.orders)
    for _ in range(60):
        order = [0, *(1 + rng.permutation(cylinders - 1))]
        deviations = rng.uniform(-1.0, 1.0, cylinders)
        deviations -= deviations.mean()
        deviations *= 2.0 * rng.uniform(0.2, 1.0) / np.abs(deviations).max()
        angles = np.zeros(cylinders)
        angles[order] = -np.radians(np.cumsum([0.0, *(even + deviations[:-1])]))
        steps = np.zeros(cylinders, dtype=np.uint8)
        steps[order] = [-slot * phasing.cycle.turns * family.space.phases // cylinders % family.space.phases
                        for slot in range(cylinders)]  # fmt: skip
        couples = np.abs((x * np.exp(1j * np.outer(orders, angles))).sum(axis=1))
        value = sum(t.weight * np.linalg.norm(np.multiply(t.couple, couples)) for t in objective.terms)
        own = star_bounds(costs, steps[None])[0]
        assert own <= value * (1.0 + 1e-9)
        assert minimum <= max(own, 0.0) * (1.0 + 1e-9)
    even_only = Intervals(phasing.even_interval, phasing.even_interval)
    tight = uneven_bound(phasing, family.space, objective, even_only)
    best = enumerate_stars(replace(family.space, mirror=True, reflect=True), objective).values[0]
    # a few hundred directions come within a few percent of all
    assert 0.95 * best - 1e-9 <= tight <= best * (1.0 + 1e-9) + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["inline-seven-uneven", "two-stroke-eight-uneven"])
def test_the_trade_lies_between_its_bounds(name):
    result = solved(name)
    for point in result.phasing.trade:
        assert point.lower_bound <= point.value
    assert result.phasing.trade[0].lower_bound >= 0.95 * result.phasing.even_value
    assert result.phasing.trade[1].lower_bound > 0.5 * result.phasing.trade[1].value


IN_STEP = """
title = "Throws that want to stand in step"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = "100 mm"
rod_ratio = 0.25
reciprocating_mass = "1 kg"
cylinder_spacing = "100 mm"
throws = [0, { between = [100, 180] }, 180, 5]
[[operating_points]]
speed = "1500 rpm"
[objective]
minimise = "rms shaking force"
orders = [1]
"""


@pytest.mark.slow
def test_throws_that_want_to_stand_in_step_come_as_near_as_they_can_fire(tmp_path):
    # two that fire at once have no order: the second throw stops short of the third
    result = solve(loaded(tmp_path, IN_STEP))
    second = result.final.engine.slider_cranks[1].throw
    assert math.pi - 1e-4 < second < math.pi
