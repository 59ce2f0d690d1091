"""Estimate the accuracy of results, and solve again with more steps of the gas (F9, F9a)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.numerics.budget import is_time_over
from laufruhe.physics.fidelity import EXACT
from laufruhe.problem.error_bounds import (
    gas_step_bound,
    measure_sampling_error,
    relative,
    sampling_error,
    trace_error,
)
from laufruhe.problem.evaluation import Evaluation, objective_value, value_of_loads
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Proof, relative_gap
from laufruhe.solvers.result import Result, Status

TIMES, MAX_GAS = 4, 23040
"""Factor by which the number of gas pressure steps grows in each round, and its largest value per cycle."""


def objective_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the relative error of the objective from sampling; the physics of the fidelity counts as exact."""
    terms = [(term, term.measure.channel) for term in problem.objective]
    runs = [term for term, channel in terms if channel.simulation or channel.depends_on_torque]
    load_error = sampling_error(problem, evaluation) if problem.load_terms else 0.0
    if not runs or evaluation.resonance:
        return load_error
    load_value_error = value_of_loads(problem, evaluation) * load_error
    run_error = sum(term.weight * measure_sampling_error(term.measure, evaluation) for term in runs)
    return relative(load_value_error + run_error, objective_value(problem, evaluation))


def largest_error(results: Sequence[Result]) -> float:
    """Return the largest relative error of several results."""
    return max(result.error_estimate for result in results)


def solve_accurately(problem: Problem, solve: Callable[[Problem], Result]) -> Result:
    """Call `solve`, and repeat it with more steps of the gas pressure until their error is within the tolerance.

    If the error stays larger, subtract it from the lower bound. Keep a number of steps that the file states.
    """
    result = solve(problem)
    fidelity = problem.fidelity
    if (
        fidelity.gas_samples is not None
        or fidelity.samples < EXACT.samples
        or result.final.resonance
        or not problem.load_terms
        or result.certificate is None
    ):
        return result
    gas_error, steps = gas_step_bound(problem, result.final), fidelity.gas_steps
    tolerance = min(problem.tolerance, fidelity.tolerance or 1.0)
    while gas_error > tolerance * value_of_loads(problem, result.final) and steps < MAX_GAS and not is_time_over():
        steps *= TIMES
        result = solve(problem.at(replace(fidelity, gas_samples=steps)))
        if result.certificate is None:
            return result
        gas_error = gas_step_bound(result.problem, result.final)
    gas_error += trace_error(result.problem, result.final)
    proof, objective = result.certificate, result.objective
    if objective is None or proof is None or gas_error <= problem.tolerance * value_of_loads(problem, result.final):
        return result
    bound, zero_level = max(proof.lower_bound - gas_error, 0.0), numerical_zero(result.problem, result.final.engine)
    weaker = replace(
        proof, kind=min(proof.kind, Proof.WITHIN_GAP, key=PROOF_RANK), lower_bound=bound,
        gap=relative_gap(objective.value, bound, zero_level),
        method=f"{proof.method}, less the error of the gas pressure",
    )  # fmt: skip
    status = Status.FEASIBLE if result.status is Status.OPTIMAL else result.status
    return replace(result, status=status, certificate=weaker)
