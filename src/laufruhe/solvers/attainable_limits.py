"""What limits that no design keeps could be met by: the least value of each while the others hold (P16).

A limit is a measure, and so is an objective. The problem that minimises what is limited under the other limits is
decided by whatever method suits it, and its proof is that of any objective. What has no largest value to minimise is
asked for at edges that are halved: each edge is a problem of its own, with a design or with a proof that there is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

from laufruhe.errors import LaufruheError
from laufruhe.numerics.budget import in_time, left, limited, passed
from laufruhe.numerics.progress import report_progress, within
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers.accuracy import error_of
from laufruhe.solvers.conclusion import (
    KEPT,
    broken_limits,
    contradiction,
    infeasible_result,
    limit_values,
    nearest_of,
    quoted,
    read_under,
)
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import AttainableLimit, Nearest, ObjectiveValue

Solve = Callable[[Problem], Result]
LEAST_SECONDS = 10.0
"""All limits together may take so long, or as long as it took to find that there is no design."""
HALVINGS, CLOSE = 10, 1e-3
"""Of the edges of a limit that has no least value to minimise, and the share of it at which they stop."""
LONG = "there was no time left for it; give more by a time limit"


@dataclass(frozen=True, eq=False)
class _Answer:
    """Reached value of one limit, its result, and a flag set if no design keeps the other limits."""

    told: AttainableLimit
    result: Result | None = None
    is_none: bool = False


def with_attainable_limits(
    found: Result, problem: Problem, kinds: Collection[Kind], took: float, solve: Solve
) -> Result:
    """A result without a design, with what each conflicting limit can reach, and with the nearest design.

    A design that was overlooked becomes the result; where a bound shows that there is none, the result says so.

    Parameters
    ----------
    found
        Infeasible or failed.
    problem
        As it was asked.
    kinds
        Of what is open.
    took
        Seconds that `found` did.
    solve
        Decides a problem by the method that suits it.
    """
    wanted = _wanted(found, problem)
    asked = [limit for limit in problem.limits if limit.name in wanted]
    # what the nearest design breaks most is looked at first
    asked.sort(key=lambda limit: found.nearest is None or limit.name != found.nearest.name)
    if not asked or any(extra.open_names for extra in problem.extras):
        return found
    drawn = not problem.extras and not problem.ranks
    solve, answers = partial(_surely, solve, problem) if drawn else solve, []
    # a limit of time that was asked for counts alone
    seconds = None if math.isfinite(left()) else max(LEAST_SECONDS, took)
    with limited(seconds), within(found.message or str(found.status)):
        for k, limit in enumerate(asked):
            report_progress("what limits can reach", k, len(asked))
            with within(f"what '{limit.name}' can reach"), limited(left() / (len(asked) - k)):
                answers.append(_in_time(_answer(limit, problem, kinds, found, solve)))
        if len(found.conflict) > 1 and any(answer.is_none for answer in answers):
            found = _narrowed(found, problem, solve)
    designs = [answer.result for answer in answers if answer.result is not None]
    for result in designs:
        if drawn and result.final.violation(problem.limits) <= KEPT:
            return _recovered(found, problem, result)
    wanted = _wanted(found, problem)
    found = replace(found, reached=tuple(answer.told for answer in answers if answer.told.name in wanted))
    if found.status is Status.FAILED and drawn:
        found = _excluded(found, problem)
    near = _nearest(found, problem, designs) if drawn and found.status is Status.FAILED else None
    return replace(found, nearest=near)


def _surely(solve: Solve, problem: Problem, asked: Problem) -> Result:
    # P7: means at few angles are inexact, so a disagreement is settled at many
    result = solve(asked)
    if not result.status.has_design or result.objective is None:
        return result
    sampled, fine = [limit for limit in problem.limits if limit.measure.is_load], with_fine_sampling(result.final)
    if (result.final.violation(sampled) <= KEPT) is (fine.violation(sampled) <= KEPT):
        return result
    value = objective_value(result.problem, fine)
    return replace(result, final=fine, objective=replace(result.objective, value=value))


def _wanted(found: Result, problem: Problem) -> Collection[str]:
    if found.status is Status.INFEASIBLE:
        return found.conflict
    broken = broken_limits(problem.limits, found.final) if found.decisions else found.nearest and found.nearest.broken
    return broken or [limit.name for limit in problem.limits]


def _answer(limit: Limit, problem: Problem, kinds: Collection[Kind], found: Result, solve: Solve) -> _Answer:
    """Return the value that a limit can reach under the others; of two sides the second if the first is no cause."""
    measure, unsolved = limit.measure, AttainableLimit(limit.name, "at most", limit.maximum, limit.measure.unit)
    if limit.outside is not None:
        return _Answer(replace(unsolved, why="a band is kept or not; no single value can be reached"))
    others = tuple(other for other in problem.limits if other is not limit)
    sides = [("at most", limit.maximum, replace(limit, minimum=-math.inf), replace(limit, maximum=math.inf))]
    sides += [("at least", limit.minimum, *reversed(sides[0][2:]))]
    answer = _Answer(unsolved)
    for side, edge, own, rest in sides:
        if math.isinf(edge):
            continue
        told = replace(unsolved, side=side, limit=edge)
        if passed():
            return _Answer(replace(told, why=LONG))
        if not depends(measure.channel, kinds, problem):
            known = {own.name: own.value for own in found.limits}
            value = math.nan if found.initial.resonance else known.get(limit.name, math.nan)
            return _Answer(replace(told, value=value, why="nothing that is open changes it"))
        held = others if math.isinf(rest.minimum) and math.isinf(rest.maximum) else (*others, rest)
        try:
            if measure.channel.minimised and side == "at most":
                answer = _minimum(told, _asking(problem, (Term(measure),), held), solve)
            else:
                answer = _at_edges(told, own, problem, held, found.status, solve)
        except LaufruheError as error:
            return _Answer(replace(told, why=str(error)))
        if not answer.is_none:
            break
    return answer


def _in_time(answer: _Answer) -> _Answer:
    told = answer.told
    return replace(answer, told=replace(told, ended=passed() and not told.why and told.proof is not Proof.GLOBAL))


def _asking(problem: Problem, objective: tuple[Term, ...], limits: tuple[Limit, ...]) -> Problem:
    # decisions that affect nothing here are left out
    asked = problem.changed(objective=objective, limits=limits, ranks=(), sharply=False)
    if problem.phasing is not None:
        return asked
    felt = [measure.channel for measure in asked.measures]
    moving = tuple(d for d in asked.decisions if any(depends(channel, {d.kind}, asked) for channel in felt))
    return asked.changed(decisions=moving)


def _minimum(told: AttainableLimit, asked: Problem, solve: Solve) -> _Answer:
    """Return the reached value of a measure by minimising it under the other limits."""
    result = solve(asked)
    if not result.status.has_design or result.objective is None:
        return _none(told, result)
    proof = result.certificate
    return _Answer(
        replace(
            told,
            value=result.objective.value,
            bound=proof.lower_bound if proof else math.nan,
            proof=proof.kind if proof else Proof.NONE,
            decisions=result.decisions,
        ),
        result,
    )


def _none(told: AttainableLimit, result: Result) -> _Answer:
    # the other limits have no design either
    if result.status is Status.INFEASIBLE:
        names = quoted(result.conflict)
        why = f"the other limits cannot be met together either{names and ': no design keeps '}{names}"
        return _Answer(replace(told, why=why), is_none=True)
    return _Answer(replace(told, why=LONG if passed() else "no design was found that keeps the other limits"))


def _narrowed(found: Result, problem: Problem, solve: Solve) -> Result:
    # the conflict becomes a smallest set: what breaks a limit on one star may keep it on another
    limits = [limit for limit in problem.limits if limit.name in found.conflict]

    def excluded(kept: Sequence[Limit]) -> bool:
        asked = _asking(problem, problem.objective, tuple(kept))
        return not passed() and solve(asked).status is Status.INFEASIBLE

    names = smallest_conflict(limits, excluded)
    return found if len(names) == len(limits) else replace(found, conflict=names, message=contradiction(names))


def _at_edges(
    told: AttainableLimit, limit: Limit, problem: Problem, others: tuple[Limit, ...], status: Status, solve: Solve
) -> _Answer:
    """Return the reached value of a limit by bisection between its edge and the value of a design without it."""
    high = told.side == "at most"
    first = solve(_asking(problem, problem.objective, others))
    if not first.status.has_design:
        return _none(told, first)
    best, reached = first, _extreme(first, limit, high)
    missed, bound = told.limit, told.limit if status is Status.INFEASIBLE else math.nan
    for _ in in_time(range(HALVINGS)):
        if abs(reached - missed) <= CLOSE * abs(told.limit):
            break
        edge = 0.5 * (reached + missed)
        moved = replace(limit, maximum=edge) if high else replace(limit, minimum=edge)
        found = solve(_asking(problem, problem.objective, (*others, moved)))
        if found.status.has_design:
            best, reached = found, _extreme(found, limit, high)
        else:
            missed, bound = edge, edge if found.status is Status.INFEASIBLE else bound
    proven = Proof.WITHIN_GAP if bound == missed else Proof.LOCAL
    return _Answer(replace(told, value=reached, bound=bound, proof=proven, decisions=best.decisions), best)


def _extreme(result: Result, limit: Limit, high: bool) -> float:
    values = result.final.values(limit.measure)
    return (max if high else min)(values, default=limit.maximum if high else limit.minimum)


def _recovered(found: Result, problem: Problem, result: Result) -> Result:
    """A design that keeps all limits after all, by what bounds are known of the objective."""
    bound, zero_level = (
        found.certificate.lower_bound if found.certificate else 0.0,
        numerical_zero(problem, result.final.engine),
    )
    read = read_under(problem, result.final, objective_value(problem, result.final), bound, zero_level)
    result, value = replace(result, final=read.evaluation), read.value
    how = f"found while {result.problem.objective_name} was minimised"
    proof = make_certificate(
        value, bound, zero_level, problem.tolerance, ProofStrength.RELAXED, math.inf, how, read.doubt
    )
    own = result.problem.changed(objective=problem.objective, limits=problem.limits)
    return replace(
        result,
        problem=own,
        status=Status.OPTIMAL if proof.kind is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, found.initial)),
        certificate=proof,
        decisions=tuple(
            replace(d, shadow_price=math.nan if d.at_bound else 0.0, tightening_price=None) for d in result.decisions
        ),
        limits=limit_values(problem, result.final, {}, value),
        initial=found.initial,
        error=partial(error_of, own, result.final),
    )


def _excluded(found: Result, problem: Problem) -> Result:
    # infeasible if the bound of one limit exceeds it
    for told in found.reached:
        if told.side == "at most" and told.bound > told.limit * (1.0 + KEPT):
            names = tuple(limit.name for limit in problem.limits)
            others = " that keeps the other limits" if len(names) > 1 else ""
            none = infeasible_result(problem, found.initial, names, found.timing)
            message = f"no design exists: none{others} keeps '{told.name}'"
            return replace(none, message=message, reached=found.reached)
    return found


def _nearest(found: Result, problem: Problem, designs: Sequence[Result]) -> Nearest | None:
    # known design with the smallest violation of limits
    known = [found.nearest] if found.nearest is not None else []
    known += [nearest_of(problem, r.final, r.decisions) for r in (*designs, found) if not r.final.resonance]
    return min(known, key=lambda each: each.violation, default=None)
