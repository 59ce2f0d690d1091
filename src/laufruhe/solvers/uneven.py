"""Throws that leave the even steps within bounded firing intervals (S19-S21).

From every good even star a smooth program seeks a local optimum with its firing order
kept: intervals are then linear in the angles. The design returned is never worse than
the even star it started from, because the exact model compares the two.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError, SolverError
from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.machine.firing import firing_turns, intervals_of
from laufruhe.numerics.turns import angle_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.phasing import SOONEST, Candidate, Intervals, OrderCriterion, bounded_stars
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Reach, certified
from laufruhe.prove.uneven_bound import steady_bound, uneven_bound
from laufruhe.solvers.conclusion import FEASIBLE, no_star, with_star
from laufruhe.solvers.mount_starts import columns_of, unbalances_of
from laufruhe.solvers.nonlinear import solve_nonlinear
from laufruhe.solvers.ranking import TradePoint, ranked_orders, ranked_star, ranking_result
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth_program import TURN, SmoothProgram
from laufruhe.solvers.star_design import StarDesign, solve_fixed
from laufruhe.solvers.star_families import families_of

Array = NDArray[np.float64]

STARTS = 6
ORDERS_WITH_GAS = 2
# share of the objective as given that a search counts in at least
LEAST_UNIT = 1e-3
# share that keeps a design that stands on a limit from breaking it by a rounding
SOFT_LIMIT = 1e-7
SOFTEST = 1e-6
TRADE_STEPS = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)


def solve_uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    """The best of the local optima that the even stars lead to.

    Parameters
    ----------
    problem, phasing
        What is open.
    even
        Result of the even stars, ranked; None where none exists or throws have bounds of
        their own.

    Raises
    ------
    SolverError
        If no start leads anywhere.
    """
    starts = starts_of(phasing, even, problem.feels_gas)
    if not starts:
        return no_star(problem, "no star and firing order to start from keeps the firing intervals allowed")
    found = [answer for start in starts[:STARTS] if (answer := local_optimum(phasing, start, phasing.intervals))]
    if not found:
        raise SolverError("no start of the nonlinear program ended at a design that keeps the limits")
    found.sort(key=lambda answer: answer.value)
    trade = _trade(problem, phasing, starts, found) if even is not None else ()
    return _result(problem, phasing, even, found, trade)


def local_optimum(phasing: Phasing, start: Candidate, intervals: Intervals) -> StarDesign | None:
    """The local optimum that one star leads to; the star itself where nothing is better (S20)."""
    best = _evaluated(phasing, start, 0.0, moved=False)
    if best is not None and not intervals.holds(firing_intervals(phasing, start), 1e-7):
        best = None
    if intervals.forbid_unevenness and phasing.throw_bounds is None:
        return best
    problem = replace(phasing.realise(start), phasing=None)
    moves = ThrowMoves(phasing, phasing.layout_of(start), start, intervals)
    if not moves.size or _is_nothing(best):
        return best
    smooth = SmoothProgram(problem, _size(problem, best), moves=moves, slack=SOFT_LIMIT, softest=SOFTEST)
    for optimum in solve_nonlinear(smooth.program, _points(smooth, best), workers=1, max_seconds=30.0):
        if not optimum.usable:
            continue
        candidate = moves.candidate(smooth.turns(optimum.x))
        answer = _evaluated(phasing, candidate, optimum.kkt_residual, moved=True)
        if answer is None or not intervals.holds(firing_intervals(phasing, candidate), 1e-7):
            continue
        if best is None or answer.value < best.value * (1.0 - 1e-9):
            best = answer
    return best


def _is_nothing(best: StarDesign | None) -> bool:
    """Whether there is nothing to gain: no norm lies under zero."""
    if best is None or best.result.objective is None:
        return False
    return best.value <= nothing_of(best.result.problem, best.result.final.engine)


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
    """A design by the exact model, its unbalances at their proven optimum; None if it breaks a limit."""
    try:
        design = StarDesign(
            candidate, solve_fixed(replace(phasing.realise(candidate), phasing=None)), None, residual, moved
        )
    except ModelError:
        return None
    excess = design.result.final.excess(design.result.problem.limits)
    return design if math.isfinite(design.value) and excess <= FEASIBLE else None


def firing_intervals(phasing: Phasing, candidate: Candidate) -> tuple[float, ...]:
    """Crank angles from firing to firing of a design [rad]."""
    turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order or ())
    return intervals_of(phasing.cycle, turns)


def starts_of(phasing: Phasing, even: Result | None, with_gas: bool = False) -> list[Candidate]:
    """Designs to start from: the ranked even stars, or throws within their own bounds.

    Parameters
    ----------
    with_gas
        Whether gas is felt: firing orders of one star then differ, and so does the star that
        turns the other way, which inertia alone cannot tell from it.
    """
    optional = [name for names in phasing.shafts.optional for name in names]
    if even is not None and even.phasing is not None:
        candidates = [
            Candidate(
                s.throws, firing.order, s.bank_angle, s.split_pin, tuple(n for n in optional if n not in s.shafts)
            )
            for s in even.phasing.ranking
            for firing in s.firing_orders[: ORDERS_WITH_GAS if with_gas else 1]
        ]
    else:
        geometries = itertools.product(_ends(phasing.bank), _ends(phasing.split))
        candidates = [candidate for geometry in geometries for candidate in _unranked(phasing, *geometry)]
    if with_gas and phasing.throw_bounds is None and phasing.firing_order is None:
        candidates = [image for candidate in candidates for image in (candidate, _turning_back(phasing, candidate))]
    return candidates


def _unranked(phasing: Phasing, bank: float | None, split: float | None) -> list[Candidate]:
    """Throws within their bounds, or spread evenly, in firing orders that they can keep."""
    layout = phasing.layout(bank, split)
    if phasing.throw_bounds is None:
        count = len(layout.throw_positions)
        stars = [tuple(layout.banks[0] - layout.pin_offsets[0] + math.tau * k / count for k in range(count))]
    else:
        stars = bounded_stars(phasing, layout)
    free = replace(phasing, intervals=Intervals(0.0, math.inf), criteria=(OrderCriterion.ROLL_MOMENT,))
    found = []
    for throws in stars:
        orders = ranked_orders(free, Candidate(throws, None, bank, split))
        kept = [order for order in orders if min(order.intervals) > SOONEST]
        # the orders whose intervals are nearest to those allowed
        kept.sort(key=lambda order: _outside(phasing.intervals, order.intervals))
        found += [Candidate(throws, order.order, bank, split) for order in kept[:2]]
    return found


def _turning_back(phasing: Phasing, candidate: Candidate) -> Candidate:
    """The star of a crank that turns the other way: banks change sides, firings follow each other backwards."""
    layout = phasing.layout_of(candidate)
    number = {(pin, bank): k + 1 for k, (pin, bank) in enumerate(zip(layout.pins, layout.banks, strict=True))}
    partners = [number[pin, -bank] for pin, bank in zip(layout.pins, layout.banks, strict=True)]
    order = [partners[k - 1] for k in reversed(candidate.firing_order or ())]
    first = order.index(1) if order else 0
    throws = [-angle for angle in candidate.throws]
    # cylinder 1 at its dead centre when phi = 0 (C5)
    shift = angle_of(layout.own_turn(0)) - throws[layout.pins[0]]
    turned = tuple((angle + shift) % math.tau for angle in throws)
    return replace(candidate, throws=turned, firing_order=(*order[first:], *order[:first]) or None)


def _outside(allowed: Intervals, intervals: Sequence[float]) -> float:
    return round(sum(max(allowed.least - i, 0.0) + max(i - allowed.most, 0.0) for i in intervals), 9)


def _ends(bounds: tuple[float, float] | None) -> list[float | None]:
    if bounds is None:
        return [None]
    return [bounds[0]] if bounds[0] == bounds[1] else [bounds[0], 0.5 * (bounds[0] + bounds[1]), bounds[1]]


def _bound(problem: Problem, phasing: Phasing, intervals: Intervals) -> tuple[float, str]:
    """What no design with these intervals goes under, and where that is from (S22, S24)."""
    families = families_of(phasing)[0] if phasing.throw_bounds is None else ()
    if len(families) == 1 and families[0].fixed is None:
        # a limit only takes designs away
        first = replace(phasing.realise(families[0].candidate(phasing, families[0].first)), limits=())
        objective = amplitude_objective(first, phasing, families[0].layout)
        if objective is not None:
            return uneven_bound(phasing, families[0].space, objective, intervals), "windows around the even steps"
    return steady_bound(problem), "the steady part of the loads"


def _trade(
    problem: Problem, phasing: Phasing, starts: Sequence[Candidate], found: Sequence[StarDesign]
) -> tuple[TradePoint, ...]:
    """The least objective found for less and less unevenness; never worse for more of it."""
    even = phasing.even_interval
    allowed = max(even - phasing.intervals.least, phasing.intervals.most - even)
    if not math.isfinite(allowed):
        return ()
    out: list[TradePoint] = []
    for share in TRADE_STEPS:
        low = even - share * (even - phasing.intervals.least)
        high = even + share * (phasing.intervals.most - even)
        answers = (
            list(found)
            if share == 1.0
            else [answer for s in starts[:3] if (answer := local_optimum(phasing, s, Intervals(low, high))) is not None]
        )
        if not answers:
            continue
        best = min(answers, key=lambda answer: answer.value)
        bound, _ = _bound(problem, phasing, Intervals(low, high))
        if out and out[-1].value < best.value:
            out.append(replace(out[-1], allowed=share * allowed, lower_bound=bound))
            continue
        intervals = firing_intervals(phasing, best.candidate)
        deviation = max(abs(i - even) for i in intervals)
        deviation = deviation if deviation > 1e-9 else 0.0
        out.append(TradePoint(share * allowed, deviation, best.value, best.candidate.throws, best.kkt_residual, bound))
    return tuple(out)


def _result(
    problem: Problem, phasing: Phasing, even: Result | None, found: Sequence[StarDesign], trade: tuple[TradePoint, ...]
) -> Result:
    best = found[0]
    bound, source = _bound(problem, phasing, phasing.intervals)
    method = f"IPOPT from {len(found)} start(s), firing orders kept; bound from {source}"
    # no norm lies under zero: who reaches it is done
    certificate = certified(
        best.value, bound, nothing_of(problem), problem.tolerance, Reach.ASIDE, best.kkt_residual, method
    )
    ranking = [
        ranked_star(replace(phasing, firing_order=d.candidate.firing_order), d.candidate, None, d.value, 0.0, False)
        for d in found
    ]
    designs = even.phasing.designs if even is not None and even.phasing is not None else len(found)
    details = ranking_result(phasing, best.candidate, ranking, designs, len(found), method)
    even_value = even.objective.value if even is not None and even.objective is not None else None
    details = replace(details, trade=trade, even_value=even_value)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)
