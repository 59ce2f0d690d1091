"""Roots of a function, without a library whose import takes longer than a small problem."""

from __future__ import annotations

import math
from collections.abc import Callable

_MAX_STEPS = 200
_BELOW_ZERO = -1e-300


def rising_root(function: Callable[[float], float], below: float, above: float) -> float:
    """Return the zero of a function that never falls, exact to the last digit of a float.

    The value is at most zero at `below`, and above zero at `above`. Inverse quadratic interpolation where it is safe,
    else bisection (Chandrupatla, Advances in Engineering Software 28, 1997, 145-149).
    """
    # of the two ends of the interval, `newest` was evaluated last; `older` was an end before
    newest, opposite = below, above
    of_newest, of_opposite = min(function(below), _BELOW_ZERO), function(above)
    share = 0.5
    for _ in range(_MAX_STEPS):
        middle = 0.5 * (below + above)
        if not below < middle < above:
            break
        place = newest + share * (opposite - newest)
        if not below < place < above:
            place = middle
        value = function(place)
        if value <= 0.0:
            below, value = place, min(value, _BELOW_ZERO)
        else:
            above = place
        if (value > 0.0) == (of_newest > 0.0):
            older, of_older = newest, of_newest
        else:
            older, of_older = opposite, of_opposite
            opposite, of_opposite = newest, of_newest
        newest, of_newest = place, value
        length, rise = (newest - opposite) / (older - opposite), (value - of_opposite) / (of_older - of_opposite)
        share = 0.5
        if rise * rise < length and (1.0 - rise) ** 2 < 1.0 - length:
            share = value / (of_opposite - value) * of_older / (of_opposite - of_older) + (older - newest) / (
                opposite - newest
            ) * value / (of_older - value) * of_opposite / (of_older - of_opposite)
        # the other end follows to the last digits
        inset = min(2.0 * math.ulp(middle) / (above - below), 0.5)
        share = min(max(share, inset), 1.0 - inset)
    return below


def bisect_property(holds: Callable[[float], bool], start: float, end: float, halvings: int) -> tuple[float, float]:
    """Return an argument where a property holds and one where it does not, after some halvings of their interval.

    The property holds at `start` and not at `end`.
    """
    for _ in range(halvings):
        middle = 0.5 * (start + end)
        start, end = (middle, end) if holds(middle) else (start, middle)
    return start, end
