"""Start points of the search of uneven throws (S20, S25).

They are ranked even stars, throws within bounds of their own, or the best cranks of every way to fire within the
intervals.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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

ORDERS_WITH_GAS = 2
# cranks that are compared by order alone, and by the exact model
_MOST_CRANKS = 200_000
_MOST_EVALUATED = 300
_FEWEST = 8
# throws within bounds of their own, where neither middle nor even stars can fire
_DRAWN = 4
_STARTS = 12
# a rounding of the program that times firings [rad]
_ROUNDING = 1e-7


def firing_intervals(phasing: Phasing, candidate: Candidate) -> tuple[float, ...]:
    """Return crank angles from firing to firing of a design [rad]."""
    turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order or ())
    return intervals_of(phasing.cycle, turns)


def starts_of(phasing: Phasing, even: Result | None, with_gas: bool = False) -> list[Candidate]:
    """Return designs to start from, the most promising first.

    Parameters
    ----------
    even
        Result of the even stars, ranked; None where none exists or throws have bounds of their own.
    with_gas
        Whether gas is felt: firing orders of one star then differ, and so does the star that
        turns the other way, which inertia alone cannot tell from it.
    """
    if even is not None and even.phasing is not None:
        candidates = candidates_of(phasing, even.phasing.ranking, ORDERS_WITH_GAS if with_gas else 1)
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
        candidates = [image for candidate in candidates for image in (candidate, turning_back(phasing, candidate))]
    return candidates


def why_none_fires(phasing: Phasing) -> tuple[str, bool]:
    """Return why no crank and firing order keeps the intervals allowed, and whether that is proven."""
    allowed = phasing.intervals.text
    if not phasing.intervals.holds([phasing.even_interval]):
        even = f"{math.degrees(phasing.even_interval):g}"
        return (
            f"no star can meet the intervals: {phasing.cylinders} cylinders fire {even} deg apart on average, "
            f"phasing.intervals allows {allowed}"
        ), True
    if phasing.throws is not None:
        return why_no_order(phasing, phasing.throws), True
    if not phasing.continuous:
        return f"no star exists: {families_of(phasing)[1]}", True
    text = f"no crank and firing order keeps the firing intervals allowed, {allowed}"
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
    """Return ways to fire, the most even first, and whether these are all."""
    layout = phasing.layout(*phasing.minimum_geometry)
    first = [k for k, pin in enumerate(layout.pins) if pin == 0]
    low, high = (sum(pair) for pair in zip(phasing.bank or (0.0, 0.0), phasing.split or (0.0, 0.0), strict=True))
    slots = FiringSlots(
        phasing.cycle, len(layout.throw_positions), tuple(layout.side(k) for k in first), (low, high),
        max(phasing.intervals.minimum, SOONEST), phasing.intervals.maximum,
    )  # fmt: skip
    members = None
    if phasing.firing_order is not None:
        # firings of every throw's cylinders
        slot = {number - 1: s for s, number in enumerate(phasing.firing_order)}
        members = [
            [slot[k] for k, pin in enumerate(layout.pins) if pin == throw] for throw in range(max(layout.pins) + 1)
        ]
    return slots.patterns(members)


def _best_cranks(phasing: Phasing, patterns: Sequence[FiringPattern]) -> list[Candidate]:
    cranks: list[tuple[float, Candidate]] = []
    allowed = [pattern for pattern in patterns if pattern.broken <= _ROUNDING]
    for number, pattern in enumerate(allowed):
        # the most even ones come first, and are looked at the closest
        cranks += _cranks_of_pattern(phasing, pattern, number + 1)
    cranks.sort(key=lambda pair: pair[0])
    unit = max((value for value, _ in cranks), default=0.0) or 1.0
    # images of one crank are worth the same
    different = {round(value / unit, 9): crank for value, crank in reversed(cranks)}
    return [different[key] for key in sorted(different)][:_STARTS]


def _cranks_of_pattern(phasing: Phasing, pattern: FiringPattern, number: int) -> list[tuple[float, Candidate]]:
    """Return the best cranks of one way to fire, with their objectives."""
    bank = split = None
    if phasing.bank is not None:
        # bank angle and split pin of the pattern's sum, as near to the middle as their bounds allow
        (low, high), (narrowest, widest) = phasing.bank, phasing.split or (0.0, 0.0)
        bank = min(max(pattern.angle - 0.5 * (narrowest + widest), low), high)
        split = min(max(pattern.angle - bank, narrowest), widest)
        bank = min(max(pattern.angle - split, low), high)
    layout, count = phasing.layout(bank, split), len(pattern.members)
    plain = Candidate(tuple(0.0 for _ in range(count)), None, bank, split)
    simple = amplitude_objective(replace(phasing.realise(plain), limits=()), phasing, layout)
    orders = _throw_orders(phasing, count, (_MOST_CRANKS if simple else _MOST_EVALUATED) // number**2)
    # a throw stands as far back as its first cylinder fires late (C5)
    firsts = np.array([pattern.moments[members[0]] for members in pattern.members])[orders]
    throws = angle_of(layout.dead_centre_turn(0)) + firsts[:, :1] - firsts
    if simple is not None:
        values = simple.of_angles(layout.throw_positions, throws)
        best = np.argsort(values, kind="stable")[: 4 * _STARTS]
    else:
        values, best = np.zeros(len(orders)), np.arange(len(orders))
    cranks = []
    for k in best:
        # cylinders as they fire, the first one first
        cylinder = {}
        for pin, share in enumerate(orders[k]):
            cylinders = [c for c, at in enumerate(layout.pins) if at == pin]
            cylinder.update(dict(zip(pattern.members[share], cylinders, strict=True)))
        order = from_one([cylinder[slot] + 1 for slot in range(len(cylinder))])
        crank = Candidate(tuple(float(a) % math.tau for a in throws[k]), order, bank, split)
        if simple is not None:
            value = float(values[k])
        else:
            try:
                problem = phasing.realise(crank)
                value = objective_value(problem, evaluate(problem))
            except ModelError:
                continue
        if math.isfinite(value):
            cranks.append((value, crank))
    return cranks


def _throw_orders(phasing: Phasing, count: int, maximum: int) -> NDArray[np.intp]:
    if phasing.firing_order is not None:
        return np.arange(count)[None]
    maximum = max(maximum, _FEWEST)
    if math.factorial(count) <= maximum:
        return np.array(list(itertools.permutations(range(count))))
    rng = np.random.default_rng(1964)
    return np.array([rng.permutation(count) for _ in range(maximum)])


def _within_bounds(phasing: Phasing, bank: float | None, split: float | None) -> list[Candidate]:
    """Return throws within bounds of their own, in firing orders that they can keep."""
    free = replace(phasing, intervals=Intervals(0.0, math.inf), criteria=(OrderCriterion.ROLL_MOMENT,))
    allowed = phasing.intervals

    def violation(intervals: Sequence[float]) -> float:
        return round(sum(max(allowed.minimum - i, 0.0) + max(i - allowed.maximum, 0.0) for i in intervals), 9)

    low, high = np.array(phasing.throw_bounds).T
    drawn = np.random.default_rng(1964).uniform(low, high, (_DRAWN, len(low)))
    for stars in (bounded_stars(phasing, phasing.layout(bank, split)), [tuple(map(float, own)) for own in drawn]):
        cranks = []
        for throws in stars:
            orders = ranked_orders(free, Candidate(throws, None, bank, split))
            fired = [order for order in orders if min(order.intervals) > SOONEST]
            # the orders whose intervals are nearest to those allowed
            fired.sort(key=lambda order: violation(order.intervals))
            cranks += [Candidate(throws, order.order, bank, split) for order in fired[:2]]
        if cranks:
            break
    return cranks


def turning_back(phasing: Phasing, candidate: Candidate) -> Candidate:
    """Return the star of a crank that turns the other way: banks change sides, and firings their order."""
    layout = phasing.layout_of(candidate)
    number = {(pin, layout.side(k)): k + 1 for k, pin in enumerate(layout.pins)}
    partners = [number[pin, -layout.side(k)] for k, pin in enumerate(layout.pins)]
    order = [partners[k - 1] for k in reversed(candidate.firing_order or ())]
    throws = [-angle for angle in candidate.throws]
    # cylinder 1 at its dead centre when phi = 0 (C5)
    shift = angle_of(layout.dead_centre_turn(0)) - throws[layout.pins[0]]
    turned = tuple((angle + shift) % math.tau for angle in throws)
    return replace(candidate, throws=turned, firing_order=from_one(order) if order else None)
