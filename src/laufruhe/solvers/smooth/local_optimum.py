"""Where starts of a nonlinear program end, and when enough of them have been tried (N2, N5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from laufruhe.numerics.arrays import Array

_NEAR = 1e-6
# optima that a rule may miss on average
_MISSED = 0.5


class Ending(StrEnum):
    """How one start of a nonlinear program ended."""

    CONVERGED = "converged"
    ACCEPTABLE = "converged to a looser tolerance"
    INFEASIBLE = "no point near meets the limits"
    UNFINISHED = "stopped at the limit of iterations or time"
    FAILED = "a function could not be evaluated"


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """Where one start ended.

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
        Over all stages.
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
        """Whether this is a local optimum to trust."""
        return self.ending in (Ending.CONVERGED, Ending.ACCEPTABLE) and self.violation <= _NEAR


def distinct(optima: Sequence[LocalOptimum], scale: float, tolerance: float = 1e-4) -> tuple[LocalOptimum, ...]:
    """One of every group of usable optima whose values agree to `tolerance` of `scale`, best first."""
    kept: list[LocalOptimum] = []
    for optimum in sorted((o for o in optima if o.usable), key=lambda o: o.value):
        if not kept or optimum.value - kept[-1].value > tolerance * scale:
            kept.append(optimum)
    return tuple(kept)


def is_explored(optima: Sequence[LocalOptimum], scale: float) -> bool:
    """Whether starts spread at random have very likely met every optimum (N5).

    Where n starts led to w different ones, w (n - 1) / (n - w - 2) are expected (Boender and Rinnooy Kan, Math.
    Programming 37, 1987, 59-80). A start that leads to none counts as one of its own.
    """
    n = sum(optimum.starts for optimum in optima)
    w = len(distinct(optima, scale)) + sum(optimum.starts for optimum in optima if not optimum.usable)
    return n > w + 2 and w * (n - 1) <= (w + _MISSED) * (n - w - 2)
