"""Where something changes, without a library that takes longer to load than a small problem takes."""

from __future__ import annotations

from collections.abc import Callable

_MOST_HALVINGS = 200


def rising_root(function: Callable[[float], float], below: float, above: float) -> float:
    """Place where a rising function crosses zero, to the last digit of a float, by halving.

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


def parted(holds: Callable[[float], bool], start: float, end: float, halvings: int) -> tuple[float, float]:
    """Where what holds from a start on ends: the last place known to hold, and the first known not to."""
    for _ in range(halvings):
        middle = 0.5 * (start + end)
        start, end = (middle, end) if holds(middle) else (start, middle)
    return start, end
