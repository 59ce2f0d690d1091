"""Throws that leave the even steps within bounded firing intervals (S19-S21).

From every good even star a smooth program seeks a local optimum with its firing order
kept: intervals are then linear in the angles. The design returned is never worse than
the even star it started from, because the exact model compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from laufruhe.errors import ModelError, counted
from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import columns_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Side, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Reach, certified
from laufruhe.prove.throws.uneven import steady_bound, uneven_bound
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, limit_values, quoted, result_under, unbalances_of
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.nonlinear import solve_nonlinear, try_all
from laufruhe.solvers.smooth.program import TURN, SmoothProgram
from laufruhe.solvers.stars.conclusion import no_star, with_star
from laufruhe.solvers.stars.design import StarDesign, solve_fixed
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import TradePoint, ranked_star, ranking_result
from laufruhe.solvers.throws.search import Searched, search_throws
from laufruhe.solvers.throws.starts import firing_intervals, none_fires, starts_of
from laufruhe.solvers.throws.turning import bounding, of_other, with_work

STARTS = 6
# share of the objective as given that a search counts in at least
LEAST_UNIT = 1e-3
# share that keeps a design that stands on a limit from breaking it by a rounding
SOFT_LIMIT = 1e-7
SOFTEST = 1e-6
# share by which two ends of a search are one optimum
SAME = 1e-6
# angle that tells two cranks apart in a ranking [rad]
SHOWN = 1e-4
# how often limits are tightened that the best design breaks, by what share of its excess, and up to which
_ATTEMPTS, _TIGHTENED, _MOST_TIGHTENED = 3, 1.2, 0.2
TRADE_STEPS = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)
TRADE_STARTS = 3


def solve_uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    """The best of the local optima that the even stars lead to.

    Parameters
    ----------
    problem, phasing
        What is open.
    even
        Result of the even stars, ranked; None where none exists or throws have bounds of
        their own.
    """
    starts = starts_of(phasing, even, problem.feels_gas)
    if not starts:
        why, proven = none_fires(phasing)
        if proven:
            return no_star(problem, why)
    narrows = phasing.thorough and even is not None and phasing.intervals.most < math.inf
    steps = TRADE_STEPS if narrows else (1.0,)
    found: list[StarDesign] = []
    trade = []
    for k, share in enumerate(in_time(steps)):
        report_progress("shares of the deviation allowed", k, len(steps), found[0].value if found else math.inf)
        allowed = _narrowed(phasing, share)
        # what is best with less freedom is a start, so that more of it is never worse
        few = starts[: STARTS if share == 1.0 and phasing.thorough else TRADE_STARTS]
        own = dict.fromkeys([*(design.candidate for design in found[:1]), *few])
        answers = [answer for start in in_time(own) if (answer := local_optimum(phasing, start, allowed)) is not None]
        found = sorted(answers, key=lambda answer: answer.value)
        if found and len(steps) > 1:
            trade.append(_trade_point(problem, phasing, allowed, found[0]))
    floor, source = _bound(problem, phasing, phasing.intervals)
    searched = _searched(problem, phasing, found[0] if found else None, floor)
    if searched is not None:
        floor, source = max(floor, searched.bound), f"{searched.boxes} {searched.what}"
        if searched.best is not None and searched.best not in found:
            found = [searched.best, *found]
            trade = [*trade[:-1], _trade_point(problem, phasing, phasing.intervals, found[0])] if trade else []
    if not found and not starts and searched is None:
        return no_star(problem, why, Status.FAILED)
    if not found:
        return _none(problem, phasing, searched)
    trade = [replace(point, lower_bound=max(point.lower_bound, floor)) for point in trade]
    return _result(problem, phasing, even, found, tuple(trade), floor, source)


def _searched(problem: Problem, phasing: Phasing, first: StarDesign | None, floor: float) -> Searched | None:
    """What boxes of throws, bank angle and split pins told; None where they say nothing."""
    if first is not None and not phasing.thorough:
        return None
    other = bounding(problem, first.value if first is not None else math.inf)
    return search_throws(other(problem), of_other(phasing, other), first, floor, partial(_near, phasing))


def _near(phasing: Phasing, candidate: Candidate, moving: bool) -> StarDesign | None:
    """The local optimum that a crank from a box leads to; or that crank as it stands."""
    if moving:
        return local_optimum(phasing, candidate, phasing.intervals)
    found = _evaluated(phasing, candidate, 0.0, moved=True)
    is_held = (
        found is not None and _is_kept(found) and phasing.intervals.holds(firing_intervals(phasing, candidate), 1e-7)
    )
    return found if is_held else None


def _narrowed(phasing: Phasing, share: float) -> Intervals:
    even, allowed = phasing.even_interval, phasing.intervals
    return Intervals(even - share * (even - allowed.least), even + share * (allowed.most - even))


def _trade_point(problem: Problem, phasing: Phasing, allowed: Intervals, best: StarDesign) -> TradePoint:
    even = phasing.even_interval
    deviation = max(abs(i - even) for i in firing_intervals(phasing, best.candidate))
    freedom = max(even - allowed.least, allowed.most - even)
    deviation = deviation if deviation > 1e-9 else 0.0
    bound, _ = _bound(problem, phasing, allowed)
    return TradePoint(freedom, deviation, best.value, best.candidate.throws, best.kkt_residual, bound)


def _none(problem: Problem, phasing: Phasing, searched: Searched | None) -> Result:
    """No start led to a design: infeasible only where boxes, or a bound of what is limited, prove it."""
    if searched is not None and searched.bound == math.inf:
        told = quoted(searched.told) or "the bounds on firing intervals"
        return no_star(problem, f"no crank keeps {told}, whatever else is decided", conflict=searched.told)
    for limit in problem.load_limits:
        alone = replace(problem, objective=(Term(limit.measure),))
        if _bound(alone, phasing, phasing.intervals)[0] > limit.maximum * (1.0 + KEPT):
            why = f"no crank keeps '{limit.name}', whatever else is decided"
            return no_star(problem, why, conflict=(limit.name,))
    names = quoted(limit.name for limit in problem.limits) or "the bounds"
    left = "" if searched is None else f", and {searched.boxes} boxes of throws do not exclude one; raise search.boxes"
    return no_star(problem, f"no crank was found that keeps {names}{left}; relax them, or open more", Status.FAILED)


def local_optimum(
    phasing: Phasing, start: Candidate, intervals: Intervals, beside: bool = True
) -> StarDesign | None:  # fmt: skip
    """The local optimum that one star, and points `beside` it, lead to; the star itself where nothing is better (S20).

    What is an optimum of a problem that differs little is no saddle, and needs no points beside it.
    """
    best = _evaluated(phasing, start, 0.0, moved=False)
    if best is not None and not _is_kept(best):
        best = None
    if best is not None and not intervals.holds(firing_intervals(phasing, start), 1e-7):
        best = None
    if intervals.forbid_unevenness and phasing.throw_bounds is None:
        return best
    problem = with_work(replace(phasing.realise(start), phasing=None))
    # what is a number of each crank by itself is judged, and in no program
    problem = replace(problem, limits=problem.load_limits)
    moves = ThrowMoves(phasing, phasing.layout_of(start), start, intervals)
    if not moves.size or _is_nothing(best):
        return best
    prices: Mapping[Side, Price] | None = None
    margin = 0.0
    for _ in range(_ATTEMPTS):
        smooth = SmoothProgram(problem, _size(problem, best), margin, moves, slack=SOFT_LIMIT, softest=SOFTEST)
        least = math.inf
        starts = _points(smooth, best)[: None if beside else 1]
        for optimum in solve_nonlinear(smooth.program, starts, workers=1, max_seconds=30.0, enough=try_all):
            if not optimum.usable:
                continue
            candidate = moves.candidate(smooth.turns(optimum.x))
            answer = _evaluated(phasing, candidate, optimum.kkt_residual, moved=True)
            if answer is None or not intervals.holds(firing_intervals(phasing, candidate), 1e-7):
                continue
            least = min(least, answer.result.final.excess(answer.result.problem.limits))
            if not _is_kept(answer):
                continue
            if best is None or answer.value < best.value * (1.0 - 1e-9):
                best, prices = answer, smooth.prices(optimum)
            elif prices is None and answer.value < best.value * (1.0 + SAME):
                prices = smooth.prices(optimum)
        # the program knows a peak by fewer angles than the exact model, and a degree of irregularity by its work
        if not FEASIBLE < least < _MOST_TIGHTENED:
            break
        margin += _TIGHTENED * least
    return None if best is None else _priced(best, phasing, prices or {})


def _priced(design: StarDesign, phasing: Phasing, prices: Mapping[Side, Price]) -> StarDesign:
    """Return it with what its limits cost while throws may move, less than with fixed ones; unknown where not told."""
    result = design.result
    limits = limit_values(replace(result.problem, phasing=phasing), result.final, prices, design.value)
    return replace(design, result=replace(result, limits=limits))


def _is_nothing(best: StarDesign | None) -> bool:
    """Whether there is nothing to gain: no norm lies under zero."""
    if best is None or best.result.objective is None:
        return False
    return best.value <= numerical_zero(best.result.problem, best.result.final.engine)


def _size(problem: Problem, best: StarDesign | None) -> float:
    """What the objective is measured in: its value in the design as given, never far below it."""
    if best is None or best.result.objective is None:
        return objective_value(problem, evaluate(problem)) or 1.0
    return max(best.value, LEAST_UNIT * best.result.objective.initial) or 1.0


def _points(smooth: SmoothProgram, best: StarDesign | None) -> list[Array]:
    """The star, and two points beside it: one that is its own mirror image may be a saddle."""
    columns = np.zeros(smooth.columns)
    if best is not None and smooth.columns:
        columns = columns_of(smooth.domains, unbalances_of(smooth.problem, best.result))
    turns = np.zeros(0 if smooth.moves is None else smooth.moves.size)
    nudges = np.random.default_rng(1964).standard_normal((2, len(turns) + len(columns)))
    nudges *= 0.02 * np.concatenate([np.full(len(turns), TURN), *(np.full(d.width, d.scale) for d in smooth.domains)])
    return [smooth.start([], columns + n[len(turns) :], turns + n[: len(turns)]) for n in (0.0 * nudges[0], *nudges)]


def _evaluated(phasing: Phasing, candidate: Candidate, residual: float, moved: bool) -> StarDesign | None:
    """A design by the exact model, its unbalances at their proven optimum; None where there is none."""
    try:
        design = StarDesign(
            candidate, solve_fixed(replace(phasing.realise(candidate), phasing=None)), None, residual, moved
        )
    except ModelError:
        return None
    return design if design.result.objective is None or math.isfinite(design.result.objective.value) else None


def _is_kept(design: StarDesign) -> bool:
    return math.isfinite(design.value) and design.result.final.excess(design.result.problem.limits) <= FEASIBLE


def _bound(problem: Problem, phasing: Phasing, intervals: Intervals) -> tuple[float, str]:
    """What no design with these intervals goes under, and where that is from (S22, S24)."""
    families = families_of(phasing)[0] if phasing.throw_bounds is None else ()
    if len(families) == 1 and families[0].fixed is None:
        # a limit only takes designs away
        first = replace(phasing.realise(families[0].candidate(phasing, families[0].first)), limits=())
        objective = amplitude_objective(first, phasing, families[0].layout)
        if objective is not None:
            return uneven_bound(phasing, families[0].space, objective, intervals), "windows around the even steps"
    if phasing.opened[0]:
        # what stands still inside the crankcase leans with its bank
        felt = tuple(term for term in problem.objective if not term.measure.is_inside)
        problem = replace(problem, objective=felt)
    problem = replace(problem, objective=problem.load_terms)
    return steady_bound(problem), "the steady part of the loads"


def _different(found: Sequence[StarDesign]) -> list[StarDesign]:
    """Of designs, best first, those that are no better one again: several starts may lead to one optimum."""
    kept: list[StarDesign] = []
    for design in found:
        if not any(_is_again(design.candidate, other.candidate) for other in kept):
            kept.append(design)
    return kept


def _is_again(one: Candidate, other: Candidate) -> bool:
    """Whether cranks are built and fire alike, with no throw farther apart than is shown."""
    if replace(one, throws=other.throws, bank_angle=other.bank_angle, split_pin=other.split_pin) != other:
        return False
    first, second = ((*each.throws, each.bank_angle or 0.0, each.split_pin or 0.0) for each in (one, other))
    return bool(np.abs(np.angle(np.exp(1j * np.subtract(first, second)))).max() < SHOWN)


def _result(
    problem: Problem, phasing: Phasing, even: Result | None, found: Sequence[StarDesign],
    trade: tuple[TradePoint, ...], bound: float, source: str,
) -> Result:  # fmt: skip
    nothing = numerical_zero(problem)
    result, doubt = result_under(found[0].result, bound, nothing)
    best = replace(found[0], result=result)
    method = f"IPOPT from {counted(len(found), 'start')}, firing orders kept; bound from {source}"
    # no norm lies under zero: who reaches it is done
    certificate = certified(best.value, bound, nothing, problem.tolerance, Reach.NEAR, best.kkt_residual, method, doubt)
    ranking = [
        ranked_star(replace(phasing, firing_order=d.candidate.firing_order), d.candidate, None, d.value, 0.0, False)
        for d in _different(found)
    ]
    designs = even.phasing.designs if even is not None and even.phasing is not None else len(found)
    details = ranking_result(phasing, best.candidate, ranking, designs, len(found), method)
    even_value = even.objective.value if even is not None and even.objective is not None else None
    details = replace(details, trade=trade, even_value=even_value)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)
