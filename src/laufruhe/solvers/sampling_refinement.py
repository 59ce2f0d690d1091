"""Solve again with more samples where too few of them change the result (P7).

A mean of few samples differs from the mean over the cycle. This may hide a violation, exclude a feasible design, or
leave a gap open.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from laufruhe.numerics.budget import timed_rounds
from laufruhe.numerics.witness import check_bound
from laufruhe.problem.error_bounds import measure_sampling_error
from laufruhe.problem.evaluation import (
    FINE_SAMPLES,
    Evaluation,
    is_coarsely_sampled,
    objective_value,
    with_default_sampling,
    with_fine_sampling,
    with_more_samples,
)
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, gap_of, relative_gap
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values, violation_message
from laufruhe.solvers.result import Result, Status

ROUNDS, MAX_TIMES = 4, 16
"""Largest number of refinements, and largest factor of the samples in one of them."""
SMALL_ERROR, LARGE_ERROR = 0.1, 2.0
"""Sampling error of the objective that counts as none, and smallest value of an error that changes the proof; in
tolerances."""


def refine_sampling(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Return the result of `solve` with enough samples per cycle: fine sampling confirms its limits and gap."""
    result = solve(problem)
    for _ in timed_rounds(ROUNDS):
        fidelity = problem.fidelity
        disagreement = _sampling_disagreement(result) if fidelity.samples < FINE_SAMPLES else 0.0
        if disagreement <= 1.0:
            return result
        # the error of a mean falls with the square of the step; the gas pressure keeps its samples
        problem = with_more_samples(problem, min(math.ceil(math.sqrt(2.0 * disagreement)), MAX_TIMES))
        result = solve(problem)
    return result if _sampling_disagreement(result) <= 1.0 else _with_fine_values(result)


def _sampling_disagreement(result: Result) -> float:
    # largest difference to fine sampling, in tolerances
    return max(_limit_disagreement(result) / FEASIBILITY_TOL, _gap_disagreement(result))


def _with_fine_values(result: Result) -> Result:
    """Return a result with values, limits and gap computed again from many samples per cycle."""
    problem, objective, proof = result.problem, result.objective, result.certificate
    if objective is None or proof is None or not result.status.has_design:
        return result
    value = objective.value - _sampling_error(problem, result.measured)
    final = with_fine_sampling(result.final) if result.measured is result.final else result.final
    zero_level = numerical_zero(problem, final.engine)
    value_error = sum(term.weight * measure_sampling_error(term.measure, final) for term in problem.objective)
    check_bound(proof.method, proof.lower_bound, value, zero_level + value_error)
    is_closed = gap_of(value, proof.lower_bound, zero_level) <= problem.tolerance
    weaker_kind = Proof.WITHIN_GAP if proof.kind is Proof.GLOBAL else proof.kind
    is_feasible = (
        violation_at_fine_sampling(problem, result.final) <= FEASIBILITY_TOL or result.measured is not result.final
    )
    kind = Proof.NONE if not is_feasible else Proof.GLOBAL if is_closed else weaker_kind
    status = Status.FAILED if not is_feasible else Status.OPTIMAL if kind is Proof.GLOBAL else Status.FEASIBLE
    return replace(
        result,
        status=status,
        objective=replace(objective, value=value),
        certificate=replace(proof, kind=kind, gap=relative_gap(value, proof.lower_bound, zero_level)),
        limits=limit_values(problem, final, result.prices, value) if result.measured is result.final else result.limits,
        final=final,
        message=result.message if is_feasible else violation_message(problem, final),
    )


def violation_at_fine_sampling(problem: Problem, evaluation: Evaluation) -> float:
    """Return the largest relative violation of coarsely sampled limits at fine sampling; -inf without such limits."""
    limits = _coarsely_sampled_limits(problem, evaluation)
    return with_fine_sampling(evaluation).violation(limits) if limits else -math.inf


def _coarsely_sampled_limits(problem: Problem, evaluation: Evaluation) -> list[Limit]:
    # limits on loads with few samples
    loads = [limit for limit in problem.load_limits if limit.measure.is_load]
    return [limit for limit in loads if is_coarsely_sampled(limit.measure, evaluation.samples)]


def _limit_disagreement(result: Result) -> float:
    # relative violation at fine sampling; without a design, the difference between coarse and fine sampling
    problem, evaluation = result.problem, result.final
    if result.status is Status.INFEASIBLE or evaluation.resonance:
        return 0.0
    if result.status.has_design:
        return violation_at_fine_sampling(problem, evaluation)
    coarse = replace(evaluation, samples=problem.fidelity.samples)
    limits, fine = _coarsely_sampled_limits(problem, coarse), with_fine_sampling(coarse)
    # a failed search with fewer samples than the default is repeated with the default
    minimum = 0.5 * FEASIBILITY_TOL * (with_default_sampling(problem).fidelity.samples / coarse.samples) ** 2
    return max(
        (max(minimum, abs(fine.check_limit(x).violation - coarse.check_limit(x).violation)) for x in limits),
        default=0.0,
    )


def _sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    # objective at coarse sampling less that at fine sampling
    terms = [term for term in problem.load_terms if is_coarsely_sampled(term.measure, evaluation.samples)]
    if not terms or evaluation.resonance:
        return 0.0
    part = replace(problem, objective=tuple(terms))
    return objective_value(part, evaluation) - objective_value(part, with_fine_sampling(evaluation))


def sampling_overestimate(problem: Problem, evaluation: Evaluation) -> float:
    """Return the excess of an objective at coarse sampling over that at fine sampling; zero within the tolerance."""
    excess = _sampling_error(problem, evaluation)
    return excess if excess > problem.tolerance * objective_value(problem, evaluation) else 0.0


def _gap_disagreement(result: Result) -> float:
    """Return the sampling error of the objective in tolerances if the file forbids it or the proof changes, else zero.

    An automatic fidelity states the error that it allows (F11).
    """
    problem, proof, objective = result.problem, result.certificate, result.objective
    if proof is None or objective is None or not result.status.has_design or not problem.search.proves:
        return 0.0
    excess = _sampling_error(problem, result.measured)
    value = objective.value - excess
    demanded = problem.fidelity.tolerance
    if demanded is not None and abs(excess) > demanded * value:
        return max(abs(excess) / (demanded * value), LARGE_ERROR) if value > 0.0 else LARGE_ERROR
    if abs(excess) <= SMALL_ERROR * problem.tolerance * value:
        return 0.0
    zero_level = numerical_zero(problem, result.final.engine)
    proven, stated = (gap_of(v, proof.lower_bound, zero_level) <= problem.tolerance for v in (value, objective.value))
    # a lower bound above the objective proves nothing
    is_same = proven is stated and proof.lower_bound <= value * (1.0 + problem.tolerance)
    return 0.0 if is_same else max(abs(excess) / (problem.tolerance * value), LARGE_ERROR)
