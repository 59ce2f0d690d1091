"""How accurate a result is, and designs whose accuracy was asked for (F10, F11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from laufruhe.fidelity.automatic import choose
from laufruhe.fidelity.error_bounds import error_bound, missed, missed_of_gas, reference, relative, sampling_error
from laufruhe.numerics.budget import in_time, passed
from laufruhe.physics.fidelity import EXACT
from laufruhe.problem.evaluation import Evaluation, objective_value, value_of_loads
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Proof, gap_of
from laufruhe.solvers.result import Result, Status

_ROUNDS = 4
TIMES, MOST_GAS = 4, 23040
"""Times as many steps of the gas at once, and most of them."""


def error_of(problem: Problem, evaluation: Evaluation) -> float:
    """Relative error of the objective, not exceeded: from sampling, or against the reference where that was asked.

    A fidelity chosen by hand is taken as wanted, so that only its samples are judged.
    """
    told = [(term, term.measure.channel) for term in problem.objective]
    runs = [term for term, channel in told if channel.simulation or channel.of_torque]
    loads = _error_of_loads(problem, evaluation)
    if not runs or evaluation.resonance:
        return loads
    share = value_of_loads(problem, evaluation) * loads
    between = sum(term.weight * missed(term.measure, evaluation) for term in runs)
    return relative(share + between, objective_value(problem, evaluation))


def largest_error(results: Sequence[Result]) -> float:
    """Return the largest relative error of several results."""
    return max(result.error_estimate for result in results)


def _error_of_loads(problem: Problem, evaluation: Evaluation) -> float:
    if not problem.load_terms:
        return 0.0
    if problem.fidelity.tolerance is None:
        return sampling_error(problem, evaluation)
    return error_bound(problem, evaluation, reference(problem, evaluation.engine))


def _with_gas(problem: Problem, solve: Callable[[Problem], Result], result: Result) -> Result:
    """Solve at more steps of the gas while these miss more than the tolerance; what they miss is no proof.

    Fewer steps than by default, or a number of their own, were chosen by hand and are taken as wanted.
    """
    own = problem.fidelity
    if own.gas_samples is not None or own.samples < EXACT.samples or result.final.resonance or not problem.load_terms:
        return result
    (missed, between), steps = missed_of_gas(problem, result.final), own.gas_steps
    while missed > problem.tolerance * value_of_loads(problem, result.final) and steps < MOST_GAS and not passed():
        steps *= TIMES
        result = solve(problem.at(replace(own, gas_samples=steps)))
        if result.certificate is None:
            return result
        missed, between = missed_of_gas(result.problem, result.final)
    proof, told, missed = result.certificate, result.objective, missed + between
    if told is None or proof is None or missed <= problem.tolerance * value_of_loads(problem, result.final):
        return result
    bound, zero_level = max(proof.lower_bound - missed, 0.0), numerical_zero(result.problem, result.final.engine)
    weaker = replace(
        proof, kind=min(proof.kind, Proof.WITHIN_GAP, key=PROOF_RANK), lower_bound=bound,
        gap=gap_of(told.value, bound, zero_level), method=f"{proof.method}, less what the gas may miss",
    )  # fmt: skip
    status = Status.FEASIBLE if result.status is Status.OPTIMAL else result.status
    return replace(result, status=status, certificate=weaker)


def solve_within(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Solve at the fidelity chosen for the design as given, and choose again until the optimum is accurate too (F11).

    What is left out is the same force for every design, so a share of it that is small
    before balancing may be large after.
    """
    asked = problem.fidelity.tolerance
    result = solve(problem)
    if result.certificate is None:
        return result
    if asked is None:
        return _with_gas(problem, solve, result)
    for _ in () if passed() else in_time(range(_ROUNDS)):
        # steps of a simulation are the same at every fidelity
        if _error_of_loads(result.problem, result.final) <= asked:
            break
        better = choose(problem, asked, result.final.engine).fidelity
        if better == result.problem.fidelity:
            break
        result = solve(problem.at(better))
    return replace(result, error=partial(error_of, result.problem, result.final))
