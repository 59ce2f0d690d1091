"""No design allowed transmits less than the bound, and the bound is met where theory says so (E29-E34)."""

from __future__ import annotations

import math
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from laufruhe.files.reader import load
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.mounting import mounting_of
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value, remounted
from laufruhe.problem.measure import Measure, Term
from laufruhe.prove.mounts.transmitted import least_transmitted, softest_of, transmitted_bound
from laufruhe.prove.quadratics import Quadratic, best_prices, covering
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from problem_files import PROBLEMS

FORCE = '[objective]\nminimise = "rms mount force"\norders = [2]\n'
LOSSLESS = ("loss_factor = 0.1", "loss_factor = 0.0")
OVER_CENTRE = ('centre_of_gravity = ["0 mm", "0 mm", "120 mm"]', 'centre_of_gravity = ["0 mm", "0 mm", "0 mm"]')


def random_designs(problem, count: int, seed: int = 0):
    """Mounts and unbalances within their bounds; half of them with most numbers at an end, stiffness by ratio."""
    generator = np.random.default_rng(seed)
    decisions = problem.mount_decisions
    for k in range(count):
        mounts = []
        for d in decisions:
            at = generator.random() ** (3 if k % 2 else 1)
            mounts.append(d.lower * (d.upper / d.lower) ** at if d.lower > 0.0 else d.lower + at * (d.upper - d.lower))
        sizes = [d.upper * generator.random() * np.exp(2j * np.pi * generator.random() * (d.set.width > 1))
                 for d in problem.unbalances]  # fmt: skip
        yield mounts, sizes


@pytest.mark.slow
@pytest.mark.parametrize("name", ["powertrain-least-force", "tractor-four-elastic"])
def test_no_design_allowed_is_under_the_bound(name):
    problem = load(PROBLEMS / f"{name}.toml")
    floors = (channels.SAG, channels.FREQUENCIES)
    limits = tuple(replace(m, outside=None) for m in problem.mount_limits if m.measure.channel in floors)
    problem = replace(problem, limits=limits)
    each = [replace(problem.objective[0].measure, norm=norm) for norm in NORMS.values()]
    bounds = [transmitted_bound(replace(problem, objective=(Term(quantity),))) for quantity in each]
    given = evaluate(problem, samples=48)
    assert all(bound > 0.003 * given.value(quantity) for bound, quantity in zip(bounds, each, strict=True))
    allowed = 0
    for k, (mounts, unbalances) in enumerate(random_designs(problem, 400)):
        if k % 50 == 0:
            shaken = unbalances
            loaded = evaluate(problem, problem.design(shaken, problem.unbalances), 48)
        at = remounted(loaded, problem.design([*shaken, *mounts]))
        if max(at.standing(limit).excess for limit in limits) <= 1e-6:
            allowed += 1
            assert all(at.value(quantity) >= bound for bound, quantity in zip(bounds, each, strict=True))
    assert allowed > 40


@pytest.mark.slow
def test_every_order_of_every_design_obeys_its_own_bound():
    problem = load(PROBLEMS / "powertrain-least-force.toml")
    problem = replace(problem, limits=problem.load_limits)
    softest = softest_of(problem)
    wrench = evaluate(problem).loads[0].wrench
    bounds = {}
    for k in np.flatnonzero(np.abs(wrench.coefficients).max(axis=1) > 1.0):
        if wrench.orders[k] == 0.0:
            continue
        loads = (softest.load @ wrench.coefficients[k])[None]
        omega = float(wrench.orders[k]) * problem.points[0].speed
        bounds[k] = least_transmitted(loads, omega, softest.metric(NORMS["rms"], loads), softest.floors)
    assert sum(value > 0.0 for value in bounds.values()) >= 4
    for mounts, _ in random_designs(problem, 500, 1):
        mounting = mounting_of(problem.design(mounts, problem.mount_decisions))
        forces = mounting.forces(wrench, problem.points[0].speed).coefficients
        for k, bound in bounds.items():
            assert np.sum(np.abs(forces[k]) ** 2) >= bound * (1 - 1e-9)


@pytest.mark.parametrize("speed", [700.0, 2000.0, 6000.0])
def test_undamped_softest_mounts_under_a_vertical_force_meet_the_bound(speed, tmp_path):
    """One mass on one spring: nothing isolates better than no loss on the softest springs (Fig. 31)."""
    engine = changed(ENGINE, ('"700 rpm"', f'"{speed:g} rpm"'))
    mounts = changed(MOUNTS, LOSSLESS)
    problem = problem_of(tmp_path, engine, changed(BLOCK, OVER_CENTRE), mounts, FORCE)
    softest = [d.lower for d in problem.mount_decisions]
    value = objective_value(problem, evaluate(problem, problem.design(softest)))
    assert transmitted_bound(problem) == pytest.approx(value, rel=1e-3)
    assert transmitted_bound(problem) <= value


