"""Bisection, without a library whose import takes longer than a small problem."""

from __future__ import annotations

from collections.abc import Callable

_MAX_HALVINGS = 200


def rising_root(function: Callable[[float], float], below: float, above: float) -> float:
    """Return the zero of a function that never falls, exact to the last digit of a float, by bisection.

    The value is at most zero at `below`, and above zero at `above`.
    """
    for _ in range(_MAX_HALVINGS):
        middle = 0.5 * (below + above)
        if not below < middle < above:
            break
        if function(middle) <= 0.0:
            below = middle
        else:
            above = middle
    return below


def bisect_property(holds: Callable[[float], bool], start: float, end: float, halvings: int) -> tuple[float, float]:
    """Return an argument where a property holds and one where it does not, after some halvings of their interval.

    The property holds at `start` and not at `end`.
    """
    for _ in range(halvings):
        middle = 0.5 * (start + end)
        start, end = (middle, end) if holds(middle) else (start, middle)
    return start, end
