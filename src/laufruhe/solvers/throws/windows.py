"""Firing windows of a problem: in which orders its throws may fire, and throws that keep one (S26)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.amplitudes import amplitude_objective
from laufruhe.machine.firing_windows import FiringBounds, FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Term
from laufruhe.problem.problem import Phasing, Problem

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
        phasing.cycle, layout, max(allowed.least, 0.0), allowed.most, phasing.throw_bounds, phasing.firing_order
    )


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
        images = [_from_one(order) for own in (window.order, mirrored) for order in (own, own[::-1])]
        if window.order == min(images):
            kept.append(window)
    return kept


def _from_one(order: tuple[int, ...]) -> tuple[int, ...]:
    first = order.index(1)
    return (*order[first:], *order[:first])


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