@pytest.mark.parametrize(
    ("limit", "frequency"),
    [
        ('[[constraints]]\nlimit = "natural frequencies"\nmin = "5 Hz"\n', 5.0),
        ('[[constraints]]\nlimit = "static sag"\nmax = "10 mm"\n', math.sqrt(9.80665 / 0.01) / math.tau),
    ],
)
def test_limits_bound_a_vertical_force_like_the_single_mass_that_they_describe(limit, frequency, tmp_path):
    """A lowest natural frequency and a largest sag are floors of stiffness, even where stiffness may be zero."""
    soft = changed(MOUNTS, LOSSLESS).replace('"20 N/mm", "4000 N/mm"', '"0 N/mm", "4000 N/mm"')
    parts = (ENGINE, changed(BLOCK, OVER_CENTRE), soft, FORCE)
    for text, force in (("", 0.0), (limit, 1000.0 / ((25.0 / frequency) ** 2 - 1.0))):
        softest = softest_of(problem_of(tmp_path, *parts, text))
        loads = (softest.load @ np.array([0.0, 0.0, 1000.0, 0.0, 0.0, 0.0]))[None].astype(complex)
        of_squares, of_forces = (
            least_transmitted(loads, math.tau * 25.0, softest.metric(norm, loads), softest.floors)
            for norm in (NORMS["rms"], NORMS["mean"])
        )
        # four mounts share the force evenly; the covering matrix is tight along it but not exact
        assert of_squares == pytest.approx(force**2 / 4.0, rel=1e-3, abs=1e-6)
        assert 0.7 * force**2 <= of_forces <= force**2 + 1e-9
        assert of_squares <= force**2 / 4.0 * (1.0 + 1e-9) + 1e-9


@pytest.mark.slow
def test_the_mean_torque_is_carried_whole(tmp_path):
    """At order zero the mounts carry the load itself, however soft they are."""
    problem = load(PROBLEMS / "powertrain-least-force.toml")
    steady = Measure(channels.MOUNT_FORCE, NORMS["rms"], orders=(0.0,))
    problem = replace(problem, objective=(Term(steady),), limits=problem.load_limits)
    bound, given = transmitted_bound(problem), evaluate(problem, samples=24)
    assert bound > 0.0
    values = [objective_value(problem, remounted(given, problem.design(m, problem.mount_decisions)))
              for m, _ in random_designs(problem, 300)]  # fmt: skip
    assert bound <= min(values) <= 3.0 * bound


def test_multipliers_are_those_that_another_statement_of_the_program_finds():
    """E33 as it is written, by cvxpy, beside the cones that are handed to the solver directly."""
    generator = np.random.default_rng(0)
    for size, count in ((2, 1), (6, 3), (13, 5)):
        drawn = [(m := generator.normal(size=(size, size))) @ m.T for _ in range(count + 1)]
        objective = Quadratic(drawn[0] / size, generator.normal(size=size), 0.0)
        held = [Quadratic(m / size, generator.normal(size=size), -1.0) for m in drawn[1:]]
        prices, level = cp.Variable(count, nonneg=True), cp.Variable()
        bordered = [np.block([[q.matrix, q.vector[:, None]], [q.vector[None], np.array([[q.constant]])]])
                    for q in (objective, *held)]  # fmt: skip
        corner = np.diag([0.0] * size + [1.0])
        curved = bordered[0] + sum(price * m for price, m in zip(prices, bordered[1:], strict=True)) - level * corner
        cp.Problem(cp.Maximize(level), [curved >> 0]).solve(solver=cp.CLARABEL)
        bound = objective
        for quadratic, price in zip(held, best_prices(objective, held), strict=True):
            bound = bound.plus(quadratic, max(float(price), 0.0))
        assert bound.least == pytest.approx(float(level.value), rel=1e-6)


def test_a_covering_matrix_covers():
    generator = np.random.default_rng(3)
    squares = [(m := generator.normal(size=(3, 6))).T @ m for _ in range(5)]
    along = np.outer(*[generator.normal(size=6)] * 2)
    whole, tight = covering(squares, np.eye(6)), covering(squares, along + 1e-3 * np.eye(6))
    for cover in (whole, tight):
        assert all(np.linalg.eigvalsh(cover - square)[0] >= 0.0 for square in squares)
        assert np.trace(cover @ along) < np.trace(sum(squares) @ along)
    assert np.trace(whole) < np.trace(tight)
    assert np.trace(tight @ along) < np.trace(whole @ along)
