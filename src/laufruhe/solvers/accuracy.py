"""How accurate a result is, and designs whose accuracy was asked for (F10, F11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from laufruhe.fidelity.automatic import choose
from laufruhe.fidelity.error_bounds import error_bound, missed, reference, relative, sampling_error
from laufruhe.numerics.budget import in_time, passed
from laufruhe.problem.evaluation import Evaluation, objective_value, value_of_loads
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result

_ROUNDS = 4


def error_of(problem: Problem, evaluation: Evaluation) -> float:
    """Relative error of the objective, not exceeded: from sampling, or against the reference where that was asked.

    A fidelity chosen by hand is taken as wanted, so that only its samples are judged.
    """
    told = [(term, term.measure.channel) for term in problem.objective]
    runs = [term for term, channel in told if channel.is_checked or channel.of_torque]
    loads = _error_of_loads(problem, evaluation)
    if not runs or evaluation.resonance:
        return loads
    share = value_of_loads(problem, evaluation) * loads
    between = sum(term.weight * missed(term.measure, evaluation) for term in runs)
    return relative(share + between, objective_value(problem, evaluation))


def largest_error(results: Sequence[Result]) -> float:
    """Of several results that make one."""
    return max(result.error_estimate for result in results)


def _error_of_loads(problem: Problem, evaluation: Evaluation) -> float:
    """Relative error of the terms that are loads alone."""
    if not problem.load_terms:
        return 0.0
    if problem.fidelity.tolerance is None:
        return sampling_error(problem, evaluation)
    return error_bound(problem, evaluation, reference(problem, evaluation.engine))


def solve_within(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Solve at the fidelity chosen for the design as given, and choose again until the optimum is accurate too (F11).

    What is left out is the same force for every design, so a share of it that is small
    before balancing may be large after.
    """
    asked = problem.fidelity.tolerance
    result = solve(problem)
    if asked is None or result.certificate is None:
        return result
    for _ in () if passed() else in_time(range(_ROUNDS)):
        # steps of a run-up are those of every fidelity
        if _error_of_loads(result.problem, result.final) <= asked:
            break
        better = choose(problem, asked, result.final.engine).fidelity
        if better == result.problem.fidelity:
            break
        result = solve(problem.at(better))
    return replace(result, error=partial(error_of, result.problem, result.final))
