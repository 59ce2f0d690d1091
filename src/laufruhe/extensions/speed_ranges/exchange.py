"""Design for a speed range by exchange (P22): solve for finitely many speeds, add the peaks of the design, repeat.

The problem at finitely many speeds relaxes that of the range, so its lower bound holds for the range. The value of the
result is that at the peak found over the whole range (P23).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

from laufruhe.errors import InputError, ModelError, SolverError, counted
from laufruhe.extensions.speed_ranges.peaks import RangeResponses, Response
from laufruhe.extensions.speed_ranges.ranges import SpeedRange, SpeedRanges, Speeds, at_speeds, with_speeds
from laufruhe.files.complaints import Refused
from laufruhe.files.measures import MeasureContext
from laufruhe.numerics.budget import timed_rounds
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers import methods
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values, refine_objective, violation_message
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import ObjectiveValue

ROUNDS, TOPS = 25, 8
"""Most rounds of exchange, and most peaks of a range that one of them adds."""
PEAKS_IN_TABLES = 3
"""Peaks of a range that tables show as operating points."""
DISTINCT = 1e-6
"""Relative distance of two speeds that have names of their own."""
TIGHT = 0.1
"""Share of a tolerance by which a peak may exceed the speeds of the program."""
_STRENGTHS = {
    Proof.GLOBAL: ProofStrength.EXACT, Proof.WITHIN_GAP: ProofStrength.EXACT, Proof.LOCAL: ProofStrength.RELAXED,
}  # fmt: skip


def _ranges_of(problem: Problem) -> tuple[SpeedRange, ...]:
    extra = problem.extra(SpeedRanges)
    return () if extra is None else extra.ranges


def refuse(problem: Problem) -> None:
    """Raise an error for ranges that do not fit the engine, and for problems that no method solves."""
    ranges = _ranges_of(problem)
    others = [extra.words for extra in problem.extras if not isinstance(extra, SpeedRanges)]
    if others:
        raise ModelError(f"speed ranges are not decided together with {others[0]}; remove one of both tables")
    _refuse_ranges(problem)
    methods.refuse(at_speeds(problem, ranges, {span.name: (span.low, span.high) for span in ranges}))


def _refuse_ranges(problem: Problem) -> None:
    context = MeasureContext(problem.engine, problem.points)
    for k, span in enumerate(_ranges_of(problem), 1):
        if span.table is not None:
            try:
                context.measure(span.quantity, span.table, f"speed_ranges[{k}].quantity")
            except Refused as error:
                path = "" if problem.origin is None else str(problem.origin.path)
                raise InputError(path, (error.complaint,)) from None
        if not problem.objective and span.measure is None:
            raise ModelError(f"speed range '{span.name}' needs a quantity, because the problem has no objective")


def solve_ranges(problem: Problem, decide: Callable[[Problem], Result], _: Callable[[Problem], Result]) -> Result:
    """Return the best design of a problem with speed ranges; `decide` solves the problem at finitely many speeds."""
    ranges = _ranges_of(problem)
    base, names = problem.changed(extras=(), origin=problem.origin), tuple(point.name for point in problem.points)
    start = evaluate_start(base)
    initial = tuple(Response(base, start, span) for span in ranges)
    speeds = {one.span.name: {one.span.low, one.span.high, *_tops(one)} for one in initial}
    bound, rounds, best = 0.0, 0, None
    for k in timed_rounds(ROUNDS):
        used = _sorted(speeds)
        report_progress("speeds of the ranges", sum(map(len, used.values())))
        result = decide(at_speeds(base, ranges, used))
        if not result.status.has_design and (best is None or result.status is Status.INFEASIBLE):
            return result
        if not result.status.has_design:
            break
        rounds = k + 1
        if result.certificate is not None and result.certificate.kind is not Proof.NONE:
            bound = max(bound, result.certificate.lower_bound)
        final = tuple(Response(base, result.final, span) for span in ranges)
        added = [_violated_speeds(one, result) for one in final]
        # a local method may have a worse design in a later round
        if best is None or _rank(result, final) < _rank(*best[:2]):
            best = result, final, used
        for one, tops in zip(final, added, strict=True):
            speeds[one.span.name].update(tops)
        if not any(added):
            break
    if best is None:
        raise SolverError("no design for the speed ranges was found within the time limit; raise the time limit")
    result, final, used = best
    return _conclusion(base, ranges, used, result, bound, RangeResponses(initial, final, rounds, names))


def evaluate_ranges(problem: Problem, result: Result) -> Result:
    """Return the result of an initial design with its responses over the ranges, and limits at their peaks."""
    _refuse_ranges(problem)
    ranges, base, start = _ranges_of(problem), problem.changed(extras=(), origin=problem.origin), result.initial
    responses = tuple(Response(base, start, span) for span in ranges)
    peaks = _sorted({one.span.name: set(_tops(one)[:PEAKS_IN_TABLES]) for one in responses})
    at_peaks, names = at_speeds(base, ranges, peaks), tuple(point.name for point in problem.points)
    design = evaluate(at_peaks, start.engine, start.samples)
    return replace(
        result, problem=at_peaks, initial=design, final=design, details=RangeResponses(responses, responses, 0, names),
        objective=ObjectiveValue.of_initial(at_peaks, design), limits=limit_values(at_peaks, design),
        error=partial(objective_error, at_peaks, design),
    )  # fmt: skip


def _rank(result: Result, final: Sequence[Response]) -> tuple[float, float]:
    # violation of limits over the ranges first, then the objective
    violation = max((one.ratio for one in final), default=0.0)
    values = [float(one.values[one.worst]) for one in final if one.span.minimised]
    value = values[0] if values else result.objective.value if result.objective is not None else 0.0
    return violation if violation > 1.0 + FEASIBILITY_TOL else 0.0, value


def _sorted(speeds: Mapping[str, set[float]]) -> Speeds:
    # speeds that are nearly equal would have one name
    return {
        name: [low for low, high in pairwise([*sorted(at), math.inf]) if high > low * (1.0 + DISTINCT)]
        for name, at in speeds.items()
    }


def _tops(one: Response) -> list[float]:
    return [float(one.speeds[k]) for k in one.tops[:TOPS]]


def _violated_speeds(one: Response, result: Result) -> list[float]:
    # speeds of peaks above the objective or the limit of a design, by more than a tolerance [rad/s]
    over = one.values > one.limits * (1.0 + 0.5 * FEASIBILITY_TOL)
    if one.span.minimised and result.objective is not None:
        zero_level = numerical_zero(result.problem, result.final.engine)
        over |= one.values > result.objective.value * (1.0 + TIGHT * result.problem.tolerance) + zero_level
    return [float(one.speeds[k]) for k in one.tops[:TOPS] if over[k]]


def _conclusion(
    base: Problem, ranges: Sequence[SpeedRange], used: Speeds, result: Result, bound: float, details: RangeResponses
) -> Result:
    """Return a result at the peaks of its design and of the initial one, with a lower bound [SI]."""
    pairs = list(zip(details.initial, details.final, strict=True))
    speeds = {one.span.name: {*_tops(one)[:PEAKS_IN_TABLES], *_tops(before)[:2]} for before, one in pairs}
    priced = {
        at for (limit, _), price in result.prices.items() if price.relaxed > 0.0 for at in limit.measure.points or ()
    }
    for span in ranges:
        # prices belong to limits at speeds of the last program
        at = span.at(used[span.name], base.points)
        speeds[span.name].update(point.speed for point in at if point.name in priced)
    peaks = _sorted(speeds)
    problem = at_speeds(base, ranges, peaks).at(result.final.fidelity)
    points = with_speeds([loads.point for loads in result.final.loads[: len(base.points)]], ranges, peaks)
    final = evaluate(replace(problem, points=points), result.final.engine, result.final.samples)
    initial, objective, prices = evaluate_start(problem), result.objective, result.prices
    result = replace(
        result, problem=problem, initial=initial, final=final, details=details,
        error=partial(objective_error, problem, final),
    )  # fmt: skip
    violated = final.violation(problem.limits) > FEASIBILITY_TOL and bool(result.certificate)
    if violated:
        message = (
            f"{violation_message(problem, final)}; {counted(details.rounds, 'round')} of exchange did not satisfy it"
        )
        result = replace(result, status=Status.FAILED, certificate=None, message=message)
    if objective is None:
        return replace(result, limits=limit_values(problem, final))
    zero_level = numerical_zero(problem, final.engine)
    final, value, value_error = refine_objective(
        problem, final, objective_value(problem, final), bound, zero_level, prices
    )
    certificate, status = result.certificate, result.status
    if certificate is not None and certificate.kind is not Proof.NONE:
        certificate = make_certificate(
            value, bound, zero_level, problem.tolerance, _STRENGTHS[certificate.kind], certificate.kkt_residual,
            f"{certificate.method}; exchange of speeds, {counted(details.rounds, 'round')}, peaks by search",
            value_error,
        )  # fmt: skip
        status = Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE
    return replace(
        result, status=status, certificate=certificate, final=final,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        limits=limit_values(problem, final, prices if problem.decisions else None, value),
    )  # fmt: skip
