"""Firing windows of a problem: in which orders its throws may fire, and throws that keep one (S26)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.load_models.uneven_model import rotor_states
from laufruhe.machine.firing import from_one
from laufruhe.machine.firing_windows import SLACK, FiringBounds, FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Term
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Sector
from laufruhe.prove.witness import thin

MOST_WINDOWS = 6_000


def windows_of(problem: Problem, phasing: Phasing) -> list[FiringWindow] | None:
    """Every way to fire within the bounds, one of images that are worth the same; None if there are too many."""
    layout, allowed = phasing.layout(*phasing.least_geometry), phasing.intervals
    firing = firing_of(phasing)
    free = allowed.least <= 0.0 and allowed.most >= phasing.cycle.angle
    if phasing.throw_bounds is not None and free and phasing.firing_order is None and not problem.feels_gas:
        # in which order they fire makes no difference
        return [firing.anywhere]
    # of four images one stays
    images = 4 if _has_images(problem, phasing) else 1
    found = list(itertools.islice(firing.windows(), images * MOST_WINDOWS + 1))
    if images > 1 and len(found) <= images * MOST_WINDOWS:
        found = _without_images(found, len(layout.positions))
    if len(found) > MOST_WINDOWS:
        return [firing.anywhere] if phasing.throw_bounds is not None and not problem.feels_gas else None
    return found


def firing_of(phasing: Phasing) -> FiringBounds:
    """What firing has to keep."""
    layout, allowed = phasing.layout(*phasing.least_geometry), phasing.intervals
    return FiringBounds(
        phasing.cycle, layout, max(allowed.least, 0.0), allowed.most, phasing.throw_bounds, phasing.firing_order,
        tuple(pair for pair, own in zip((phasing.bank, phasing.split), phasing.opened, strict=True) if pair and own),
    )  # fmt: skip


def design_at(phasing: Phasing, angles: Array) -> Candidate:
    """Throws, bank angle and split pins at throws and open angles of a box, without a firing order."""
    layout = phasing.layout(*phasing.least_geometry)
    count = len(layout.throw_positions)
    told = iter(angles[count:])
    geometry = [
        float(np.clip(next(told), *pair)) if is_open and pair is not None else (None if pair is None else pair[0])
        for pair, is_open in zip((phasing.bank, phasing.split), phasing.opened, strict=True)
    ]
    # throws that are open are counted from cylinder 1 at its dead centre
    turned = layout.side(0) * float(angles[count:].sum()) if phasing.throw_bounds is None else 0.0
    throws = tuple(float(angle + turned) % math.tau for angle in angles[:count])
    return Candidate(throws, None, geometry[0], geometry[1])


def place_in(phasing: Phasing, window: FiringWindow, candidate: Candidate) -> Array | None:
    """Return throws and open angles of a design as boxes of a window have them; None where it does not keep that."""
    if window.order and window.order != candidate.firing_order:
        return None
    layout = phasing.layout(*phasing.least_geometry)
    geometry = (candidate.bank_angle, candidate.split_pin)
    beside = [float(angle or 0.0) for angle, is_open in zip(geometry, phasing.opened, strict=True) if is_open]
    turned = layout.side(0) * sum(beside) if phasing.throw_bounds is None else 0.0
    low, high = window.box
    throws = np.array(candidate.throws) - turned
    # the same throw, at the turn that is nearest to the middle of its box
    own = slice(0, len(throws))
    throws = throws + math.tau * np.round((0.5 * (low[own] + high[own]) - throws) / math.tau)
    place = np.append(throws, beside)
    inside = np.all(place >= low - SLACK) and np.all(place <= high + SLACK)
    return np.clip(place, low, high) if inside and window.within(*thin(place, low, high)) is not None else None


def stay(phasing: Phasing, candidate: Candidate) -> bool:
    """Whether unbalances are the same at all open angles: a share of what turns on offset pins is not."""
    ends = [(pair, 0.5 * (pair[0] + pair[1])) if pair else ((None,), None) for pair in (phasing.bank, phasing.split)]
    every = [
        rotor_states(
            phasing.realise(replace(candidate, firing_order=None, bank_angle=b, split_pin=s, without_gas=True))
        )
        for b, s in product((*ends[0][0], ends[0][1]), (*ends[1][0], ends[1][1]))
    ]
    return all(states == every[0] for states in every)


def turn_freely(phasing: Phasing, candidate: Candidate, rides: dict[str, int]) -> bool:
    """Whether no unbalance that rides on no throw knows where the crank stands when cylinder 1 fires."""
    problem = phasing.realise(replace(candidate, firing_order=None, without_gas=True))
    free = {rotor.name for rotor in problem.engine.rotors if rotor.name not in rides}
    if any(rotor.unbalance for rotor in problem.engine.rotors if rotor.name in free):
        return False
    for decision in problem.unbalances:
        theirs = [drive for drive in decision.rotor_drives if drive.rotor in free]
        if theirs and (
            len(decision.rotor_drives) > 1 or not isinstance(decision.set, Sector) or not decision.set.free_angle
        ):
            return False
    return True


def _has_images(problem: Problem, phasing: Phasing) -> bool:
    """Whether swapping front and back, or turning the other way, changes nothing (S2)."""
    if phasing.throw_bounds is not None or phasing.firing_order is not None or phasing.bank is not None:
        return False
    layout = phasing.layout(None, None)
    places = sorted(layout.throw_positions)
    if any(abs(a + b) > 1e-9 * places[-1] for a, b in zip(places, places[::-1], strict=True)):
        return False
    asked = [Term(limit.measure) for limit in problem.limits]
    alone = replace(problem, phasing=None, objective=(*problem.objective, *asked), limits=())
    return amplitude_objective(alone, phasing, layout) is not None


def _without_images(windows: Sequence[FiringWindow], count: int) -> list[FiringWindow]:
    kept = []
    for window in windows:
        mirrored = tuple(count + 1 - number for number in window.order)
        images = [from_one(order) for own in (window.order, mirrored) for order in (own, own[::-1])]
        if window.order == min(images):
            kept.append(window)
    return kept


def amid(window: FiringWindow) -> Array:
    """Throws inside a window, each in the middle of what those before it leave to it."""
    low, high = window.box
    for k in range(len(low)):
        here = np.arange(len(low)) == k
        at = 0.5 * (low[k] + high[k])
        low, high = window.within(np.where(here, at, low), np.where(here, at, high)) or (low, high)
    return np.asarray(0.5 * (low + high))


def nearest(window: FiringWindow, throws: Array) -> Array:
    """Throws that keep a window, each as near as those before it let it come."""
    low, high = window.box
    for k, angle in enumerate(throws):
        at = float(np.clip(angle, low[k], high[k]))
        here = np.arange(len(low)) == k
        low, high = window.within(np.where(here, at, low), np.where(here, at, high)) or (low, high)
    return np.asarray(0.5 * (low + high))
