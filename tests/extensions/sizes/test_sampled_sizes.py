"""Sizes decided at few angles, compared with many angles."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from laufruhe.extensions.sizes.solver import solve_sizes
from laufruhe.numerics.budget import limit_time
from laufruhe.problem.evaluation import evaluate, objective_value, with_fine_sampling
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status, solve
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.solvers.sampling_refinement import refine_sampling
from solvers.test_sampling_refinement import ENGINE, SECOND, problem


def sized(throw: float) -> dict[str, Any]:
    """Return a single whose rod may be thinner."""
    big_end = {"diameter": "50 mm", "width": "28 mm"}
    return {
        "engine": {**ENGINE, "throws": [throw], "bore": "80 mm", "cylinder_spacing": "120 mm", "big_end": big_end},
        "running_gear": {
            "density": "7850 kg/m^3", "rod": {"diameter": {"between": ["10 mm", "30 mm"], "start": "25 mm"}}
        },
        "constraints": [{"limit": "maximum rod stress", "max": "60 N/mm^2", "name": "rod"}],
    }  # fmt: skip


@cache
def of_many_angles(throw: float) -> Result:
    return solve(problem(sized(throw), objective=SECOND, fidelity={"samples": 5760}))


def test_a_bound_of_sizes_is_not_over_a_rival_that_many_angles_judge() -> None:
    """Check the bound from 48 angles, which overestimate order 2, against a design at many angles."""
    few, many = solve(problem(sized(3), objective=SECOND)), of_many_angles(3)
    rival = objective_value(many.problem, with_fine_sampling(many.final))
    assert few.certificate is not None
    assert few.certificate.lower_bound <= rival * (1.0 + 1e-9)
    assert many.status is few.status is Status.OPTIMAL


@pytest.mark.parametrize(("throw", "share", "met"), [(0, 0.998, False), (3, 1.0005, True)])
def test_limits_of_sizes_are_what_the_cycle_has(throw: float, share: float, met: bool) -> None:
    """Check limits on order 2, which 48 angles misread by -0.5 % (throw 0) or +0.25 % (3 deg)."""
    tables = sized(throw)
    minimum = of_many_angles(throw).objective.value
    limit = {"name": "quiet", "limit": "mean shaking force", "orders": [2], "max": f"{share * minimum} N"}
    more = {"constraints": [*tables["constraints"], limit], "search": {"boxes": 200}}
    case = problem(tables, objective={"minimise": "rms shaking force"}, **more)
    result = solve(case)
    assert result.status is (Status.OPTIMAL if met else Status.INFEASIBLE)
    assert not met or with_fine_sampling(result.final).violation(case.limits) <= FEASIBILITY_TOL


def test_a_gap_is_not_left_open_for_what_few_angles_read_too_much() -> None:
    result = solve(problem(sized(3), objective=SECOND))
    assert result.status is Status.OPTIMAL
    assert result.objective.value == pytest.approx(evaluate(result.problem, result.final.engine, 5760).value(
        result.problem.objective[0].measure), rel=1e-4)  # fmt: skip


def test_time_that_is_over_leaves_no_design_that_few_angles_alone_allow() -> None:
    """Check that no time leaves no design, because 48 angles underestimate order 2 by 0.5 %."""
    tables = sized(0)
    maximum = 0.998 * of_many_angles(0).objective.value
    limit = {"name": "quiet", "limit": "mean shaking force", "orders": [2], "max": f"{maximum} N"}
    case = problem(tables, objective={"minimise": "rms shaking force"}, constraints=[*tables["constraints"], limit])
    with limit_time(1e-9):
        result = refine_sampling(case, solve_sizes)
    assert with_fine_sampling(result.final).violation(case.limits) > FEASIBILITY_TOL
    assert result.status is Status.FAILED
    assert result.certificate is not None
    assert result.certificate.kind is Proof.NONE
    assert "'quiet'" in result.message
