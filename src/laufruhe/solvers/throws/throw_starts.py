"""Choose start points for the search of uneven throws (S20, S25).

Start points are ranked even crank stars, throws within their bounds, or the best cranks of every firing pattern within
the limits of firing intervals.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.machine.firing import firing_turns, from_one, intervals_of
from laufruhe.machine.firing_slots import FiringPattern, FiringSlots
from laufruhe.numerics.exact_angles import angle_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import SOONEST, Candidate, Intervals, OrderCriterion, bounded_stars
from laufruhe.problem.problem import Phasing
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import candidates_of, interval_range, ranked_orders, why_no_order

# firing orders of each ranked crank star that start a search if gas acts
ORDERS_WITH_GAS = 2
# largest number of cranks to compare by amplitudes of orders, and by the exact model
_MAX_CRANKS = 200_000
_MAX_EVALUATED = 300
# smallest number of cranks to compare for a firing pattern
_FEWEST = 8
# random throws within bounds, if neither their middle nor even stars have a firing order
_RANDOM_STARS = 4
# largest number of start cranks
_STARTS = 12
# rounding error of firing patterns [rad]
_ROUNDING = 1e-7


def firing_intervals(phasing: Phasing, candidate: Candidate) -> tuple[float, ...]:
    """Return the firing intervals of a design [rad]."""
    turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order or ())
    return intervals_of(phasing.cycle, turns)


def start_candidates(phasing: Phasing, even_result: Result | None, with_gas: bool = False) -> list[Candidate]:
    """Return cranks at which a search over throw angles starts, best first.

    Parameters
    ----------
    even_result
        Result of the even crank stars, with its ranking; None if there are none or throws have bounds.
    with_gas
        True if gas acts. Firing orders of one crank star, and both directions of rotation, then have different loads.
    """
    if even_result is not None and even_result.phasing is not None:
        candidates = candidates_of(phasing, even_result.phasing.ranking, ORDERS_WITH_GAS if with_gas else 1)
    else:
        if phasing.throw_bounds is not None:
            ends: list[list[float | None]] = [
                [None] if pair is None else [*sorted({pair[0], 0.5 * (pair[0] + pair[1]), pair[1]})]
                for pair in (phasing.bank, phasing.split)
            ]
            cranks = [crank for geometry in itertools.product(*ends) for crank in _within_bounds(phasing, *geometry)]
        else:
            cranks = _best_cranks(phasing, _firing_patterns(phasing)[0])
        sets = phasing.shafts.largest
        candidates = [replace(crank, left_out=phasing.without(built)) for crank in cranks for built in sets]
    if with_gas and phasing.throw_bounds is None and phasing.firing_order is None:
        candidates = [image for candidate in candidates for image in (candidate, reverse_rotation(phasing, candidate))]
    return candidates


def why_none_fires(phasing: Phasing) -> tuple[str, bool]:
    """Return the reason if no crank keeps the firing intervals allowed, in words, and True if it is proven."""
    allowed_text = phasing.intervals.text
    if not phasing.intervals.holds([phasing.even_interval]):
        interval = f"{math.degrees(phasing.even_interval):g}"
        return (
            f"no crank star can keep the firing intervals: {phasing.cylinders} cylinders fire {interval} deg apart "
            f"on average, phasing.intervals allows {allowed_text}"
        ), True
    if phasing.throws is not None:
        return why_no_order(phasing, phasing.throws), True
    if not phasing.continuous:
        return f"no crank star exists: {families_of(phasing)[1]}", True
    text = f"no crank and firing order keeps the firing intervals allowed, {allowed_text}"
    patterns, complete = _firing_patterns(phasing)
    if not patterns or patterns[0].broken <= _ROUNDING:
        return text, False
    intervals = interval_range(patterns[0].intervals(phasing.cycle))
    text += f"; the most even crank {'' if complete else 'found '}has intervals {intervals}"
    if phasing.bank is not None:
        step = 360.0 / (phasing.cylinders // math.gcd(phasing.cycle.turns, phasing.cylinders))
        text += (
            f" with bank angle plus split pins of {math.degrees(patterns[0].angle):.6g} deg, and even firing needs a "
            f"multiple of {step:g} deg"
        )
    return text, complete


def _firing_patterns(phasing: Phasing) -> tuple[list[FiringPattern], bool]:
    """Return patterns of firing angles within the bounds of intervals, most even first, and True if complete."""
    layout = phasing.layout(*phasing.minimum_geometry)
    low, high = (sum(pair) for pair in zip(phasing.bank or (0.0, 0.0), phasing.split or (0.0, 0.0), strict=True))
    slots = FiringSlots(
        phasing.cycle, len(layout.throw_positions), tuple(layout.side(k) for k in layout.on_throw(0)), (low, high),
        max(phasing.intervals.minimum, SOONEST), phasing.intervals.maximum,
    )  # fmt: skip
    members = None
    if phasing.firing_order is not None:
        # slots of every throw's cylinders
        slot = {number - 1: s for s, number in enumerate(phasing.firing_order)}
        members = [[slot[k] for k in layout.on_throw(throw)] for throw in range(max(layout.pins) + 1)]
    return slots.patterns(members)


def _best_cranks(phasing: Phasing, patterns: Sequence[FiringPattern]) -> list[Candidate]:
    allowed = [pattern for pattern in patterns if pattern.broken <= _ROUNDING]
    # even patterns come first, and get the most cranks
    cranks = [crank for k, pattern in enumerate(allowed) for crank in _cranks_of_pattern(phasing, pattern, k + 1)]
    cranks.sort(key=lambda pair: pair[0])
    unit = max((value for value, _ in cranks), default=0.0) or 1.0
    # mirror images of a crank have equal objectives
    by_value = {round(value / unit, 9): crank for value, crank in reversed(cranks)}
    return [by_value[key] for key in sorted(by_value)][:_STARTS]


def _cranks_of_pattern(phasing: Phasing, pattern: FiringPattern, number: int) -> list[tuple[float, Candidate]]:
    """Return the best cranks of a firing pattern, with their objectives [SI]."""
    bank = split = None
    if phasing.bank is not None:
        # split the sum of bank and split pin angle near the middle of their bounds
        (low, high), (narrowest, widest) = phasing.bank, phasing.split or (0.0, 0.0)
        bank = min(max(pattern.angle - 0.5 * (narrowest + widest), low), high)
        split = min(max(pattern.angle - bank, narrowest), widest)
        bank = min(max(pattern.angle - split, low), high)
    layout, count = phasing.layout(bank, split), len(pattern.members)
    zero_crank = Candidate(tuple(0.0 for _ in range(count)), None, bank, split)
    objective = amplitude_objective(replace(phasing.problem_of(zero_crank), limits=()), phasing, layout)
    maximum = max((_MAX_CRANKS if objective else _MAX_EVALUATED) // number**2, _FEWEST)
    if phasing.firing_order is not None:
        orders = np.arange(count)[None]
    elif math.factorial(count) <= maximum:
        orders = np.array(list(itertools.permutations(range(count))))
    else:
        rng = np.random.default_rng(1964)
        orders = np.array([rng.permutation(count) for _ in range(maximum)])
    # a throw lags by the crank angle at which its first cylinder fires (C5)
    firsts = np.array([pattern.moments[members[0]] for members in pattern.members])[orders]
    throws = angle_of(layout.dead_centre_turn(0)) + firsts[:, :1] - firsts
    if objective is not None:
        values = objective.values_at_angles(layout.throw_positions, throws)
        best = np.argsort(values, kind="stable")[: 4 * _STARTS]
    else:
        values, best = np.zeros(len(orders)), np.arange(len(orders))
    cranks = []
    for k in best:
        # cylinder of every slot
        cylinder = {}
        for pin, share in enumerate(orders[k]):
            cylinder.update(dict(zip(pattern.members[share], layout.on_throw(pin), strict=True)))
        order = from_one([cylinder[slot] + 1 for slot in range(len(cylinder))])
        crank = Candidate(tuple(float(a) % math.tau for a in throws[k]), order, bank, split)
        if objective is not None:
            value = float(values[k])
        else:
            try:
                problem = phasing.problem_of(crank)
                value = objective_value(problem, evaluate(problem))
            except ModelError:
                continue
        if math.isfinite(value):
            cranks.append((value, crank))
    return cranks


def _within_bounds(phasing: Phasing, bank: float | None, split: float | None) -> list[Candidate]:
    """Return start cranks with throws within their bounds, and with firing orders that these throws allow."""
    unlimited = replace(phasing, intervals=Intervals(0.0, math.inf), criteria=(OrderCriterion.ROLL_MOMENT,))
    allowed = phasing.intervals

    def violation(intervals: Sequence[float]) -> float:
        return round(sum(max(allowed.minimum - i, 0.0) + max(i - allowed.maximum, 0.0) for i in intervals), 9)

    low, high = np.array(phasing.throw_bounds).T
    random_stars = np.random.default_rng(1964).uniform(low, high, (_RANDOM_STARS, len(low)))
    for stars in (
        bounded_stars(phasing, phasing.layout(bank, split)),
        [tuple(map(float, throws)) for throws in random_stars],
    ):
        cranks = []
        for throws in stars:
            orders = ranked_orders(unlimited, Candidate(throws, None, bank, split))
            distinct_orders = [order for order in orders if min(order.intervals) > SOONEST]
            # smallest violation of the limits of intervals first
            distinct_orders.sort(key=lambda order: violation(order.intervals))
            cranks += [Candidate(throws, order.order, bank, split) for order in distinct_orders[:2]]
        if cranks:
            break
    return cranks


def reverse_rotation(phasing: Phasing, candidate: Candidate) -> Candidate:
    """Return the crank that is equivalent if it turns backwards: banks swap sides, and the firing order reverses."""
    layout = phasing.layout_of(candidate)
    number = {(pin, layout.side(k)): k + 1 for k, pin in enumerate(layout.pins)}
    partners = [number[pin, -layout.side(k)] for k, pin in enumerate(layout.pins)]
    order = [partners[k - 1] for k in reversed(candidate.firing_order or ())]
    throws = [-angle for angle in candidate.throws]
    # cylinder 1 is at its dead centre at phi = 0 (C5)
    shift = angle_of(layout.dead_centre_turn(0)) - throws[layout.pins[0]]
    reversed_throws = tuple((angle + shift) % math.tau for angle in throws)
    return replace(candidate, throws=reversed_throws, firing_order=from_one(order) if order else None)
