"""Designs of boxes: some decisions held where a box says, the unbalances at their optimum with these."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import Design, judged, unbalances_of
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result, Status

SHARE = 0.25
"""Of the tolerance that the programs of boxes may use up."""


@dataclass(frozen=True, eq=False)
class HeldDesign:
    """A design, and the result for its unbalances with the rest held."""

    design: Design
    result: Result | None = None

    @property
    def value(self) -> float:
        """The objective of a design that is allowed."""
        return math.inf if self.design.rank[0] else self.design.value


class HeldDesigns:
    """What a search over boxes knows of its designs, and of the limits that were not met in boxes."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.conflict: tuple[str, ...] = ()

    @staticmethod
    def better(best: HeldDesign, found: HeldDesign) -> HeldDesign:
        """The better of the best design so far and another."""
        return found if found.design.rank < best.design.rank else best

    def told(self, conflict: Sequence[str]) -> None:
        """What cannot be met in one box may be in another: all boxes together tell."""
        told = {*self.conflict, *conflict}
        self.conflict = tuple(limit.name for limit in self.problem.limits if limit.name in told)

    def best_with(self, held: Problem, where: dict[str, Value]) -> HeldDesign:
        """The best design with some decisions given, by the problem of its unbalances.

        Where none is allowed the unbalances stay as given, and the design breaks its limits.
        """
        result, samples = None, None
        values: dict[str, Value] = {decision.name: decision.start for decision in self.problem.decisions} | where
        if held.decisions:
            held = replace(held, tolerance=SHARE * self.problem.tolerance)
            result = solve_unbalances(held)
            if result.status is not Status.INFEASIBLE:
                found = unbalances_of(held, result)
                values |= dict(zip((decision.name for decision in held.decisions), found, strict=True))
            samples = result.final.samples
        return HeldDesign(judged(self.problem, list(values.values()), samples), result)
