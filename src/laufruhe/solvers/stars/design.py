"""One star with everything else decided, whichever method did it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from laufruhe.problem.evaluation import with_fine_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import KEPT, state
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result, Status


@dataclass(frozen=True, eq=False)
class StarDesign:
    """A star and firing order, everything else decided.

    Attributes
    ----------
    result
        Of the problem with this star.
    steps
        Where it fires evenly.
    kkt_residual
        Of the program that moved its throws.
    moved
        Whether they left the star that they were started from.
    """

    candidate: Candidate
    result: Result
    steps: tuple[int, ...] | None = None
    kkt_residual: float = 0.0
    moved: bool = False

    @cached_property
    def is_met(self) -> bool:
        """Whether it is a design within its limits."""
        return self.result.status.has_design and self.result.final.excess(self.result.problem.limits) <= KEPT

    @property
    def is_excluded(self) -> bool:
        """Whether no design of this star keeps the limits: a mean at a few angles alone may be more than it is (P7)."""
        result = self.result
        if not result.status.has_design:
            return result.status is Status.INFEASIBLE
        return with_fine_sampling(result.final).excess(result.problem.limits) > KEPT

    @property
    def value(self) -> float:
        """Objective by the exact model [SI]; infinite where there is none."""
        return math.inf if self.result.objective is None or not self.is_met else self.result.objective.value

    @property
    def bound(self) -> float:
        """What no design of this star goes under."""
        return self.result.certificate.lower_bound if self.result.certificate else self.value


def solve_fixed(problem: Problem) -> Result:
    """A problem with nothing of its phasing open, its unbalances at their optimum."""
    return solve_unbalances(problem) if problem.decisions else state(problem)
