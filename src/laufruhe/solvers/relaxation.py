"""Bound a problem by a relaxation without some limits and objective terms (P18).

The relaxation leaves out measures for which a method with a bound has no formulas. Its lower bound holds for the
problem. If its optimum also meets the missing limits and the objective is complete, it is the optimum of the problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from laufruhe.errors import SolverError, counted
from laufruhe.numerics.budget import limit_time, seconds_left
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values, refine_result, with_constant_limits
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status

Solve = Callable[[Problem], Result]


def solve_by_relaxation(problem: Problem, relaxed: Problem, prove: Solve, solve: Solve) -> Result:
    """Return the optimum of an easier problem if it is feasible, else the best known design with its lower bound.

    Parameters
    ----------
    relaxed
        Problem without some limits and some non-negative objective terms; `prove` solves it.
    solve
        Method for the whole problem, which has at least half of the time.
    """
    try:
        with limit_time(0.5 * seconds_left()):
            proven = prove(relaxed)
    except SolverError:
        return solve(problem)
    if proven.status is Status.INFEASIBLE:
        return with_constant_limits(proven, problem.limits)
    candidate, certificate = _with_all_limits(problem, proven), proven.certificate
    if candidate is not None and candidate.status is Status.OPTIMAL:
        return candidate
    result = solve(problem)
    if certificate is None:
        return result
    counts = {
        "limit": len(problem.limits) - len(relaxed.limits),
        "term": len(problem.objective) - len(relaxed.objective),
    }
    left_out = " and ".join(counted(count, name) for name, count in counts.items() if count)
    result = with_better_bound(result, certificate.lower_bound, f"bound without {left_out}")
    if candidate is None or _value(result) <= _value(candidate):
        return result
    other = result.certificate
    return candidate if other is None else with_better_bound(candidate, other.lower_bound, other.method)


def _with_all_limits(problem: Problem, proven: Result) -> Result | None:
    """Return a result without some limits as one of the whole problem; None if its design violates one of them."""
    is_complete = proven.status.has_design and proven.problem.objective == problem.objective
    if not is_complete or proven.final.violation(problem.limits) > FEASIBILITY_TOL:
        return None
    # limits left out of the relaxed problem have no price
    values = dict(zip(proven.problem.limits, proven.limits, strict=True))
    free = {(limit, side): Price(0.0, math.nan) for limit in problem.limits for side in ("at most", "at least")}
    missing_values = limit_values(problem, proven.final, free)
    limits = (values.get(limit, value) for limit, value in zip(problem.limits, missing_values, strict=True))
    return replace(proven, problem=proven.problem.changed(limits=problem.limits), limits=tuple(limits))


def _value(result: Result) -> float:
    is_feasible = result.status.has_design and result.objective is not None
    return result.objective.value if is_feasible and result.objective is not None else math.inf


def with_better_bound(result: Result, bound: float, source: str) -> Result:
    """Return a result with a lower bound [SI] from another source, if that is higher than its own."""
    certificate, objective = result.certificate, result.objective
    if (
        certificate is None
        or objective is None
        or certificate.kind is Proof.NONE
        or not bound > certificate.lower_bound
    ):
        return result
    zero_level = numerical_zero(result.problem, result.final.engine)
    result, value_error = refine_result(result, bound, zero_level)
    value, text = (result.objective or objective).value, f"{certificate.method}; {source}"
    proof = make_certificate(
        value,
        bound,
        zero_level,
        result.problem.tolerance,
        ProofStrength.PARTIAL,
        certificate.kkt_residual,
        text,
        value_error,
    )
    status = Status.OPTIMAL if proof.kind is Proof.GLOBAL else result.status
    return replace(result, certificate=proof, status=status)
