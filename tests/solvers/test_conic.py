"""Cone program, compared with the same one in cvxpy, and with a solver that stops without an answer."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from scipy.sparse import coo_array, csc_array

import laufruhe
from cli import scenes
from laufruhe import load
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.norms import NORMS, Norm
from laufruhe.problem import channels
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, lower_bound
from laufruhe.solvers import Status, solve
from laufruhe.solvers.cones import conic, newton
from laufruhe.solvers.cones.cone_program import SparseMatrix
from laufruhe.solvers.cones.conic import TIGHT, solve_cones
from problem_files import PROBLEMS, loaded

NAMES = ("tractor-single", "tractor-two", "tractor-four-lanchester", "tractor-four-lanchester-and-moment",
         "tractor-four-front-force-and-moment", "tractor-six", "vee-six-60", "vee-eight-cross")  # fmt: skip


def _stated(norm: AffineNorm, x: Any) -> Any:
    """Return a norm of rows, by its definition."""
    k, d = norm.constant.shape
    rows = cp.reshape(norm.slope.reshape(k * d, -1) @ x, (k, d), order="C") + norm.constant
    weights, steps = norm.grid.weights, norm.grid.steps
    if norm.norm is NORMS["mean"]:
        return weights @ cp.norm(rows, axis=1)
    if norm.norm is NORMS["worst mean"]:
        # points stand one behind another, and the weight of a point does not count
        blocks = np.split(np.arange(k), norm.grid.points)
        return cp.max(cp.hstack([weights[own] / weights[own].sum() @ cp.norm(rows[own], axis=1) for own in blocks]))
    if norm.norm is NORMS["rms"]:
        return cp.norm(cp.multiply(np.sqrt(weights)[:, None], rows), "fro")
    if norm.norm is NORMS["rmq"]:
        return cp.pnorm(cp.multiply(weights**0.25, cp.norm(rows, axis=1)), 4)
    if norm.norm is NORMS["peak to peak"]:
        centres = cp.Variable((k // steps, d))
        return 2.0 * cp.max(cp.norm(rows - np.repeat(np.eye(k // steps), steps, axis=0) @ centres, axis=1))
    return cp.max(cp.norm(rows, axis=1))


def stated(problem: AffineProblem) -> float:
    """Return the optimum by cvxpy, every decision in units of its bound."""
    y = cp.Variable(problem.size)
    x = cp.multiply(problem.scales, y)
    held = []
    for domain in problem.domains:
        own = y[domain.columns]
        if domain.width == 1:
            held += [own <= domain.set.upper / domain.scale, own >= domain.set.lower / domain.scale]
        else:
            held.append(cp.norm(own) <= 1.0)
    unit = problem.objective(np.zeros(problem.size))
    held += [_stated(norm, x) <= maximum for maximum, norm in problem.limits]
    whole = sum(weight / unit * _stated(norm, x) for weight, norm in problem.terms)
    with warnings.catch_warnings():
        # an optimum of zero is not found to all digits
        warnings.simplefilter("ignore")
        return unit * float(cp.Problem(cp.Minimize(whole), held).solve(solver=cp.CLARABEL, **TIGHT))


def measured_by(problem: Problem, norm: Norm) -> Problem:
    return replace(
        problem,
        objective=tuple(replace(t, measure=replace(t.measure, norm=norm)) for t in problem.objective),
    )


@pytest.mark.parametrize("norm", NORMS.values())
@pytest.mark.parametrize("name", NAMES)
def test_same_optimum_and_bound_as_cvxpy(name: str, norm: Norm) -> None:
    affine = AffineModel(measured_by(load(PROBLEMS / f"{name}.toml"), norm)).at(96)
    solution, value = solve_cones(affine), stated(affine)
    assert solution.x is not None
    # an optimum of zero is found to the solver's share of what is balanced
    atol = 1e-7 * affine.objective(np.zeros(affine.size))
    # cvxpy states a fourth power to fewer digits
    digits = 5e-6 if norm is NORMS["rmq"] else 1e-6
    assert affine.objective(solution.x) == pytest.approx(value, rel=digits, abs=atol)
    assert lower_bound(affine, solution.multipliers).value == pytest.approx(value, rel=1e-5, abs=atol)


def limited(maximum: float) -> Problem:
    limit = Limit("mass", Measure(channels.BALANCER_MASS, NORMS["mean"]), maximum)
    return replace(load(PROBLEMS / "tractor-four-lanchester.toml"), limits=(limit,))


def test_limits_and_their_prices() -> None:
    """A limit is met with equality, and its price is the slope of the optimum over it."""
    affine = AffineModel(limited(0.5)).at(96)
    solution = solve_cones(affine)
    assert solution.x is not None
    assert affine.limits[0][1].value(solution.x) == pytest.approx(0.5, rel=1e-7)
    assert affine.objective(solution.x) == pytest.approx(stated(affine), rel=1e-6)
    less, more = (stated(AffineModel(limited(at)).at(96)) for at in (0.499, 0.501))
    assert solution.multipliers.shadow_prices(affine)[0] == pytest.approx((less - more) / 0.002, rel=1e-3)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e6])
def test_the_size_of_the_weights_changes_nothing(factor: float, tmp_path: Path) -> None:
    """Check that a factor on all weights leaves the design, and scales bound and price of the limit."""
    problem = loaded(tmp_path, scenes.TIGHT)
    program = AffineModel(problem).at(72)
    weighted = replace(program, terms=tuple((factor * weight, norm) for weight, norm in program.terms))
    one, other = solve_cones(program), solve_cones(weighted)
    assert one.x is not None
    assert other.x == pytest.approx(one.x, rel=1e-12)
    bounds = [lower_bound(own, found.multipliers) for own, found in ((program, one), (weighted, other))]
    assert bounds[1].value == pytest.approx(factor * bounds[0].value, rel=1e-12)
    assert bounds[0].value == pytest.approx(program.objective(one.x), rel=1e-6)
    prices = [bound.multipliers.shadow_prices(own) for bound, own in zip(bounds, (program, weighted), strict=True)]
    assert prices[0][0] > 0.0
    assert prices[1] == pytest.approx([factor * price for price in prices[0]], rel=1e-12)


def contradicted() -> AffineProblem:
    problem = limited(0.5)
    minimum = Limit("force", problem.objective[0].measure, 1.0)
    return AffineModel(replace(problem, limits=(*problem.limits, minimum))).at(96)


def test_contradicting_limits_have_no_solution() -> None:
    assert solve_cones(contradicted()).x is None


# statuses of a solver that fails
STOPPED = {
    "no numbers": ("NumericalError", np.nan),
    "zero": ("InsufficientProgress", 0.0),
    "anything": ("MaxIterations", 1e3),
    "false infeasible": ("PrimalInfeasible", 0.0),
}


@pytest.mark.parametrize("status", STOPPED)
def test_a_solver_that_gives_up_is_not_the_end(status: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a failing solver leaves a design no worse than the initial one, with its bound."""
    word, value = STOPPED[status]

    def failing(rows: Any, cost: Any, *_: Any) -> Any:
        x, z = np.full(rows.columns, value), np.full(rows.count, value)
        return SimpleNamespace(status=word, x=x, z=z, solve_time=0.0, iterations=1)

    monkeypatch.setattr(conic, "run_clarabel", failing)
    monkeypatch.setattr(newton, "run_clarabel", failing)
    result = solve(limited(0.5))
    assert result.status is Status.FEASIBLE
    assert result.objective is not None
    assert result.certificate is not None
    assert result.certificate.kind is Proof.WITHIN_GAP
    assert result.certificate.lower_bound <= result.objective.value <= result.objective.initial


