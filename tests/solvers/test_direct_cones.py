"""The cone program as arrays against the same program stated in cvxpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe import load
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.norms import NORMS, Norm
from laufruhe.problem import channels
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import lower_bound
from laufruhe.solvers import solve
from laufruhe.solvers.conic import ConicProgram
from laufruhe.solvers.direct_cones import solve_direct

PROBLEMS = Path(__file__).resolve().parents[2] / "problems"
NAMES = ("tractor-single", "tractor-two", "tractor-four-lanchester", "tractor-four-lanchester-and-moment",
         "tractor-four-front-force-and-moment", "tractor-six", "vee-six-60", "vee-eight-cross")  # fmt: skip


def measured_by(problem: Problem, norm: Norm) -> Problem:
    return replace(
        problem,
        objective=tuple(replace(t, measure=replace(t.measure, norm=norm)) for t in problem.objective),
    )


@pytest.mark.parametrize("norm", NORMS.values())
@pytest.mark.parametrize("name", NAMES)
def test_same_optimum_and_bound_as_cvxpy(name: str, norm: Norm) -> None:
    affine = AffineModel(measured_by(load(PROBLEMS / f"{name}.toml"), norm)).at(96)
    direct, stated = solve_direct(affine), ConicProgram(affine).solve()
    assert direct.x is not None
    assert stated.x is not None
    value = affine.objective(stated.x)
    # an optimum of zero is found to the solver's share of what is balanced
    atol = 1e-7 * affine.objective(np.zeros(affine.size))
    assert affine.objective(direct.x) == pytest.approx(value, rel=1e-6, abs=atol)
    bounds = [lower_bound(affine, solution.multipliers).value for solution in (direct, stated)]
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-6, abs=atol)
    assert bounds[0] == pytest.approx(value, rel=1e-5, abs=atol)


def limited(maximum: float) -> Problem:
    limit = Limit("mass", Measure(channels.BALANCER_MASS, NORMS["mean"]), maximum)
    return replace(load(PROBLEMS / "tractor-four-lanchester.toml"), limits=(limit,))


def test_limits_and_their_prices_as_cvxpy() -> None:
    affine = AffineModel(limited(0.5)).at(96)
    direct, stated = solve_direct(affine), ConicProgram(affine).solve()
    assert direct.x is not None
    assert stated.x is not None
    assert affine.limits[0][1].value(direct.x) == pytest.approx(0.5, rel=1e-7)
    prices = [solution.multipliers.shadow_prices(affine)[0] for solution in (direct, stated)]
    assert prices[0] > 0.0
    assert prices[0] == pytest.approx(prices[1], rel=1e-6)


def test_contradiction_is_told() -> None:
    problem = limited(0.5)
    least = Limit("force", problem.objective[0].measure, 1.0)
    affine = AffineModel(replace(problem, limits=(*problem.limits, least))).at(96)
    assert solve_direct(affine).x is None


@pytest.mark.parametrize("name", ["tractor-three", "tractor-four-lanchester", "tractor-two"])
def test_one_of_many_is_the_same_design(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    one, many = solve(problem), solve(problem, many=True)
    assert one.objective is not None
    assert many.objective is not None
    assert one.certificate is not None
    assert many.certificate is not None
    assert many.status == one.status
    assert many.objective.value == pytest.approx(one.objective.value, rel=1e-6)
    assert many.certificate.kind == one.certificate.kind
    assert many.certificate.lower_bound == pytest.approx(one.certificate.lower_bound, rel=1e-5)
