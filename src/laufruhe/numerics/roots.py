"""Bisection, without a library that loads longer than a small problem takes."""

from __future__ import annotations

from collections.abc import Callable

_MOST_HALVINGS = 200


def rising_root(function: Callable[[float], float], below: float, above: float) -> float:
    """Return the zero of a rising function to the last digit of a float, by bisection.

    Parameters
    ----------
    below, above
        Where it is not above zero, and where it is.
    """
    for _ in range(_MOST_HALVINGS):
        middle = 0.5 * (below + above)
        if not below < middle < above:
            break
        if function(middle) <= 0.0:
            below = middle
        else:
            above = middle
    return below


def bisect_property(holds: Callable[[float], bool], start: float, end: float, halvings: int) -> tuple[float, float]:
    """Bisect to the end of a property that holds from a start on: last place known to hold, first known not to."""
    for _ in range(halvings):
        middle = 0.5 * (start + end)
        start, end = (middle, end) if holds(middle) else (start, middle)
    return start, end
