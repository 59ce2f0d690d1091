"""A problem without some limits and terms of its objective: what no design of it goes under, none of all does (P18).

What a method with a closing bound does not know is left out for that method alone. Where its optimum keeps the limits
that are left out, it is the optimum under them too; where it does not, its bound holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from laufruhe.errors import counted
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers.conclusion import KEPT, limit_values, result_under, with_limits
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status

Solve = Callable[[Problem], Result]
PARTS = (("limits", "limit"), ("objective", "term"))


def solve_by_relaxation(problem: Problem, fewer: Problem, prove: Solve, solve: Solve) -> Result:
    """Return the optimum of less than is asked where it keeps all limits, else a design under all with that bound.

    Parameters
    ----------
    problem
        All that is asked.
    fewer
        The same with some of its limits, and some of the terms of its objective.
    prove, solve
        Methods of `fewer` and of `problem`.
    """
    known = prove(fewer)
    if known.status is Status.INFEASIBLE:
        return with_limits(known, problem.limits)
    certificate = known.certificate
    proven = certificate is not None and certificate.kind is Proof.GLOBAL and fewer.objective == problem.objective
    if proven and known.final.violation(problem.limits) <= KEPT:
        return _under_all(known, problem)
    found = solve(problem)
    if certificate is None:
        return found
    counts = ((len(getattr(problem, what)) - len(getattr(fewer, what)), name) for what, name in PARTS)
    left_out = " and ".join(counted(count, name) for count, name in counts if count)
    return with_bound(found, certificate.lower_bound, f"bound without {left_out}")


def _under_all(known: Result, problem: Problem) -> Result:
    # limits left out of the relaxed problem have no price
    own = dict(zip(known.problem.limits, known.limits, strict=True))
    free = {(limit, side): Price(0.0, math.nan) for limit in problem.limits for side in ("at most", "at least")}
    shown = limit_values(problem, known.final, free)
    limits = (own.get(limit, value) for limit, value in zip(problem.limits, shown, strict=True))
    return replace(known, problem=known.problem.changed(limits=problem.limits), limits=tuple(limits))


def with_bound(result: Result, bound: float, source: str) -> Result:
    """Return a result with a bound that is known from elsewhere, where it is over its own."""
    own, told = result.certificate, result.objective
    if own is None or told is None or own.kind is Proof.NONE or not bound > own.lower_bound:
        return result
    zero_level = numerical_zero(result.problem, result.final.engine)
    result, doubt = result_under(result, bound, zero_level)
    value, text = (result.objective or told).value, f"{own.method}; {source}"
    proof = make_certificate(
        value, bound, zero_level, result.problem.tolerance, ProofStrength.PARTIAL, own.kkt_residual, text, doubt
    )
    status = Status.OPTIMAL if proof.kind is Proof.GLOBAL else result.status
    return replace(result, certificate=proof, status=status)
