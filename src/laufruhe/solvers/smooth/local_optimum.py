"""Local optima of a nonlinear program, and the stopping rule of a multistart search (N2, N5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from laufruhe.numerics.arrays import Array

# largest relative violation of constraints at a usable optimum
_NEAR = 1e-6
# relative difference of equal objectives
_SAME = 1e-4
# probability of a better optimum from one more start, below which the search ends
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
        Variables within their bounds, shape (n,).
    value
        Objective with the parameters of the last stage.
    constraints
        Values of the constraints, shape (m,).
    multipliers
        Multipliers in the units of the program, positive at an upper bound (N2), shape (m,).
    kkt_residual
        Largest relative violation of N2 and of the constraints.
    violation
        Largest relative violation of the constraints.
    iterations, seconds
        Iterations and processor time [s] of all stages.
    ending
        Outcome of the start.
    start
        Smallest index of the starts that lead to this point.
    starts
        Number of starts that lead to this point.
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
        """True if the solver converged and the constraints are met."""
        return self.ending in (Ending.CONVERGED, Ending.ACCEPTABLE) and self.violation <= _NEAR


def distinct_optima(optima: Sequence[LocalOptimum], scale: float, tolerance: float = _SAME) -> tuple[LocalOptimum, ...]:
    """Return the different usable optima, best first: their objectives differ by more than `tolerance * scale`."""
    best_optima: list[LocalOptimum] = []
    for optimum in sorted((o for o in optima if o.usable), key=lambda o: o.value):
        if not best_optima or optimum.value - best_optima[-1].value > tolerance * scale:
            best_optima.append(optimum)
    return tuple(best_optima)


def describe_starts(optima: Sequence[LocalOptimum], count: int) -> str:
    """Return a text with the number of IPOPT starts and the number `count` of different optima."""
    if not optima:
        return "a design to start from"
    starts, usable = (sum(o.starts for o in group) for group in (optima, [o for o in optima if o.usable]))
    text = f"IPOPT from {starts} start{'s' if starts > 1 else ''}, "
    if not usable:
        return f"{text}{'none of which' if starts > 1 else 'which never'} converged"
    ends = "one and the same optimum" if count == 1 else f"{count} different optima"
    return f"{text}{usable} of which ended at {ends}" if starts > 1 else f"{text}which ended at an optimum"


def is_explored(optima: Sequence[LocalOptimum], scale: float) -> bool:
    """Return True if a search may stop, because more random starts hardly find a better optimum (N5).

    If n starts found w different optima, the next start finds a new one with probability w (w + 1) / (n (n - 1))
    (Boender and Rinnooy Kan, Math. Programming 37, 1987, 59-80). The new one is the best of all w + 1 with probability
    1 / (w + 1). A start without a usable optimum counts as a new optimum. Optima differ if their objectives differ by
    more than a fraction of `scale`.
    """
    n, best_optima = sum(optimum.starts for optimum in optima), distinct_optima(optima, scale)
    w = len(best_optima) + sum(optimum.starts for optimum in optima if not optimum.usable)
    best_value = best_optima[0].value + _SAME * scale if best_optima else 0.0
    best_starts = sum(optimum.starts for optimum in optima if optimum.usable and optimum.value <= best_value)
    return best_starts > 1 and w <= _MISSED * n * (n - 1)
