"""Stiffness decided with proof: closed forms, other solvers, and certificates that can fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from laufruhe.files.reader import load
from laufruhe.physics import mount_numbers
from laufruhe.physics.modes import sag_for_critical_speed
from laufruhe.physics.mount_numbers import total_stiffness
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.mounts.convex import ConvexProgram, is_convex, solve_convex_mounts
from laufruhe.solvers.mounts.nonlinear import solve_mounts
from laufruhe.solvers.result import Status
from mounts.files import BLOCK, ENGINE, MOUNTS, SAG, changed, problem_of
from problem_files import PROBLEMS

RPM = np.pi / 30.0


@pytest.mark.parametrize(("name", "order", "printed"), [("", 2, 1.4e-3), ("-first-order", 1, 5.6e-3)])
def test_the_studys_sag_comes_out_and_is_proven(name, order, printed):
    result = solve_mounts(load(PROBLEMS / f"study-soft-mounts{name}.toml"))
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.kkt_residual < 1e-6
    assert result.objective.value == pytest.approx(sag_for_critical_speed(400.0 * RPM, order), rel=2e-5)
    assert result.objective.value == pytest.approx(printed, abs=0.05e-3)
    (limit,) = result.limits
    assert limit.active
    assert limit.side == "at most"


def test_shadow_price_of_a_frequency_is_the_slope_of_the_sag(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG)
    price = solve_mounts(problem).limits[0].shadow_price
    (limit,), step = problem.limits, 0.02
    moved = replace(problem, limits=(replace(limit, maximum=limit.maximum + step),))
    further = solve_mounts(moved).objective.value
    assert (solve_mounts(problem).objective.value - further) / step == pytest.approx(price, rel=2e-2)


def program_of(problem):
    return ConvexProgram(problem, problem.objective, problem.limits)


def least_squares(tmp_path):
    """Return a torque-roll residual in box bounds, a bounded least-squares problem."""
    text = MOUNTS.replace('"120 N/mm", "120 N/mm"', '{ between = ["30 N/mm", "300 N/mm"] }, "120 N/mm"', 1)
    block = BLOCK + 'inertia_products = ["2 kg m^2", "-3 kg m^2", "1 kg m^2"]\n'
    objective = '[objective]\nminimise = "torque-roll residual"\nfrequency = "9 Hz"\n'
    return problem_of(tmp_path, ENGINE, block, text, objective)


def test_bounded_least_squares_agrees_with_scipy(tmp_path):
    problem = least_squares(tmp_path)
    result, ends = solve_mounts(problem), np.array([(d.lower, d.upper) for d in problem.decisions]) / 1e5
    (term,) = problem.objective

    def rows_at(x):
        mounting = mounting_in(problem.design((1e5 * x).tolist()))
        root = mount_numbers.mass_root(mounting.block)
        axis = term.measure.channel.axis_residual(mounting.block, term.measure.frequency)
        return axis.rows(root @ mounting.stiffness @ root.T)

    rows = np.column_stack([rows_at(e + 1.0) - rows_at(np.ones(len(e))) for e in np.eye(len(ends))])
    middle = rows_at(np.ones(len(ends))) - rows.sum(axis=1)
    other = lsq_linear(rows, -middle, ends.T, tol=1e-14)
    assert result.objective.value == pytest.approx(np.sqrt(2.0 * other.cost), rel=1e-8)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value > 1e-3


def test_least_stiff_design_agrees_with_a_search(tmp_path):
    objective = """
    [objective]
    minimise = "total stiffness"
    [[constraints]]
    limit = "static sag"
    max = "3 mm"
    [[constraints]]
    limit = "natural frequencies"
    min = "4.2 Hz"
    """
    problem = problem_of(tmp_path, ENGINE, BLOCK.replace('["0 mm", "0 mm"', '["60 mm", "0 mm"'), MOUNTS, objective)
    result = solve_mounts(problem)
    assert result.certificate.kind is Proof.GLOBAL

    def design(x):
        return mounting_in(problem.design([float(v) * 1e5 for v in x]))

    actual = minimize(
        lambda x: total_stiffness(design(x).mounts) / 1e6, [5.0, 5.0], method="SLSQP", bounds=[(0.2, 40.0)] * 2,
        constraints=[{"type": "ineq", "fun": lambda x: (3e-3 - mount_numbers.sag(design(x))) * 1e3},
                     {"type": "ineq", "fun": lambda x: design(x).modes.frequencies[0] - 4.2}],
        options={"ftol": 1e-13},
    )  # fmt: skip
    assert actual.success
    assert result.objective.value == pytest.approx(actual.fun * 1e6, rel=1e-6)


@pytest.mark.parametrize("kind", ["sag", "residual"])
def test_any_multipliers_give_a_bound_and_those_of_the_solver_the_best(tmp_path, kind):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG) if kind == "sag" else least_squares(tmp_path)
    program, best = program_of(problem), solve_mounts(problem).objective.value
    generator, (_, z) = np.random.default_rng(0), program.solve()
    assert program.bound(z)[0] == pytest.approx(best, rel=1e-6)
    for spread in (1e-6, 1e-2, 1.0, 1e2):
        for _ in range(20):
            spoilt = z * np.exp(generator.normal(size=z.shape)) + spread * np.abs(z).max() * generator.normal(
                size=z.shape
            )
            assert program.bound(spoilt)[0] <= best * (1.0 + 1e-9)
            assert not program.excludes(spoilt)


def test_slopes_of_a_bound_are_those_of_the_optimum(tmp_path):
    """Check that only a stiffness at its bound has the gradient of the objective."""
    problem = least_squares(tmp_path)
    program = program_of(problem)
    x, z = program.solve()
    gradient, step = program.bound(z)[1], 1e-4 * (program.half + 1.0)

    def value(x):
        mounting = mounting_in(problem.design(x.tolist()))
        measure = problem.objective[0].measure
        return mount_numbers.residual_of(mounting, measure.channel.axis_residual(mounting.block, measure.frequency))

    for k, unit in enumerate(np.eye(len(x))):
        slope = (value(x + step * unit) - value(x - step * unit)) / (2.0 * step[k])
        assert gradient[k] == pytest.approx(slope, rel=1e-3, abs=1e-4 * value(x) / program.half[k])


def test_limits_that_cannot_be_met_together_are_named(tmp_path):
    extra = '[[constraints]]\nlimit = "static sag"\nmax = "1 mm"\n'
    extra += '[[constraints]]\nlimit = "total stiffness"\nmin = "1 N/m"\n'
    result = solve_mounts(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG, extra))
    assert result.status is Status.INFEASIBLE
    assert set(result.conflict) == {"natural frequencies", "static sag"}
    assert result.message == "no design exists: 'natural frequencies' and 'static sag' contradict each other"


def test_nonconvex_mount_problems_are_recognised(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG)
    assert is_convex(problem)
    band = changed(SAG, ('max = "40/3 Hz"', 'outside = ["12 Hz", "20 Hz"]'))
    assert not is_convex(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, band))
    moved = MOUNTS.replace('"300 mm", "200 mm"', '{ between = ["250 mm", "300 mm"] }, "200 mm"')
    assert not is_convex(problem_of(tmp_path, ENGINE, BLOCK, moved, SAG))
    assert problem.mount_terms[0].measure.channel is channels.SAG


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_lying_solver_is_detected(tmp_path, monkeypatch, factor):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG)
    honest = ConvexProgram.solve
    monkeypatch.setattr(ConvexProgram, "solve", lambda self: (factor * honest(self)[0], honest(self)[1]))
    result = solve_convex_mounts(problem)
    assert result.certificate.kind is not Proof.GLOBAL
    assert result.status is Status.FEASIBLE
    # a design that breaks a limit is discarded, and the initial one is left
    assert (result.objective.value == result.objective.initial) == (factor > 1.0)
