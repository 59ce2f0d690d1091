"""Where the search of uneven throws starts (S20, S25).

From ranked even stars, from throws within bounds of their own, or from the best cranks of every way to fire
within the intervals.
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
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.turns import angle_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import SOONEST, Candidate, Intervals, OrderCriterion, bounded_stars
from laufruhe.problem.problem import Phasing
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import candidates_of, ends_of, none_of_given, ranked_orders

ORDERS_WITH_GAS = 2
# cranks that are compared by order alone, and by the exact model
_MOST_CRANKS = 200_000
_MOST_EVALUATED = 300
_FEWEST = 8
# throws within bounds of their own, where neither middle nor even stars can fire
_DRAWN = 4
_STARTS = 12
# a rounding of the program that times firings [rad]
_KEPT = 1e-7


def firing_intervals(phasing: Phasing, candidate: Candidate) -> tuple[float, ...]:
    """Crank angles from firing to firing of a design [rad]."""
    turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order or ())
    return intervals_of(phasing.cycle, turns)


def starts_of(phasing: Phasing, even: Result | None, with_gas: bool = False) -> list[Candidate]:
    """Designs to start from, the most promising first.

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
        geometries = itertools.product(_ends(phasing.bank), _ends(phasing.split))
        if phasing.throw_bounds is not None:
            cranks = [candidate for geometry in geometries for candidate in _within_bounds(phasing, *geometry)]
        else:
            cranks = _best_cranks(phasing, _slots(phasing).patterns(_given(phasing))[0])
        sets = phasing.shafts.largest
        candidates = [replace(crank, left_out=phasing.without(built)) for crank in cranks for built in sets]
    if with_gas and phasing.throw_bounds is None and phasing.firing_order is None:
        candidates = [image for candidate in candidates for image in (candidate, turning_back(phasing, candidate))]
    return candidates


def _slots(phasing: Phasing) -> FiringSlots:
    """What the throws of this layout may share out between them."""
    layout = phasing.layout(*phasing.least_geometry)
    own = [k for k, pin in enumerate(layout.pins) if pin == 0]
    angle = [sum(pair) for pair in zip(*(phasing.bank or (0.0, 0.0), phasing.split or (0.0, 0.0)), strict=True)]
    return FiringSlots(
        phasing.cycle, len(layout.throw_positions), tuple(layout.side(k) for k in own), (angle[0], angle[1]),
        max(phasing.intervals.least, SOONEST), phasing.intervals.most,
    )  # fmt: skip


def _given(phasing: Phasing) -> list[list[int]] | None:
    """Firings of every throw's cylinders, where the firing order is given."""
    if phasing.firing_order is None:
        return None
    pins = phasing.layout(*phasing.least_geometry).pins
    slot = {number - 1: s for s, number in enumerate(phasing.firing_order)}
    return [[slot[k] for k, pin in enumerate(pins) if pin == own] for own in range(max(pins) + 1)]


