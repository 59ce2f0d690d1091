"""Throws that leave the even steps within bounded firing intervals (S19-S21).

From every good even star a smooth program seeks a local optimum with its firing order fixed: intervals are then linear
in the angles. The design returned is never worse than the even star it started from, because the exact model compares
the two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from laufruhe.errors import ModelError, counted
from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import projected_vector
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Side, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import ProofStrength, make_certificate
from laufruhe.prove.throws.firing_windows_bound import steady_bound, uneven_bound
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, limit_values, quoted, result_under, unbalances_of
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.nonlinear import solve_nonlinear, try_all
from laufruhe.solvers.smooth.program import TURN, SmoothProgram
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import TradePoint, ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import StarDesign, no_star, solve_fixed, with_star
from laufruhe.solvers.throws.stored_work import bounding, proposing, with_problem
from laufruhe.solvers.throws.throw_search import ThrowBound, search_throws
from laufruhe.solvers.throws.throw_starts import firing_intervals, starts_of, why_none_fires

STARTS = 6
# smallest share of the objective as given in which a search counts
SMALLEST_UNIT = 1e-3
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
    """Return the best of the local optima that the even stars lead to, with a bound of all throws.

    Parameters
    ----------
    even
        Result of the even stars, ranked; None where none exists or throws have bounds of
        their own.
    """
    starts = starts_of(phasing, even, problem.depends_on_gas)
    if not starts:
        why, proven = why_none_fires(phasing)
        if proven:
            return no_star(problem, why)
    shares = TRADE_STEPS if phasing.thorough and even is not None and phasing.intervals.maximum < math.inf else (1.0,)
    designs: list[StarDesign] = []
    trade: list[TradePoint] = []
    for k, share in enumerate(until_time_limit(shares)):
        report_progress("shares of the deviation allowed", k, len(shares), designs[0].value if designs else math.inf)
        mean, allowed = phasing.even_interval, phasing.intervals
        allowed = Intervals(mean - share * (mean - allowed.minimum), mean + share * (allowed.maximum - mean))
        # what is best with less freedom is a start, so that more of it is never worse
        chosen = starts[: STARTS if share == 1.0 and phasing.thorough else TRADE_STARTS]
        cranks = dict.fromkeys([*(design.candidate for design in designs[:1]), *chosen])
        optima = [
            answer
            for crank in until_time_limit(cranks)
            if (answer := local_optimum(phasing, crank, allowed)) is not None
        ]
        designs = sorted(optima, key=lambda answer: answer.value)
        if designs and len(shares) > 1:
            trade.append(_trade_point(problem, phasing, allowed, designs[0]))
    floor, source = _bound(problem, phasing, phasing.intervals)
    bounded = None
    if not designs or phasing.thorough:
        bounded = _search_boxes(problem, phasing, designs[0] if designs else None, floor)
    if bounded is not None:
        floor, source = max(floor, bounded.bound), f"{bounded.boxes} {bounded.what}"
        if bounded.best is not None and bounded.best not in designs:
            designs = [bounded.best, *designs]
            trade = [*trade[:-1], _trade_point(problem, phasing, phasing.intervals, designs[0])] if trade else []
    if not designs and not starts and bounded is None:
        return no_star(problem, why, Status.FAILED)
    if not designs:
        return _none(problem, phasing, bounded)
    trade = [replace(point, lower_bound=max(point.lower_bound, floor)) for point in trade]
    zero_level = numerical_zero(problem)
    result, doubt = result_under(designs[0].result, floor, zero_level)
    best = replace(designs[0], result=result)
    method = f"IPOPT from {counted(len(designs), 'start')}, firing orders kept; bound from {source}"
    # no norm lies under zero: a design that reaches it is optimal
    certificate = make_certificate(
        best.value, floor, zero_level, problem.tolerance, ProofStrength.PARTIAL, best.kkt_residual, method, doubt
    )
    ranking = [
        ranked_star(replace(phasing, firing_order=d.candidate.firing_order), d.candidate, None, d.value, 0.0, False)
        for d in _distinct(designs)
    ]
    count = even.phasing.designs if even is not None and even.phasing is not None else len(designs)
    details = ranking_result(phasing, best.candidate, ranking, count, len(designs), method)
    even_value = even.objective.value if even is not None and even.objective is not None else None
    details = replace(details, trade=tuple(trade), even_value=even_value)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _search_boxes(problem: Problem, phasing: Phasing, first: StarDesign | None, floor: float) -> ThrowBound | None:
    # None without a proof

    def improve(candidate: Candidate, moving: bool) -> StarDesign | None:
        if moving:
            return local_optimum(phasing, candidate, phasing.intervals)
        return evaluate_crank(phasing, candidate)

    with_work = bounding(problem, first.value if first is not None else math.inf)
    return search_throws(with_work(problem), with_problem(phasing, with_work), first, floor, improve)


def evaluate_crank(phasing: Phasing, candidate: Candidate) -> StarDesign | None:
    """Return the design with these throws, if it keeps limits and firing intervals."""
    return _if_allowed(phasing, phasing.intervals, _evaluate(phasing, candidate, 0.0, moved=True))


def _trade_point(problem: Problem, phasing: Phasing, allowed: Intervals, best: StarDesign) -> TradePoint:
    even = phasing.even_interval
    deviation = max(abs(i - even) for i in firing_intervals(phasing, best.candidate))
    freedom = max(even - allowed.minimum, allowed.maximum - even)
    deviation = deviation if deviation > 1e-9 else 0.0
    bound, _ = _bound(problem, phasing, allowed)
    return TradePoint(freedom, deviation, best.value, best.candidate.throws, best.kkt_residual, bound)


def _bound(problem: Problem, phasing: Phasing, intervals: Intervals) -> tuple[float, str]:
    """Return a lower bound of all designs with these intervals [SI], and its source in words (S22, S24)."""
    families = families_of(phasing)[0] if phasing.throw_bounds is None else ()
    if len(families) == 1 and families[0].fixed is None:
        # a limit only takes designs away
        first = replace(phasing.realise(families[0].candidate(phasing, families[0].first)), limits=())
        objective = amplitude_objective(first, phasing, families[0].layout)
        if objective is not None:
            return uneven_bound(phasing, families[0].space, objective, intervals), "windows around the even steps"
    if phasing.is_geometry_open[0]:
        # what stands still inside the crankcase leans with its bank
        outside = tuple(term for term in problem.objective if not term.measure.is_inside)
        problem = replace(problem, objective=outside)
    problem = replace(problem, objective=problem.load_terms)
    return steady_bound(problem), "the steady part of the loads"


def _none(problem: Problem, phasing: Phasing, bounded: ThrowBound | None) -> Result:
    """Return that no start led to a design: infeasible only where boxes, or a bound of what is limited, prove it."""
    if bounded is not None and bounded.bound == math.inf:
        names = quoted(bounded.conflict) or "the bounds on firing intervals"
        return no_star(problem, f"no crank keeps {names}, whatever else is decided", conflict=bounded.conflict)
    for limit in problem.load_limits:
        alone = replace(problem, objective=(Term(limit.measure),))
        if _bound(alone, phasing, phasing.intervals)[0] > limit.maximum * (1.0 + KEPT):
            why = f"no crank keeps '{limit.name}', whatever else is decided"
            return no_star(problem, why, conflict=(limit.name,))
    names = quoted(limit.name for limit in problem.limits) or "the bounds"
    left = "" if bounded is None else f", and {bounded.boxes} boxes of throws do not exclude one; raise search.boxes"
    return no_star(problem, f"no crank was found that keeps {names}{left}; relax them, or open more", Status.FAILED)


def local_optimum(
    phasing: Phasing, start: Candidate, intervals: Intervals, nudged: bool = True
) -> StarDesign | None:  # fmt: skip
    """Return the local optimum that one star leads to, or the star itself where nothing is better (S20).

    Parameters
    ----------
    intervals
        Firing intervals allowed.
    nudged
        Whether points beside the star are started from too, for a star may be a saddle. The optimum of a problem that
        differs little is none.
    """
    best = _if_allowed(phasing, intervals, _evaluate(phasing, start, 0.0, moved=False))
    if intervals.forbid_unevenness and phasing.throw_bounds is None:
        return best
    problem = proposing(replace(phasing.realise(start), phasing=None))
    # what is a number of each crank by itself is judged, and in no program
    problem = replace(problem, limits=problem.load_limits)
    moves = ThrowMoves(phasing, phasing.layout_of(start), start, intervals)
    if not moves.size:
        return best
    # no norm lies under zero
    has_value = best is not None and best.result.objective is not None
    if best is not None and has_value and best.value <= numerical_zero(best.result.problem, best.result.final.engine):
        return best
    prices: Mapping[Side, Price] | None = None
    margin = 0.0
    for _ in range(_ATTEMPTS):
        if best is None or best.result.objective is None:
            unit = objective_value(problem, evaluate(problem)) or 1.0
        else:
            unit = max(best.value, SMALLEST_UNIT * best.result.objective.initial) or 1.0
        smooth = SmoothProgram(problem, unit, margin, moves, slack=SOFT_LIMIT, softest=SOFTEST)
        minimum_violation = math.inf
        starts = _start_points(smooth, best)[: None if nudged else 1]
        for optimum in solve_nonlinear(smooth.program, starts, workers=1, max_seconds=30.0, stop_when=try_all):
            if not optimum.usable:
                continue
            candidate = moves.candidate(smooth.throw_deviations(optimum.x))
            design = _evaluate(phasing, candidate, optimum.kkt_residual, moved=True)
            if design is None or not intervals.holds(firing_intervals(phasing, candidate), 1e-7):
                continue
            minimum_violation = min(minimum_violation, design.result.final.violation(design.result.problem.limits))
            if _if_allowed(phasing, intervals, design) is None:
                continue
            if best is None or design.value < best.value * (1.0 - 1e-9):
                best, prices = design, smooth.prices(optimum)
            elif prices is None and design.value < best.value * (1.0 + SAME):
                prices = smooth.prices(optimum)
        # the program knows a peak by fewer angles than the exact model, and a degree of irregularity by its work
        if not FEASIBLE < minimum_violation < _MOST_TIGHTENED:
            break
        margin += _TIGHTENED * minimum_violation
    if best is None:
        return None
    # limits cost less while throws may move than with fixed ones; unknown where the program has no price
    result = best.result
    limits = limit_values(replace(result.problem, phasing=phasing), result.final, prices or {}, best.value)
    return replace(best, result=replace(result, limits=limits))


def _start_points(smooth: SmoothProgram, best: StarDesign | None) -> list[Array]:
    # a star that is its own mirror image may be a saddle
    columns = np.zeros(smooth.columns)
    if best is not None and smooth.columns:
        columns = projected_vector(smooth.domains, unbalances_of(smooth.problem, best.result))
    turns = np.zeros(0 if smooth.moves is None else smooth.moves.size)
    nudges = np.random.default_rng(1964).standard_normal((2, len(turns) + len(columns)))
    nudges *= 0.02 * np.concatenate([np.full(len(turns), TURN), *(np.full(d.width, d.scale) for d in smooth.domains)])
    return [smooth.start([], columns + n[len(turns) :], turns + n[: len(turns)]) for n in (0.0 * nudges[0], *nudges)]


def _evaluate(phasing: Phasing, candidate: Candidate, residual: float, moved: bool) -> StarDesign | None:
    try:
        result = solve_fixed(replace(phasing.realise(candidate), phasing=None))
    except ModelError:
        return None
    is_finite = result.objective is None or math.isfinite(result.objective.value)
    return StarDesign(candidate, result, None, residual, moved) if is_finite else None


def _if_allowed(phasing: Phasing, intervals: Intervals, design: StarDesign | None) -> StarDesign | None:
    if design is None or not math.isfinite(design.value):
        return None
    if design.result.final.violation(design.result.problem.limits) > FEASIBLE:
        return None
    return design if intervals.holds(firing_intervals(phasing, design.candidate), 1e-7) else None


def _distinct(designs: Sequence[StarDesign]) -> list[StarDesign]:
    different: list[StarDesign] = []
    for design in designs:
        if not any(_is_same_crank(design.candidate, other.candidate) for other in different):
            different.append(design)
    return different


def _is_same_crank(one: Candidate, other: Candidate) -> bool:
    if replace(one, throws=other.throws, bank_angle=other.bank_angle, split_pin=other.split_pin) != other:
        return False
    first, second = ((*each.throws, each.bank_angle or 0.0, each.split_pin or 0.0) for each in (one, other))
    return bool(np.abs(np.angle(np.exp(1j * np.subtract(first, second)))).max() < SHOWN)
