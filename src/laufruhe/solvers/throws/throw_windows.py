"""List the firing windows of a problem, and convert designs to angles of a window (S26).

A firing window is a firing order with bounds of all throws.
"""

from __future__ import annotations

import itertools
import math
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
from laufruhe.prove.witness import thin_box

MAX_WINDOWS = 6_000
"""Largest number of firing windows that a search covers."""


def windows_of(problem: Problem, phasing: Phasing) -> list[FiringWindow] | None:
    """Return all firing windows (firing orders with whole turns) of a problem; None if they are too many.

    Of equivalent mirror images, one is listed.
    """
    layout, allowed = phasing.layout(*phasing.minimum_geometry), phasing.intervals
    firing = firing_bounds(phasing)
    is_free = allowed.minimum <= 0.0 and allowed.maximum >= phasing.cycle.angle
    if phasing.throw_bounds is not None and is_free and phasing.firing_order is None and not problem.depends_on_gas:
        # without gas and limits on intervals, the firing order has no effect
        return [firing.anywhere]
    # one of four mirror images suffices
    images = 4 if _has_mirror_images(problem, phasing) else 1
    windows = list(itertools.islice(firing.windows(), images * MAX_WINDOWS + 1))
    if images > 1 and len(windows) <= images * MAX_WINDOWS:
        along = sorted(range(len(layout.positions)), key=lambda k: -layout.positions[k])
        # numbers of the cylinders at equal distances from the middle
        mirrored = {a + 1: b + 1 for a, b in zip(along, reversed(along), strict=True)}
        windows = [
            window
            for window in windows
            if window.order
            == min(
                from_one(order)
                for numbers in (window.order, tuple(mirrored[number] for number in window.order))
                for order in (numbers, numbers[::-1])
            )
        ]
    if len(windows) > MAX_WINDOWS:
        return [firing.anywhere] if phasing.throw_bounds is not None and not problem.depends_on_gas else None
    return windows


def _has_mirror_images(problem: Problem, phasing: Phasing) -> bool:
    # True if mirror images of a crank have equal objectives (S2)
    if phasing.throw_bounds is not None or phasing.firing_order is not None or phasing.bank is not None:
        return False
    layout = phasing.layout(None, None)
    places = sorted(layout.throw_positions)
    if any(abs(a + b) > 1e-9 * places[-1] for a, b in zip(places, places[::-1], strict=True)):
        return False
    limit_terms = [Term(limit.measure) for limit in problem.limits]
    without_limits = replace(problem, phasing=None, objective=(*problem.objective, *limit_terms), limits=())
    return amplitude_objective(without_limits, phasing, layout) is not None


def firing_bounds(phasing: Phasing) -> FiringBounds:
    """Return the bounds of firing intervals, throws and open angles."""
    layout, allowed = phasing.layout(*phasing.minimum_geometry), phasing.intervals
    pairs = zip((phasing.bank, phasing.split), phasing.is_geometry_open, strict=True)
    return FiringBounds(
        phasing.cycle, layout, max(allowed.minimum, 0.0), allowed.maximum, phasing.throw_bounds, phasing.firing_order,
        tuple(pair for pair, is_open in pairs if pair and is_open),
    )  # fmt: skip


def design_at(phasing: Phasing, angles: Array) -> Candidate:
    """Return the crank at angles of a box: throws, then open bank and split pin angles [rad]; no firing order."""
    layout = phasing.layout(*phasing.minimum_geometry)
    count = len(layout.throw_positions)
    shared = iter(angles[count:])
    geometry = [
        float(np.clip(next(shared), *pair)) if is_open and pair is not None else (None if pair is None else pair[0])
        for pair, is_open in zip((phasing.bank, phasing.split), phasing.is_geometry_open, strict=True)
    ]
    # open throws are relative to the crank with cylinder 1 at its dead centre
    shift = layout.side(0) * float(angles[count:].sum()) if phasing.throw_bounds is None else 0.0
    throws = tuple(float(angle + shift) % math.tau for angle in angles[:count])
    return Candidate(throws, None, geometry[0], geometry[1])


def place_in(phasing: Phasing, window: FiringWindow, candidate: Candidate) -> Array | None:
    """Return the angles of a crank in the order of boxes (see `design_at`) [rad]; None if it is outside the window."""
    if window.order and window.order != candidate.firing_order:
        return None
    layout = phasing.layout(*phasing.minimum_geometry)
    geometry = (candidate.bank_angle, candidate.split_pin)
    shared = [float(angle or 0.0) for angle, is_open in zip(geometry, phasing.is_geometry_open, strict=True) if is_open]
    shift = layout.side(0) * sum(shared) if phasing.throw_bounds is None else 0.0
    low, high = window.box
    throws = np.array(candidate.throws) - shift
    # equivalent angle nearest to the middle of the box
    first = slice(0, len(throws))
    throws = throws + math.tau * np.round((0.5 * (low[first] + high[first]) - throws) / math.tau)
    place = np.append(throws, shared)
    is_inside = np.all(place >= low - SLACK) and np.all(place <= high + SLACK)
    return np.clip(place, low, high) if is_inside and window.within(*thin_box(place, low, high)) is not None else None


def has_same_unbalances(phasing: Phasing, candidate: Candidate) -> bool:
    """Return True if no unbalance depends on bank and split pin angles, as rotating masses on offset pins do."""
    ends = [(pair, 0.5 * (pair[0] + pair[1])) if pair else ((None,), None) for pair in (phasing.bank, phasing.split)]
    states = [
        rotor_states(
            phasing.problem_of(replace(candidate, firing_order=None, bank_angle=b, split_pin=s, without_gas=True))
        )
        for b, s in product((*ends[0][0], ends[0][1]), (*ends[1][0], ends[1][1]))
    ]
    return all(state == states[0] for state in states)


def nearest_throws(window: FiringWindow, throws: Array | None = None) -> Array:
    """Return throw angles inside a firing window, each as near to `throws` as the angles before it allow [rad].

    Without `throws`, each is in the middle of the range that the previous throws leave.
    """
    low, high = window.box
    for k in range(len(low if throws is None else throws)):
        angle = 0.5 * (low[k] + high[k]) if throws is None else np.clip(throws[k], low[k], high[k])
        is_throw = np.arange(len(low)) == k
        low, high = window.within(np.where(is_throw, angle, low), np.where(is_throw, angle, high)) or (low, high)
    return np.asarray(0.5 * (low + high))
