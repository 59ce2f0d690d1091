"""Designs of boxes: some decisions held where a box says, the unbalances at their optimum with these."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Side
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import Over
from laufruhe.prove.certificate import Reach
from laufruhe.prove.witness import Known
from laufruhe.solvers.boxes.search import Box, Search, divided
from laufruhe.solvers.conclusion import Design, Shown, concluded, judged, known_of, none_within, unbalances_of
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.prices import Price
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

    @property
    def rank(self) -> tuple[bool, float]:
        """Of the design."""
        return self.design.rank


class Sided(Box, Protocol):
    """A box with sides."""

    @property
    def lower(self) -> Array:
        """Lower ends."""

    @property
    def upper(self) -> Array:
        """Upper ends."""


S = TypeVar("S", bound=Sided)


class HeldDesigns(Search[S, HeldDesign]):
    """What a search over boxes knows of its designs, and of the limits that were not met in boxes."""

    conflict: tuple[str, ...] = ()
    angles = 0
    """Angles of a cycle at which programs begin, at least."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def known(self, found: HeldDesign) -> Known | None:
        """Return a design as a witness of bounds; None where it breaks limits."""
        return known_of(found.design, self.place(found))

    def place(self, found: HeldDesign) -> Array:
        """Return what boxes are of, of a design."""
        held = zip(self.problem.decisions, found.design.values, strict=True)
        return np.array([float(value.real) for decision, value in held if not decision.is_affine])

    def holds(self, box: S, found: HeldDesign) -> bool:
        """Return whether a design lies in a box."""
        at = self.place(found)
        return bool(np.all(box.lower <= at) and np.all(at <= box.upper))

    def prices(self, _: Design) -> dict[Side, Price]:
        """Prices of limits that the problem of the unbalances does not know."""
        return {}

    def told(self, conflict: Sequence[str]) -> None:
        """What cannot be met in one box may be in another: all boxes together tell."""
        told = {*self.conflict, *conflict}
        self.conflict = tuple(limit.name for limit in self.problem.limits if limit.name in told)

    def solved(self, root: S | Over, first: HeldDesign | None, most: int, what: str, how: str) -> Result:
        """The best design that dividing the boxes comes to, proven as far as that goes.

        Parameters
        ----------
        root
            All that is open, or that no design is allowed.
        first
            A design to begin with.
        most
            Boxes.
        what, how
            Is divided, and bounded, in words.
        """
        started, problem = time.perf_counter(), self.problem
        initial, best, bound, boxes = evaluate(problem), first, math.inf, 1
        if not isinstance(root, Over) and first is not None:
            nothing = nothing_of(problem)
            best, bound, boxes = divided(self, root, first, nothing, problem.tolerance, most, f"boxes of {what}")
        timing = {"solve": time.perf_counter() - started}
        if best is None or (math.isinf(bound) and best.design.rank[0]):
            return none_within(problem, initial, self.conflict, timing)
        own, design = best.result, best.design
        shown = Shown(
            bound=0.0 if design.rank[0] else bound,
            reach=Reach.WHOLE,
            kkt_residual=own.certificate.kkt_residual if own is not None and own.certificate is not None else math.inf,
            method=f"{how} {boxes} box{'es' * (boxes > 1)} of {what}",
            prices=(own.prices if own is not None else {}) | self.prices(design),
        )
        return concluded(design, replace(initial, samples=design.evaluation.samples), shown, timing)


def best_with(problem: Problem, held: Problem, where: dict[str, Value], angles: int = 0) -> HeldDesign:
    """Find the best design with some decisions given, by the problem of its unbalances.

    Where none is allowed the unbalances stay as given, and the design breaks its limits.

    Parameters
    ----------
    where
        Values of the decisions that are given.
    angles
        Of a cycle, at which the program begins at least.
    """
    result, samples = None, None
    values: dict[str, Value] = {decision.name: decision.start for decision in problem.decisions} | where
    if held.decisions:
        held = replace(held, tolerance=SHARE * problem.tolerance)
        result = solve_unbalances(held, angles=angles)
        if result.status is not Status.INFEASIBLE:
            found = unbalances_of(held, result)
            values |= dict(zip((decision.name for decision in held.decisions), found, strict=True))
        samples = result.final.samples
    return HeldDesign(judged(problem, list(values.values()), samples), result)
