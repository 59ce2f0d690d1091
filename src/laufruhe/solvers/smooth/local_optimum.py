"""Where starts of a nonlinear program end, and when enough of them have been tried (N2, N5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from laufruhe.numerics.arrays import Array

_NEAR = 1e-6
# share of their scale within which values are the same
_SAME = 1e-4
# chance that one more start leads to what is better than all, under which no other is tried
_MISSED = 1.0 / 36.0


class Ending(StrEnum):
    """Outcome of one start of a nonlinear program."""

    CONVERGED = "converged"
    ACCEPTABLE = "converged to a looser tolerance"
    INFEASIBLE = "no point near meets the limits"
    UNFINISHED = "stopped at the limit of iterations or time"
    FAILED = "a function could not be evaluated"


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """End point of one start.

    Attributes
    ----------
    x
        Shape (n,), within the bounds.
    value
        Objective at the last stage's parameters.
    constraints
        Values, shape (m,).
    multipliers
        In the program's own units, positive where an upper side holds (N2).
    kkt_residual
        Largest violation of N2 and of the limits, each over its own scale.
    violation
        The part of it that the limits alone have.
    iterations, seconds
        Over all stages; seconds of the processor.
    ending
        In words.
    start
        Index of the start; the first of those that lead here.
    starts
        How many lead here.
    """

    x: Array
    value: float
    constraints: Array
    multipliers: Array
    kkt_residual: float
    violation: float
    iterations: int
    seconds: float
    ending: Ending
    start: int
    starts: int = 1

    @property
    def usable(self) -> bool:
        """Tell if the solver converged and the limits are kept."""
        return self.ending in (Ending.CONVERGED, Ending.ACCEPTABLE) and self.violation <= _NEAR


def distinct(optima: Sequence[LocalOptimum], scale: float, tolerance: float = _SAME) -> tuple[LocalOptimum, ...]:
    """Return usable optima of distinct values, best first; values within `tolerance` times `scale` count as one."""
    kept: list[LocalOptimum] = []
    for optimum in sorted((o for o in optima if o.usable), key=lambda o: o.value):
        if not kept or optimum.value - kept[-1].value > tolerance * scale:
            kept.append(optimum)
    return tuple(kept)


def ends_in_words(optima: Sequence[LocalOptimum], apart: int) -> str:
    """Return a text on the number of IPOPT starts and of different optima found."""
    if not optima:
        return "a design to start from"
    starts, usable = (sum(o.starts for o in some) for some in (optima, [o for o in optima if o.usable]))
    text = f"IPOPT from {starts} start{'s' if starts > 1 else ''}, "
    if not usable:
        return f"{text}{'none of which' if starts > 1 else 'which never'} converged"
    ends = "one and the same optimum" if apart == 1 else f"{apart} different optima"
    return f"{text}{usable} of which ended at {ends}" if starts > 1 else f"{text}which ended at an optimum"


def is_explored(optima: Sequence[LocalOptimum], scale: float) -> bool:
    """Tell if random starts have very likely met the best optimum, and more than once (N5).

    Where n starts led to w different ones, the next one leads to another with a chance of w (w + 1) / (n (n - 1))
    (Boender and Rinnooy Kan, Math. Programming 37, 1987, 59-80); that is the best of w + 1 with a chance of one in so
    many. A start that leads to none counts as one of its own.
    """
    n, apart = sum(optimum.starts for optimum in optima), distinct(optima, scale)
    w = len(apart) + sum(optimum.starts for optimum in optima if not optimum.usable)
    near = apart[0].value + _SAME * scale if apart else 0.0
    met = sum(optimum.starts for optimum in optima if optimum.usable and optimum.value <= near)
    return met > 1 and w <= _MISSED * n * (n - 1)
