"""Solve for throws that leave the even steps within limits of firing intervals (S19-S21).

From every good even crank star, a smooth program finds a local optimum with a fixed firing order, so that intervals are
linear in the angles. The exact model compares both, so the result is never worse than the even star.
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
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.torque import turning_inertia
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.decision import projected_vector
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit, Measure, Side, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import ProofStrength, make_certificate
from laufruhe.prove.throws.firing_windows_bound import steady_bound, uneven_bound
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    FEASIBLE,
    limit_values,
    quote_names,
    refine_result,
    unbalance_values,
)
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.nonlinear import run_all_starts, solve_nonlinear
from laufruhe.solvers.smooth.program import TURN, SmoothProgram
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import TradePoint, ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import StarDesign, no_star, solve_fixed, with_star
from laufruhe.solvers.throws.throw_search import ThrowBound, search_throws
from laufruhe.solvers.throws.throw_starts import firing_intervals, start_candidates, why_none_fires


def has_degree(problem: Problem) -> bool:
    """Return True if the objective or a limit is a degree of irregularity."""
    return any(measure.channel.depends_on_torque for measure in problem.measures)


def with_work(problem: Problem) -> Problem:
    """Return the problem with work stored at constant speed in place of degrees of irregularity, for searches (S39).

    Work is a sum over the cylinders like all loads, so that the smooth program can model it.
    Weights keep the value of each degree in the initial design. An objective term counts the work at the operating
    point with the largest degree, a limit that at every point.
    """
    if not has_degree(problem):
        return problem
    initial, inertia = evaluate(problem), turning_inertia(problem.engine, problem.fidelity)
    speeds = {point.name: point.speed for point in problem.points}

    def degree(measure: Measure, name: str) -> float:
        value = initial.value(replace(measure, points=(name,)))
        # if the crank would stop, use the degree of a heavy flywheel with this work
        heavy = 0.0 if inertia is None else initial.value(_work(name)) / (inertia * speeds[name] ** 2)
        return value if math.isfinite(value) else heavy

    def slope(measure: Measure, name: str) -> float:
        return degree(measure, name) / (initial.value(_work(name)) or 1.0)

    terms: list[Term] = []
    limits: list[Limit] = []
    for term in problem.objective:
        if term.measure.channel.depends_on_torque:
            _, name = max((degree(term.measure, name), name) for name in _points(problem, term.measure))
            term = Term(_work(name), term.weight * slope(term.measure, name))
        terms.append(term)
    for limit in problem.limits:
        names = _points(problem, limit.measure) if limit.measure.channel.depends_on_torque else ()
        maxima = [limit.maximum / (slope(limit.measure, name) or 1.0) for name in names]
        works = [Limit(limit.name, _work(name), maximum) for name, maximum in zip(names, maxima, strict=True)]
        limits += works or [limit]
    return replace(problem, objective=tuple(terms), limits=tuple(limits))


def _work(name: str) -> Measure:
    return Measure(STORED_WORK, NORMS["peak to peak"], points=(name,))


def _points(problem: Problem, measure: Measure) -> Sequence[str]:
    return [point.name for point in problem.points if measure.includes_point(point)]


# number of start cranks of a thorough search
STARTS = 6
# smallest unit of the objective in a search, relative to the initial objective
SMALLEST_UNIT = 1e-3
# relative margin of limits in the smooth program, against rounding
SOFT_LIMIT = 1e-7
# softening of norms in the last stage, relative to the unit of the objective (N4)
SOFTEST = 1e-6
# relative difference of objectives at which two local optima are equal
SAME = 1e-6
# smallest difference of angles between two cranks of a ranking [rad]
SAME_ANGLE = 1e-4
# searches with tighter limits, margin relative to the violation, and largest violation that a margin may remove
_ATTEMPTS, _TIGHTENED, _MAX_TIGHTENED = 3, 1.2, 0.2
# trade-off between objective and uneven firing: shares of the deviation allowed, and start cranks of each
TRADE_STEPS = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)
TRADE_STARTS = 3


def solve_uneven(problem: Problem, phasing: Phasing, even_result: Result | None) -> Result:
    """Return the best local optimum from start cranks, with a lower bound over all throws. See `start_candidates`."""
    starts = start_candidates(phasing, even_result, problem.depends_on_gas)
    if not starts:
        reason, is_proven = why_none_fires(phasing)
        if is_proven:
            return no_star(problem, reason)
    shares = (
        TRADE_STEPS if phasing.thorough and even_result is not None and phasing.intervals.maximum < math.inf else (1.0,)
    )
    designs: list[StarDesign] = []
    trade: list[TradePoint] = []
    for k, share in enumerate(until_time_limit(shares)):
        report_progress("shares of the deviation allowed", k, len(shares), designs[0].value if designs else math.inf)
        mean, allowed = phasing.even_interval, phasing.intervals
        allowed = Intervals(mean - share * (mean - allowed.minimum), mean + share * (allowed.maximum - mean))
        # the optimum with less freedom is a start, so that more freedom is never worse
        selected = starts[: STARTS if share == 1.0 and phasing.thorough else TRADE_STARTS]
        cranks = dict.fromkeys([*(design.candidate for design in designs[:1]), *selected])
        optima = [x for crank in until_time_limit(cranks) if (x := local_optimum(phasing, crank, allowed)) is not None]
        designs = sorted(optima, key=lambda optimum: optimum.value)
        if designs and len(shares) > 1:
            trade.append(_trade_point(problem, phasing, allowed, designs[0]))
    floor, source = _bound(problem, phasing, phasing.intervals)
    box_bound = None
    # the degree of irregularity is no sum over cylinders
    if (not designs or phasing.thorough) and not has_degree(problem):
        best_design = designs[0] if designs else None
        box_bound = search_throws(problem, phasing, best_design, floor, partial(evaluate_crank, phasing))
    if box_bound is not None:
        floor, source = max(floor, box_bound.bound), f"{box_bound.boxes} {box_bound.what}"
        if box_bound.best is not None and box_bound.best not in designs:
            designs = [box_bound.best, *designs]
            trade = [*trade[:-1], _trade_point(problem, phasing, phasing.intervals, designs[0])] if trade else []
    if not designs and not starts and box_bound is None:
        return no_star(problem, reason, Status.FAILED)
    if not designs:
        return _without_design(problem, phasing, box_bound)
    trade = [replace(point, lower_bound=max(point.lower_bound, floor)) for point in trade]
    zero_level = numerical_zero(problem)
    result, value_error = refine_result(designs[0].result, floor, zero_level)
    best = replace(designs[0], result=result)
    method = f"IPOPT from {counted(len(designs), 'start')}, firing orders kept; bound from {source}"
    certificate = make_certificate(
        best.value, floor, zero_level, problem.tolerance, ProofStrength.PARTIAL, best.kkt_residual, method, value_error
    )
    distinct_designs: list[StarDesign] = []
    for design in designs:
        if not any(_is_same_crank(design.candidate, known_design.candidate) for known_design in distinct_designs):
            distinct_designs.append(design)
    ranking = [
        ranked_star(replace(phasing, firing_order=d.candidate.firing_order), d.candidate, None, d.value, 0.0, False)
        for d in distinct_designs
    ]
    count = even_result.phasing.designs if even_result is not None and even_result.phasing is not None else len(designs)
    details = ranking_result(phasing, best.candidate, ranking, count, len(designs), method)
    even_value = even_result.objective.value if even_result is not None and even_result.objective is not None else None
    details = replace(details, trade=tuple(trade), even_value=even_value)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def evaluate_crank(phasing: Phasing, candidate: Candidate) -> StarDesign | None:
    """Return the design with these throws; None if it violates limits or firing intervals."""
    return _if_feasible(phasing, phasing.intervals, _evaluate(phasing, candidate, 0.0, has_moved_throws=True))


def _trade_point(problem: Problem, phasing: Phasing, allowed: Intervals, best: StarDesign) -> TradePoint:
    even = phasing.even_interval
    deviation = max(abs(i - even) for i in firing_intervals(phasing, best.candidate))
    freedom = max(even - allowed.minimum, allowed.maximum - even)
    deviation = deviation if deviation > 1e-9 else 0.0
    bound, _ = _bound(problem, phasing, allowed)
    return TradePoint(freedom, deviation, best.value, best.candidate.throws, best.kkt_residual, bound)


def _bound(problem: Problem, phasing: Phasing, intervals: Intervals) -> tuple[float, str]:
    """Return a lower bound of the objective over all cranks with firing intervals in these bounds, and its source.

    Windows around the even stars give the bound if these have one geometry and the objective is a sum of amplitudes
    (S22); else the mean of the loads over the cycle gives it (S24) [SI].
    """
    families = families_of(phasing)[0] if phasing.throw_bounds is None else ()
    if len(families) == 1 and families[0].fixed is None:
        # without limits, the bound is still valid
        first = replace(phasing.problem_of(families[0].candidate(phasing, families[0].first)), limits=())
        objective = amplitude_objective(first, phasing, families[0].layout)
        if objective is not None:
            return uneven_bound(phasing, families[0].space, objective, intervals), "windows around the even steps"
    if phasing.is_geometry_open.bank:
        # measures inside the crankcase depend on the open bank angle
        load_terms = tuple(term for term in problem.objective if not term.measure.is_inside)
        problem = replace(problem, objective=load_terms)
    problem = replace(problem, objective=problem.load_terms)
    return steady_bound(problem), "the steady part of the loads"


def _without_design(problem: Problem, phasing: Phasing, box_bound: ThrowBound | None) -> Result:
    """Return a result without a design: infeasible if branch and bound or the bound of a limited measure proves it."""
    if box_bound is not None and box_bound.bound == math.inf:
        names = quote_names(box_bound.conflict) or "the bounds on firing intervals"
        return no_star(problem, f"no crank keeps {names}, whatever else is decided", conflict=box_bound.conflict)
    for limit in problem.load_limits:
        single_term = replace(problem, objective=(Term(limit.measure),))
        if _bound(single_term, phasing, phasing.intervals)[0] > limit.maximum * (1.0 + FEASIBILITY_TOL):
            reason = f"no crank keeps '{limit.name}', whatever else is decided"
            return no_star(problem, reason, conflict=(limit.name,))
    names = quote_names(limit.name for limit in problem.limits) or "the bounds"
    remedy = (
        "" if box_bound is None else f", and {box_bound.boxes} boxes of throws do not exclude one; raise search.boxes"
    )
    return no_star(
        problem, f"no crank was found that keeps {names}{remedy}; relax them, or open more numbers", Status.FAILED
    )


def local_optimum(phasing: Phasing, start: Candidate, intervals: Intervals) -> StarDesign | None:
    """Return the local optimum from a start crank, or that crank if it is no worse; None if neither is feasible.

    It starts from perturbed cranks too, because a symmetric crank may be a saddle point (S20).
    """
    best = _if_feasible(phasing, intervals, _evaluate(phasing, start, 0.0, has_moved_throws=False))
    if intervals.forbid_unevenness and phasing.throw_bounds is None:
        return best
    problem = with_work(replace(phasing.problem_of(start), phasing=None))
    # the exact model checks limits on numbers of the crank, which are not in the program
    problem = replace(problem, limits=problem.load_limits)
    moves = ThrowMoves(phasing, phasing.layout_of(start), start, intervals)
    if not moves.size:
        return best
    # zero is a lower bound of every norm
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
        starts = _start_points(smooth, best)
        for optimum in solve_nonlinear(smooth.program, starts, workers=1, max_seconds=30.0, stop_when=run_all_starts):
            if not optimum.usable:
                continue
            candidate = moves.candidate(smooth.throw_deviations(optimum.x))
            design = _evaluate(phasing, candidate, optimum.kkt_residual, has_moved_throws=True)
            if design is None or not intervals.holds(firing_intervals(phasing, candidate), 1e-7):
                continue
            minimum_violation = min(minimum_violation, design.result.final.violation(design.result.problem.limits))
            if _if_feasible(phasing, intervals, design) is None:
                continue
            if best is None or design.value < best.value * (1.0 - 1e-9):
                best, prices = design, smooth.prices(optimum)
            elif prices is None and design.value < best.value * (1.0 + SAME):
                prices = smooth.prices(optimum)
        # the program has fewer samples of a peak than the exact model, and work in place of a degree of irregularity
        if not FEASIBLE < minimum_violation < _MAX_TIGHTENED:
            break
        margin += _TIGHTENED * minimum_violation
    if best is None:
        return None
    # prices with open throws, which are lower than with fixed throws; unknown without a price of the program
    result = best.result
    limits = limit_values(replace(result.problem, phasing=phasing), result.final, prices or {}, best.value)
    return replace(best, result=replace(result, limits=limits))


def _start_points(smooth: SmoothProgram, best: StarDesign | None) -> list[Array]:
    # a star that equals its mirror image may be a saddle point
    columns = np.zeros(smooth.columns)
    if best is not None and smooth.columns:
        columns = projected_vector(smooth.domains, unbalance_values(smooth.problem, best.result))
    turns = np.zeros(0 if smooth.moves is None else smooth.moves.size)
    perturbations = np.random.default_rng(1964).standard_normal((2, len(turns) + len(columns)))
    perturbations *= 0.02 * np.concatenate(
        [np.full(len(turns), TURN), *(np.full(d.width, d.scale) for d in smooth.domains)]
    )
    return [
        smooth.start([], columns + perturbation[len(turns) :], turns + perturbation[: len(turns)])
        for perturbation in (0.0 * perturbations[0], *perturbations)
    ]


def _evaluate(phasing: Phasing, candidate: Candidate, residual: float, has_moved_throws: bool) -> StarDesign | None:
    try:
        result = solve_fixed(replace(phasing.problem_of(candidate), phasing=None))
    except ModelError:
        return None
    is_finite = result.objective is None or math.isfinite(result.objective.value)
    return StarDesign(candidate, result, None, residual, has_moved_throws) if is_finite else None


def _if_feasible(phasing: Phasing, intervals: Intervals, design: StarDesign | None) -> StarDesign | None:
    if design is None or not math.isfinite(design.value):
        return None
    if design.result.final.violation(design.result.problem.limits) > FEASIBLE:
        return None
    return design if intervals.holds(firing_intervals(phasing, design.candidate), 1e-7) else None


def _is_same_crank(first: Candidate, second: Candidate) -> bool:
    if replace(first, throws=second.throws, bank_angle=second.bank_angle, split_pin=second.split_pin) != second:
        return False
    angles = [(*crank.throws, crank.bank_angle or 0.0, crank.split_pin or 0.0) for crank in (first, second)]
    return bool(np.abs(np.angle(np.exp(1j * np.subtract(angles[0], angles[1])))).max() < SAME_ANGLE)