def test_tolerances_out_of_reach_are_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a solver that stalls before tight tolerances tries its own."""
    problem = limited(0.5)
    result = solve(problem)
    monkeypatch.setattr(conic, "ATTEMPTS", (dict.fromkeys(TIGHT, 1e-300), *conic.ATTEMPTS[1:]))
    again = solve(problem)
    assert result.objective is not None
    assert again.objective is not None
    assert again.objective.value == pytest.approx(result.objective.value, rel=1e-4)
    assert again.status is Status.OPTIMAL


BALANCED = """
title = "loads that cancel"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
cylinder_spacing = "88 mm"
throws = {throws}
[[operating_points]]
speed = "3000 rpm"
[[balancer_shafts]]
name = "shaft"
ratio = -1
position = ["0 mm", "0 mm"]
[[balancer_shafts.unbalances]]
x = "96 mm"
unbalance = {{ between = ["0 kg m", "{upper} kg m"] }}
angle = {{ between = [0, 180] }}
{asked}
"""
ROUNDED = [0.0, 120.0000001, 240.0]
FORCE = '[objective]\nminimise = "rms shaking force"\norders = [1]\n'
BESIDE = """
[[objective.terms]]
quantity = "{norm} shaking force"
orders = [1]
weight = 2.0
[[objective.terms]]
quantity = "mean rocking couple"
orders = [2]
"""


@pytest.mark.parametrize("upper", [2e-8, 0.02, 2e2])
@pytest.mark.parametrize(
    ("throws", "objective"),
    [
        pytest.param([0, 120, 240], FORCE, id="zero"),
        pytest.param(ROUNDED, FORCE, id="next to zero"),
        *(
            pytest.param([0, 120, 240], "[objective]" + BESIDE.format(norm=norm), id=f"{norm} beside a constant")
            for norm in NORMS
        ),
        pytest.param(
            [0, 120, 240],
            '[objective]\nminimise = "mean rocking couple"\n'
            '[[constraints]]\nlimit = "maximum shaking force"\nmax = "2e-9 N"\norders = [1]\n',
            id="tiny limit",
        ),
    ],
)
def test_loads_at_rounding_level_are_proven(throws: list[float], objective: str, upper: float, tmp_path: Path) -> None:
    """Check loads of 1e-12 N, with nothing to gain, under bounds of any size."""
    problem = loaded(tmp_path, BALANCED.format(throws=throws, upper=upper, asked=objective))
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value <= result.objective.initial


@pytest.mark.parametrize("shape", [(7, 5), (1, 3), (4, 0)])
def test_a_sparse_matrix_is_that_of_scipy(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(8)
    count = 40 * shape[1]
    rows, columns = rng.integers(0, shape[0], count), rng.integers(0, max(shape[1], 1), count)
    values = rng.integers(-2, 3, count).astype(float)
    for some in (slice(0, 0), slice(0, 3), slice(None)):
        own = SparseMatrix.from_entries(rows[some], columns[some], values[some], shape)
        theirs = csc_array((own.data, own.indices, own.indptr), shape=shape)
        np.testing.assert_array_equal(
            theirs.toarray(), coo_array((values[some], (rows[some], columns[some])), shape).toarray()
        )
        assert theirs.has_canonical_format
