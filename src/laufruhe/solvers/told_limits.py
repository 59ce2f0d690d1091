"""What many angles tell otherwise than those of a fidelity: a mean at few is not what it is over the cycle (P7).

Whichever method decides, a design that keeps a limit at its own angles alone is none, one that these alone forbid is
not to be missed, and a gap is not to be left open for what they read too much: it is solved again at more of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from laufruhe.numerics.budget import rounds
from laufruhe.problem.evaluation import FINE, Evaluation, finely, is_of_few, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import KEPT
from laufruhe.solvers.result import Result, Status

ROUNDS, MOST_TIMES = 4, 16
"""Times that more angles are taken, and how many times as many at once."""


def solve_told(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Solve, and again at more angles where many tell otherwise than these do."""
    result = solve(problem)
    for _ in rounds(ROUNDS):
        own = problem.fidelity
        untold = max(_untold(result) / KEPT, _open_gap(result)) if own.samples < FINE else 0.0
        if untold <= 1.0:
            break
        # means at equal steps come nearer by the square of these; the gas keeps its own
        times = min(math.ceil(math.sqrt(2.0 * untold)), MOST_TIMES)
        problem = problem.at(replace(own, samples=times * own.samples, gas_samples=own.gas_steps))
        result = solve(problem)
    return result


def told_excess(problem: Problem, evaluation: Evaluation) -> float:
    """Largest relative excess that many angles tell over a limit which few tell of; negative where all have room."""
    limits = _told_by_few(problem, evaluation)
    return finely(evaluation).excess(limits) if limits else -math.inf


def _told_by_few(problem: Problem, evaluation: Evaluation) -> list[Limit]:
    """Limits on loads that are read at few angles."""
    loads = [limit for limit in problem.load_limits if limit.measure.is_load]
    return [limit for limit in loads if is_of_few(limit.measure, evaluation.samples)]


def _untold(result: Result) -> float:
    """Share of a limit by which many angles break one that a design keeps, or tell it otherwise where there is none."""
    problem, own = result.problem, result.final
    if result.status is Status.INFEASIBLE or own.resonance:
        return 0.0
    if result.status.has_design:
        return told_excess(problem, own)
    few = replace(own, samples=problem.fidelity.samples)
    limits, many = _told_by_few(problem, few), finely(few)
    return max((abs(many.standing(x).excess - few.standing(x).excess) for x in limits), default=0.0)


def over_read(problem: Problem, evaluation: Evaluation) -> float:
    """By how much few angles read an objective of loads too large, where that is more than the tolerance; else zero."""
    terms = [term for term in problem.load_terms if is_of_few(term.measure, evaluation.samples)]
    if not terms or evaluation.resonance:
        return 0.0
    told, value = replace(problem, objective=tuple(terms)), objective_value(problem, evaluation)
    over = objective_value(told, evaluation) - objective_value(told, finely(evaluation))
    return over if over > problem.tolerance * value else 0.0


def _open_gap(result: Result) -> float:
    """Tolerances by which an objective is read too large, where nothing else keeps its gap open; else zero."""
    problem, proof = result.problem, result.certificate
    if proof is None or not result.status.has_design or not problem.tolerance < proof.gap or not problem.search.proves:
        return 0.0
    over = over_read(problem, result.final) / (objective_value(problem, result.final) or 1.0)
    return over / problem.tolerance if proof.gap - over <= problem.tolerance else 0.0
