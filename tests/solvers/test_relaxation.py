"""Bounds of a problem without some limits, compared with designs and bounds under all limits (P18)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import laufruhe
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.relaxation import solve_by_relaxation
from laufruhe.solvers.result import Result, Status

PROBLEM = Path(__file__).parents[1] / "claims" / "inputs" / "transmissibility-beside-weights.toml"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return laufruhe.load(PROBLEM)


@pytest.fixture(scope="module")
def free(problem: Problem) -> Result:
    """Return the optimum without the limit, which keeps the limit."""
    return laufruhe.solve(problem.changed(limits=()))


def bounded(result: Result, share: float, worse: float = 1.0) -> Result:
    """Return a result without a proof of its optimum, a share of the bound, and another value."""
    assert result.certificate is not None
    assert result.objective is not None
    bound, value = share * result.certificate.lower_bound, worse * result.objective.value
    certificate = replace(result.certificate, kind=Proof.LOCAL, lower_bound=bound, gap=1.0 - bound / value)
    objective = replace(result.objective, value=value)
    return replace(result, status=Status.FEASIBLE, certificate=certificate, objective=objective)


def test_a_design_of_the_relaxation_has_the_higher_of_both_bounds(problem: Problem, free: Result) -> None:
    """The method of the whole problem finds a worse design, but its bound is higher."""
    own = bounded(free, 0.98, worse=1.1)
    result = solve_by_relaxation(problem, free.problem, lambda _: bounded(free, 0.9), lambda _: own)
    assert free.objective is not None
    assert free.certificate is not None
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == free.objective.value
    assert result.certificate.lower_bound == 0.98 * free.certificate.lower_bound
    assert [limit.name for limit in result.limits] == [limit.name for limit in problem.limits]


def test_an_optimum_that_violates_an_omitted_limit_gives_its_bound_alone(problem: Problem, free: Result) -> None:
    (limit,) = problem.limits
    tight = problem.changed(limits=(replace(limit, maximum=0.5 * free.final.value(limit.measure)),))
    own = bounded(free, 0.0, worse=1.5)
    result = solve_by_relaxation(tight, free.problem, lambda _: free, lambda _: own)
    assert free.certificate is not None
    assert own.objective is not None
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == own.objective.value
    assert result.certificate.lower_bound == free.certificate.lower_bound
    assert result.certificate.kind is Proof.LOCAL


def test_a_relaxation_without_any_design_leaves_none(problem: Problem, free: Result) -> None:
    none = replace(free, status=Status.INFEASIBLE, certificate=None)
    result = solve_by_relaxation(problem, free.problem, lambda _: none, lambda _: free)
    assert result.status is Status.INFEASIBLE
    failed = replace(none, status=Status.FAILED)
    assert solve_by_relaxation(problem, free.problem, lambda _: failed, lambda _: free) is free