def none_fires(phasing: Phasing) -> tuple[str, bool]:
    """Why no crank and firing order keeps the intervals allowed, and whether that is proven."""
    allowed = phasing.intervals.shown
    if not phasing.intervals.holds([phasing.even_interval]):
        even = f"{math.degrees(phasing.even_interval):g}"
        return (
            f"no star can meet the intervals: {phasing.cylinders} cylinders fire {even} deg apart on average, "
            f"phasing.intervals allows {allowed}"
        ), True
    if phasing.throws is not None:
        return none_of_given(phasing, phasing.throws), True
    if not phasing.continuous:
        return f"no star exists: {families_of(phasing)[1]}", True
    text = f"no crank and firing order keeps the firing intervals allowed, {allowed}"
    patterns, complete = _slots(phasing).patterns(_given(phasing))
    if not patterns or patterns[0].broken <= _KEPT:
        return text, False
    shown = ends_of(patterns[0].intervals(phasing.cycle))
    text += f"; the most even crank {'' if complete else 'found '}has intervals {shown}"
    if phasing.bank is not None:
        step = 360.0 / (phasing.cylinders // math.gcd(phasing.cycle.turns, phasing.cylinders))
        text += (
            f" with bank angle plus split pins of {math.degrees(patterns[0].angle):.6g} deg, and even firing needs a "
            f"multiple of {step:g} deg"
        )
    return text, complete


def _best_cranks(phasing: Phasing, patterns: Sequence[FiringPattern]) -> list[Candidate]:
    """The best few of the cranks that fire so, as they are before anything moves."""
    found: list[tuple[float, Candidate]] = []
    kept = [pattern for pattern in patterns if pattern.broken <= _KEPT]
    for number, pattern in enumerate(kept):
        # the most even ones come first, and are looked at the closest
        found += _of_pattern(phasing, pattern, number + 1)
    found.sort(key=lambda pair: pair[0])
    unit = max((value for value, _ in found), default=0.0) or 1.0
    # images of one crank are worth the same
    different = {round(value / unit, 9): crank for value, crank in reversed(found)}
    return [different[key] for key in sorted(different)][:_STARTS]


def _of_pattern(phasing: Phasing, pattern: FiringPattern, number: int) -> list[tuple[float, Candidate]]:
    """The best cranks of one way to fire, with their objectives."""
    bank, split = _geometry(phasing, pattern.angle)
    layout, count = phasing.layout(bank, split), len(pattern.members)
    plain = Candidate(tuple(0.0 for _ in range(count)), None, bank, split)
    model = replace(phasing.realise(plain), limits=())
    simple = amplitude_objective(model, phasing, layout)
    orders = _orders(phasing, count, (_MOST_CRANKS if simple else _MOST_EVALUATED) // number**2)
    # a throw stands as far back as its first cylinder fires late (C5)
    firsts = np.array([pattern.moments[members[0]] for members in pattern.members])[orders]
    throws = angle_of(layout.own_turn(0)) + firsts[:, :1] - firsts
    if simple is not None:
        values = simple.of_angles(layout.throw_positions, throws)
        best = np.argsort(values, kind="stable")[: 4 * _STARTS]
    else:
        values, best = np.zeros(len(orders)), np.arange(len(orders))
    cranks = []
    for k in best:
        order = _order_of(layout, pattern, orders[k])
        crank = Candidate(tuple(float(a) % math.tau for a in throws[k]), order, bank, split)
        value = float(values[k]) if simple is not None else _value(phasing, crank)
        if math.isfinite(value):
            cranks.append((value, crank))
    return cranks


def _value(phasing: Phasing, crank: Candidate) -> float:
    try:
        problem = phasing.realise(crank)
        return objective_value(problem, evaluate(problem))
    except ModelError:
        return math.inf


def _orders(phasing: Phasing, count: int, most: int) -> NDArray[np.intp]:
    """Ways to give throws their share of the firings, shape (n, throws): of too many a sample that repeats."""
    if phasing.firing_order is not None:
        return np.arange(count)[None]
    most = max(most, _FEWEST)
    if math.factorial(count) <= most:
        return np.array(list(itertools.permutations(range(count))))
    rng = np.random.default_rng(1964)
    return np.array([rng.permutation(count) for _ in range(most)])


def _order_of(layout: Layout, pattern: FiringPattern, order: Sequence[int]) -> tuple[int, ...]:
    """Cylinders as they fire, the first one first."""
    cylinder = {}
    for pin, own in enumerate(order):
        cylinders = [k for k, at in enumerate(layout.pins) if at == pin]
        cylinder.update(dict(zip(pattern.members[own], cylinders, strict=True)))
    return from_one([cylinder[slot] + 1 for slot in range(len(cylinder))])


def _geometry(phasing: Phasing, angle: float) -> tuple[float | None, float | None]:
    """Bank angle and split pin within their bounds, of this sum, as near to the middle as that allows."""
    if phasing.bank is None:
        return None, None
    (low, high), split = phasing.bank, phasing.split or (0.0, 0.0)
    bank = min(max(angle - 0.5 * (split[0] + split[1]), low), high)
    rest = min(max(angle - bank, split[0]), split[1])
    return min(max(angle - rest, low), high), rest


def _ends(bounds: tuple[float, float] | None) -> list[float | None]:
    if bounds is None:
        return [None]
    return [bounds[0]] if bounds[0] == bounds[1] else [bounds[0], 0.5 * (bounds[0] + bounds[1]), bounds[1]]


def _within_bounds(phasing: Phasing, bank: float | None, split: float | None) -> list[Candidate]:
    """Throws within bounds of their own, in firing orders that they can keep."""
    free = replace(phasing, intervals=Intervals(0.0, math.inf), criteria=(OrderCriterion.ROLL_MOMENT,))
    low, high = np.array(phasing.throw_bounds).T
    drawn = np.random.default_rng(1964).uniform(low, high, (_DRAWN, len(low)))
    for stars in (bounded_stars(phasing, phasing.layout(bank, split)), [tuple(map(float, own)) for own in drawn]):
        found = []
        for throws in stars:
            orders = ranked_orders(free, Candidate(throws, None, bank, split))
            kept = [order for order in orders if min(order.intervals) > SOONEST]
            # the orders whose intervals are nearest to those allowed
            kept.sort(key=lambda order: _outside(phasing.intervals, order.intervals))
            found += [Candidate(throws, order.order, bank, split) for order in kept[:2]]
        if found:
            break
    return found


def _outside(allowed: Intervals, intervals: Sequence[float]) -> float:
    return round(sum(max(allowed.least - i, 0.0) + max(i - allowed.most, 0.0) for i in intervals), 9)


def turning_back(phasing: Phasing, candidate: Candidate) -> Candidate:
    """The star of a crank that turns the other way: banks change sides, firings follow each other backwards."""
    layout = phasing.layout_of(candidate)
    number = {(pin, layout.side(k)): k + 1 for k, pin in enumerate(layout.pins)}
    partners = [number[pin, -layout.side(k)] for k, pin in enumerate(layout.pins)]
    order = [partners[k - 1] for k in reversed(candidate.firing_order or ())]
    throws = [-angle for angle in candidate.throws]
    # cylinder 1 at its dead centre when phi = 0 (C5)
    shift = angle_of(layout.own_turn(0)) - throws[layout.pins[0]]
    turned = tuple((angle + shift) % math.tau for angle in throws)
    return replace(candidate, throws=turned, firing_order=from_one(order) if order else None)
