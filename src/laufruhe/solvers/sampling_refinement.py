"""What many angles tell otherwise than those of a fidelity: a mean at few is not what it is over the cycle (P7).

Whichever method decides, a design that keeps a limit at its own angles alone is none, one that these alone forbid is
not to be missed, and a gap is not to be left open for what they read too much: it is solved again at more of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from laufruhe.fidelity.error_bounds import missed
from laufruhe.numerics.budget import rounds
from laufruhe.numerics.witness import check_bound
from laufruhe.problem.evaluation import (
    FINE_SAMPLES,
    Evaluation,
    finer,
    is_coarsely_sampled,
    objective_value,
    with_default_sampling,
    with_fine_sampling,
)
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, gap_of
from laufruhe.solvers.conclusion import KEPT, broken_message, limit_values
from laufruhe.solvers.result import Result, Status

ROUNDS, MOST_TIMES = 4, 16
"""Times that more angles are taken, and how many times as many at once."""
FELT, LEAST_TIMES = 0.1, 2.0
"""Share of the tolerance by which an objective may be misread, and tolerances that more count as at least."""


def refine_sampling(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Solve, and again at more angles where many tell otherwise than these do; what time leaves is judged at many."""
    result = solve(problem)
    for _ in rounds(ROUNDS):
        own = problem.fidelity
        untold = _sampling_disagreement(result) if own.samples < FINE_SAMPLES else 0.0
        if untold <= 1.0:
            return result
        # means at equal steps come nearer by the square of these; the gas keeps its own
        problem = finer(problem, min(math.ceil(math.sqrt(2.0 * untold)), MOST_TIMES))
        result = solve(problem)
    return result if _sampling_disagreement(result) <= 1.0 else _evaluated_at_fine_sampling(result)


def _sampling_disagreement(result: Result) -> float:
    # disagreement at many angles, relative to the tolerances
    return max(_untold(result) / KEPT, _misproven(result))


def _evaluated_at_fine_sampling(result: Result) -> Result:
    """A design whose angles were too few, and which time or rounds left so, judged at many."""
    problem, told, proof = result.problem, result.objective, result.certificate
    if told is None or proof is None or not result.status.has_design:
        return result
    value = told.value - _misread(problem, result.measured)
    final = with_fine_sampling(result.final) if result.measured is result.final else result.final
    zero_level = numerical_zero(problem, final.engine)
    gap = gap_of(value, proof.lower_bound, zero_level)
    doubt = sum(term.weight * missed(term.measure, final) for term in problem.objective)
    check_bound(proof.method, proof.lower_bound, value, zero_level + doubt)
    weaker = Proof.WITHIN_GAP if proof.kind is Proof.GLOBAL else proof.kind
    met = violation_at_fine_sampling(problem, result.final) <= KEPT or result.measured is not result.final
    kind = Proof.NONE if not met else Proof.GLOBAL if gap <= problem.tolerance else weaker
    status = Status.FAILED if not met else Status.OPTIMAL if kind is Proof.GLOBAL else Status.FEASIBLE
    return replace(
        result,
        status=status,
        objective=replace(told, value=value),
        certificate=replace(proof, kind=kind, gap=gap),
        limits=limit_values(problem, final, result.prices, value) if result.measured is result.final else result.limits,
        final=final,
        message=result.message if met else broken_message(problem, final),
    )


def violation_at_fine_sampling(problem: Problem, evaluation: Evaluation) -> float:
    """Largest relative excess that many angles tell over a limit which few tell of; negative where all have room."""
    limits = _coarsely_sampled_limits(problem, evaluation)
    return with_fine_sampling(evaluation).violation(limits) if limits else -math.inf


def _coarsely_sampled_limits(problem: Problem, evaluation: Evaluation) -> list[Limit]:
    # load limits evaluated at few angles
    loads = [limit for limit in problem.load_limits if limit.measure.is_load]
    return [limit for limit in loads if is_coarsely_sampled(limit.measure, evaluation.samples)]


def _untold(result: Result) -> float:
    # relative violation at many angles; without a design, the difference between few and many
    problem, own = result.problem, result.final
    if result.status is Status.INFEASIBLE or own.resonance:
        return 0.0
    if result.status.has_design:
        return violation_at_fine_sampling(problem, own)
    few = replace(own, samples=problem.fidelity.samples)
    limits, many = _coarsely_sampled_limits(problem, few), with_fine_sampling(few)
    # what a search missed at fewer angles than by default is sought at these, wherever the design as given stands
    minimum = 0.5 * KEPT * (with_default_sampling(problem).fidelity.samples / few.samples) ** 2
    return max((max(minimum, abs(many.standing(x).violation - few.standing(x).violation)) for x in limits), default=0.0)


def _misread(problem: Problem, evaluation: Evaluation) -> float:
    # objective at few angles less that at many
    terms = [term for term in problem.load_terms if is_coarsely_sampled(term.measure, evaluation.samples)]
    if not terms or evaluation.resonance:
        return 0.0
    told = replace(problem, objective=tuple(terms))
    return objective_value(told, evaluation) - objective_value(told, with_fine_sampling(evaluation))


def over_read(problem: Problem, evaluation: Evaluation) -> float:
    """Return the excess of an objective at few angles over that at many; zero within the tolerance."""
    over = _misread(problem, evaluation)
    return over if over > problem.tolerance * objective_value(problem, evaluation) else 0.0


def _misproven(result: Result) -> float:
    """Tolerances by which an objective is misread, where many angles tell otherwise of its proof; else zero."""
    problem, proof, told = result.problem, result.certificate, result.objective
    if proof is None or told is None or not result.status.has_design or not problem.search.proves:
        return 0.0
    over = _misread(problem, result.measured)
    value = told.value - over
    if abs(over) <= FELT * problem.tolerance * value:
        return 0.0
    zero_level = numerical_zero(problem, result.final.engine)
    proven = gap_of(value, proof.lower_bound, zero_level) <= problem.tolerance
    # a bound over the value is none
    agree = proven is (proof.gap <= problem.tolerance) and proof.lower_bound <= value * (1.0 + problem.tolerance)
    return 0.0 if agree else max(abs(over) / (problem.tolerance * value), LEAST_TIMES)
