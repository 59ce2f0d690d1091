"""Whether stiffnesses keep limits together: boxes that may keep them best are divided first (E67)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Around, Bounded, Box, Waiting
from laufruhe.prove.mounts.box_lines import BoxLines
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, worth_halving
from laufruhe.prove.witness import Known, check_around

Keeps = Callable[[Array], bool]
"""Whether a design keeps the limits, by the exact model."""


class LimitBoxes:
    """What the largest relative excess over limits is not under, in boxes.

    Parameters
    ----------
    problem
        That `divides`; its objective does not count.
    """

    what = "boxes of stiffness, for the limits"

    def __init__(self, problem: Problem) -> None:
        self._boxes = StiffnessBoxes(replace(problem, objective=()), 0.0)

    @property
    def at_once(self) -> int:
        """Boxes of one round."""
        return self._boxes.at_once

    @property
    def most_boxes(self) -> int:
        """As many as are worth it."""
        return self._boxes.most_boxes if self._boxes.is_sampled_fully else 0

    @property
    def whole(self) -> tuple[Array, Array]:
        """All that is open."""
        return self._boxes.model.lower, self._boxes.model.upper

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least excess in every box, infinite where a limit is surely broken; and the side worth halving."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return self._bounds(lower, upper)

    def _bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        boxes = BoxLines.of(lower)
        self._boxes.hold(boxes, lower, upper)
        found, pull = boxes.excess, boxes.pull
        broken = self._boxes.breaks(lower, upper) | (found > 0.0)
        left = np.flatnonzero(~broken)
        if self._boxes.simulated is not None and len(left):
            own = boxes.kept(left)
            self._boxes.add_simulated(own, lower[left], upper[left])
            found[left], pull[left] = own.excess, own.pull
        found = np.where(broken | (found > 0.0), np.inf, found)
        return found, worth_halving(pull, lower, upper)


class _Excluding(Bounded):
    """Boxes divided until none is left, or a middle keeps all limits."""

    of_objective = False

    def __init__(self, search: LimitBoxes, keeps: Keeps) -> None:
        super().__init__(search, math.inf, math.inf)
        self._keeps = keeps
        self.design: Array | None = None

    def look(self, part: Box) -> None:
        """At the middle of the box that may keep limits best."""
        middle = 0.5 * (part.lower + part.upper)
        if self._keeps(middle):
            self.design = middle

    def is_done(self, one: Waiting[Box]) -> bool:
        """Whether a design is known."""
        return self.design is not None or super().is_done(one)


@dataclass(frozen=True, eq=False)
class Exclusion:
    """What boxes tell of limits.

    Attributes
    ----------
    is_proven
        Whether no design keeps them all.
    design
        One that does, if one was met.
    boxes
        That were looked at.
    """

    is_proven: bool
    design: Array | None
    boxes: int


def excluded(problem: Problem, keeps: Keeps, share: float = 1.0) -> Exclusion:
    """Whether no design keeps all limits of a problem that `divides`, or one that does.

    Parameters
    ----------
    keeps
        Whether a design does, by the exact model.
    share
        Of the boxes that are worth it.
    """
    search = LimitBoxes(problem)
    most = math.ceil(share * search.most_boxes)
    if not most:
        return Exclusion(False, None, 0)
    division = _Excluding(search, keeps)
    left = division.divide(division.bounded([search.whole])[0], most)
    if division.design is not None:
        # of a design that keeps all limits nothing is exceeded
        check_around(Around(search, *search.whole), division.design, Known(division.design, 0.0))
    return Exclusion(left == math.inf, division.design, division.seen)
