"""Estimate the accuracy of results, and solve again at a better fidelity (F10, F11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from laufruhe.fidelity.automatic import choose
from laufruhe.fidelity.error_bounds import (
    ErrorReference,
    gas_sampling_errors,
    measure_sampling_error,
    relative,
    sampling_error,
)
from laufruhe.numerics.budget import is_time_over, until_time_limit
from laufruhe.physics.fidelity import EXACT
from laufruhe.problem.evaluation import Evaluation, objective_value, value_of_loads
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Proof, gap_of
from laufruhe.solvers.result import Result, Status

_ROUNDS = 4
"""Largest number of further solves at a better fidelity."""
TIMES, MAX_GAS = 4, 23040
"""Factor by which the number of gas pressure steps grows in each round, and its largest value per cycle."""


def objective_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return an upper bound of the relative error of a design's objective from samples and simplified physics.

    With an automatic fidelity the error is against the reference physics. A fidelity that the file states counts as
    exact, so only the error of sampling remains.
    """
    terms = [(term, term.measure.channel) for term in problem.objective]
    runs = [term for term, channel in terms if channel.simulation or channel.depends_on_torque]
    load_error = _error_of_loads(problem, evaluation)
    if not runs or evaluation.resonance:
        return load_error
    load_value_error = value_of_loads(problem, evaluation) * load_error
    run_error = sum(term.weight * measure_sampling_error(term.measure, evaluation) for term in runs)
    return relative(load_value_error + run_error, objective_value(problem, evaluation))


def largest_error(results: Sequence[Result]) -> float:
    """Return the largest relative error of several results."""
    return max(result.error_estimate for result in results)


def _error_of_loads(problem: Problem, evaluation: Evaluation) -> float:
    if not problem.load_terms:
        return 0.0
    if problem.fidelity.tolerance is None:
        return sampling_error(problem, evaluation)
    return ErrorReference.of(problem, evaluation.engine).error_of(evaluation)


def _with_gas(problem: Problem, solve: Callable[[Problem], Result], result: Result) -> Result:
    """Return the result of a solve with enough steps of the gas pressure for the problem's tolerance.

    If the error stays larger, subtract it from the lower bound. Keep a number of steps that the file states.
    """
    fidelity = problem.fidelity
    if (
        fidelity.gas_samples is not None
        or fidelity.samples < EXACT.samples
        or result.final.resonance
        or not problem.load_terms
    ):
        return result
    (gas_error, interpolated), steps = gas_sampling_errors(problem, result.final), fidelity.gas_steps
    while (
        gas_error > problem.tolerance * value_of_loads(problem, result.final) and steps < MAX_GAS and not is_time_over()
    ):
        steps *= TIMES
        result = solve(problem.at(replace(fidelity, gas_samples=steps)))
        if result.certificate is None:
            return result
        gas_error, interpolated = gas_sampling_errors(result.problem, result.final)
    proof, objective, gas_error = result.certificate, result.objective, gas_error + interpolated
    if objective is None or proof is None or gas_error <= problem.tolerance * value_of_loads(problem, result.final):
        return result
    bound, zero_level = max(proof.lower_bound - gas_error, 0.0), numerical_zero(result.problem, result.final.engine)
    weaker = replace(
        proof, kind=min(proof.kind, Proof.WITHIN_GAP, key=PROOF_RANK), lower_bound=bound,
        gap=gap_of(objective.value, bound, zero_level), method=f"{proof.method}, less the error of the gas pressure",
    )  # fmt: skip
    status = Status.FEASIBLE if result.status is Status.OPTIMAL else result.status
    return replace(result, status=status, certificate=weaker)


def solve_accurately(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Return the result of `solve` at a fidelity at which the optimum is as accurate as the file demands (F11).

    The physics that a fidelity leaves out adds a fixed force. This may be a small share of the initial forces and a
    large share of the optimal ones.
    """
    tolerance = problem.fidelity.tolerance
    result = solve(problem)
    if result.certificate is None:
        return result
    if tolerance is None:
        return _with_gas(problem, solve, result)
    for _ in () if is_time_over() else until_time_limit(range(_ROUNDS)):
        # a simulation has the same time steps at every fidelity
        if _error_of_loads(result.problem, result.final) <= tolerance:
            break
        better = choose(problem, tolerance, result.final.engine).fidelity
        if better == result.problem.fidelity:
            break
        result = solve(problem.at(better))
    return replace(result, error=partial(objective_error, result.problem, result.final))
