"""Find the value that each violated limit can attain while the other limits hold (P16).

The limited measure becomes the objective, the other limits stay, and `solve` gives design and lower bound. A measure
that cannot be an objective is bisected: each trial value of the limit is a problem of its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

from laufruhe.errors import LaufruheError
from laufruhe.numerics.budget import is_time_over, limit_time, seconds_left, until_time_limit
from laufruhe.numerics.progress import report_progress, search_scope
from laufruhe.problem.dependence import depends, open_kinds
from laufruhe.problem.evaluation import objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    conflict_message,
    infeasible_result,
    limit_values,
    nearest_record,
    quote_names,
    refine_objective,
    smallest_conflict,
    violated_limits,
)
from laufruhe.solvers.methods import Decide, Diagnosis
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import AttainableLimit, ObjectiveValue

MIN_SECONDS = 10.0
"""Time limit for the attainable values of all limits together [s], if the solve itself took less time."""
HALVINGS, CLOSE = 10, 1e-3
"""Largest number of bisections of a limit, and relative width at which they stop."""
LONG = "there was no time left; raise the time limit"


@dataclass(frozen=True, eq=False)
class _Answer:
    """Attainable value of one limit with its result; `is_infeasible` is True if no design keeps the other limits."""

    attainable: AttainableLimit
    result: Result | None = None
    is_infeasible: bool = False


def with_attainable_limits(result: Result, problem: Problem, spent: float, solve: Decide) -> Result:
    """Return a result without a design with the attainable value of each limit in conflict and the nearest design.

    Other results stay as they are. If the search finds a feasible design, the result becomes that design. If a bound
    excludes all designs, the result becomes infeasible.

    Parameters
    ----------
    problem
        Problem as the caller of `solve` gave it.
    spent
        Duration of the solve [s].
    solve
        Solver for the problem with another objective or other limits.
    """
    if result.status.has_design:
        return result
    names = _violated_names(result, problem)
    limits = [limit for limit in problem.limits if limit.name in names]
    # the largest violation of the nearest design comes first
    limits.sort(key=lambda limit: result.nearest is None or limit.name != result.nearest.name)
    if not limits or any(extra.open_names for extra in problem.extras):
        return result
    is_core = not problem.extras and not problem.ranks
    solve, answers = partial(_solve_with_fine_sampling, solve, problem) if is_core else solve, []
    # a time limit of the caller replaces the default
    seconds = None if math.isfinite(seconds_left()) else max(MIN_SECONDS, spent)
    with limit_time(seconds), search_scope(result.message or str(result.status)):
        for k, limit in enumerate(limits):
            report_progress("attainable limits", k, len(limits))
            with search_scope(f"attainable value of '{limit.name}'"), limit_time(seconds_left() / (len(limits) - k)):
                answer = _find_attainable(limit, problem, result, solve)
                entry = answer.attainable
                is_ended = is_time_over() and not entry.why and entry.proof is not Proof.GLOBAL
                answers.append(replace(answer, attainable=replace(entry, ended=is_ended)))
        if len(result.conflict) > 1 and any(answer.is_infeasible for answer in answers):
            # limits that conflict on one crank star may be met on another

            def excluded(subset: Sequence[Limit]) -> bool:
                part = _subproblem(problem, problem.objective, tuple(subset))
                return not is_time_over() and solve(part).status is Status.INFEASIBLE

            conflicting = [limit for limit in problem.limits if limit.name in result.conflict]
            conflict = smallest_conflict(conflicting, excluded)
            if len(conflict) < len(conflicting):
                result = replace(result, conflict=conflict, message=conflict_message(conflict))
    designs = [answer.result for answer in answers if answer.result is not None]
    for candidate in designs:
        if is_core and candidate.final.violation(problem.limits) <= FEASIBILITY_TOL:
            return _feasible_result(result, problem, candidate)
    names = _violated_names(result, problem)
    result = replace(result, reached=tuple(answer.attainable for answer in answers if answer.attainable.name in names))
    if result.status is not Status.FAILED or not is_core:
        return replace(result, nearest=None)
    for entry in result.reached:
        # the problem is infeasible if the lower bound of a limited measure exceeds its limit
        if entry.side == "at most" and entry.bound > entry.limit * (1.0 + FEASIBILITY_TOL):
            names = tuple(limit.name for limit in problem.limits)
            others = " that meets the other limits" if len(names) > 1 else ""
            message = f"no design exists: none{others} meets '{entry.name}'"
            infeasible = infeasible_result(problem, result.initial, names, result.timing)
            return replace(infeasible, message=message, reached=result.reached)
    known = [result.nearest] if result.nearest is not None else []
    known += [nearest_record(problem, r.final, r.decisions) for r in (*designs, result) if not r.final.resonance]
    return replace(result, nearest=min(known, key=lambda candidate: candidate.violation, default=None))


def _solve_with_fine_sampling(solve: Decide, problem: Problem, part: Problem) -> Result:
    # P7: means of few samples are inexact, so more samples settle a doubt about feasibility
    result = solve(part)
    if not result.status.has_design or result.objective is None:
        return result
    load_limits, fine = [limit for limit in problem.limits if limit.measure.is_load], with_fine_sampling(result.final)
    if (result.final.violation(load_limits) <= FEASIBILITY_TOL) is (fine.violation(load_limits) <= FEASIBILITY_TOL):
        return result
    value = objective_value(result.problem, fine)
    return replace(result, final=fine, objective=replace(result.objective, value=value))


def _violated_names(result: Result, problem: Problem) -> Collection[str]:
    if result.status is Status.INFEASIBLE:
        return result.conflict
    violated = (
        violated_limits(problem.limits, result.final) if result.decisions else result.nearest and result.nearest.broken
    )
    return violated or [limit.name for limit in problem.limits]


def _find_attainable(limit: Limit, problem: Problem, result: Result, solve: Decide) -> _Answer:
    """Return the value that a limited measure can reach while all other limits hold.

    The upper side of the limit comes first. The lower side follows if no design meets it together with the others.
    """
    measure, default = limit.measure, AttainableLimit(limit.name, "at most", limit.maximum, limit.measure.unit)
    if limit.outside is not None:
        return _Answer(replace(default, why="a band has no single attainable value"))
    other_limits = tuple(other for other in problem.limits if other is not limit)
    sides = [("at most", limit.maximum, replace(limit, minimum=-math.inf), replace(limit, maximum=math.inf))]
    sides += [("at least", limit.minimum, *reversed(sides[0][2:]))]
    answer = _Answer(default)
    for side, limit_value, one_side, other_side in sides:
        if math.isinf(limit_value):
            continue
        entry = replace(default, side=side, limit=limit_value)
        if is_time_over():
            return _Answer(replace(entry, why=LONG))
        if not depends(measure.channel, open_kinds(problem), problem):
            known = {entry.name: entry.value for entry in result.limits}
            value = math.nan if result.initial.resonance else known.get(limit.name, math.nan)
            return _Answer(replace(entry, value=value, why="no open number changes it"))
        is_open = math.isinf(other_side.minimum) and math.isinf(other_side.maximum)
        limits = other_limits if is_open else (*other_limits, other_side)
        try:
            if not measure.channel.minimised or side == "at least":
                answer = _bisect(entry, one_side, problem, limits, result.status, solve)
            else:
                optimum = solve(_subproblem(problem, (Term(measure),), limits))
                if optimum.status.has_design and optimum.objective is not None:
                    proof, value = optimum.certificate, optimum.objective.value
                    bound, kind = (proof.lower_bound, proof.kind) if proof else (math.nan, Proof.NONE)
                    attainable = replace(entry, value=value, bound=bound, proof=kind, decisions=optimum.decisions)
                    answer = _Answer(attainable, optimum)
                else:
                    answer = _answer_without_design(entry, optimum)
        except LaufruheError as error:
            return _Answer(replace(entry, why=str(error)))
        if not answer.is_infeasible:
            break
    return answer


def _subproblem(problem: Problem, objective: tuple[Term, ...], limits: tuple[Limit, ...]) -> Problem:
    # leave out decisions that change no measure of this problem
    part = problem.changed(objective=objective, limits=limits, ranks=())
    if problem.phasing is not None:
        return part
    channels = [measure.channel for measure in part.measures]
    decisions = tuple(d for d in part.decisions if any(depends(channel, {d.kind}, part) for channel in channels))
    return part.changed(decisions=decisions)


def _answer_without_design(entry: AttainableLimit, result: Result) -> _Answer:
    # if the other limits alone are infeasible, this limit has no attainable value
    if result.status is Status.INFEASIBLE:
        names = quote_names(result.conflict)
        reason = f"the other limits cannot be met together either{names and ': no design meets '}{names}"
        return _Answer(replace(entry, why=reason), is_infeasible=True)
    return _Answer(replace(entry, why=LONG if is_time_over() else "no design was found that meets the other limits"))


def _bisect(
    entry: AttainableLimit, limit: Limit, problem: Problem, others: tuple[Limit, ...], status: Status, solve: Decide
) -> _Answer:
    """Return the value that a limited measure can reach, by bisection of the limit.

    The bisection starts from the limit as given and from the value of a design without this limit.
    """
    is_maximum = entry.side == "at most"
    unlimited = solve(_subproblem(problem, problem.objective, others))
    if not unlimited.status.has_design:
        return _answer_without_design(entry, unlimited)

    def extreme(result: Result) -> float:
        values = result.final.values(limit.measure)
        return (max if is_maximum else min)(values, default=limit.maximum if is_maximum else limit.minimum)

    nearest, value = unlimited, extreme(unlimited)
    unreached, bound = entry.limit, entry.limit if status is Status.INFEASIBLE else math.nan
    for _ in until_time_limit(range(HALVINGS)):
        if abs(value - unreached) <= CLOSE * abs(entry.limit):
            break
        middle = 0.5 * (value + unreached)
        bisected = replace(limit, maximum=middle) if is_maximum else replace(limit, minimum=middle)
        candidate = solve(_subproblem(problem, problem.objective, (*others, bisected)))
        if candidate.status.has_design:
            nearest, value = candidate, extreme(candidate)
        else:
            unreached, bound = middle, middle if candidate.status is Status.INFEASIBLE else bound
    proven = Proof.WITHIN_GAP if bound == unreached else Proof.LOCAL
    return _Answer(replace(entry, value=value, bound=bound, proof=proven, decisions=nearest.decisions), nearest)


def _feasible_result(result: Result, problem: Problem, candidate: Result) -> Result:
    """Return the feasible design of the result `candidate` with the lower bound of the original problem's objective."""
    bound = result.certificate.lower_bound if result.certificate else 0.0
    zero_level, value = numerical_zero(problem, candidate.final.engine), objective_value(problem, candidate.final)
    final, value, value_error = refine_objective(problem, candidate.final, value, bound, zero_level)
    method = f"found while {candidate.problem.objective_name} was minimised"
    proof = make_certificate(
        value, bound, zero_level, problem.tolerance, ProofStrength.RELAXED, math.inf, method, value_error
    )
    restored = candidate.problem.changed(objective=problem.objective, limits=problem.limits)
    return replace(
        candidate,
        problem=restored,
        status=Status.OPTIMAL if proof.kind is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, result.initial)),
        certificate=proof,
        decisions=tuple(d.without_price() for d in candidate.decisions),
        limits=limit_values(problem, final, {}, value),
        initial=result.initial,
        final=final,
        error=partial(objective_error, restored, final),
    )


DIAGNOSIS = Diagnosis("attainable limits", with_attainable_limits)
