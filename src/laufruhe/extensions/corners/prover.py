"""Ask corners of boxes of mounts, where better designs are met on the way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from laufruhe.extensions.corners.boxes import DesignBoxes, designed_bound, mixes_corners
from laufruhe.numerics.arrays import Array
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided
from laufruhe.prove.mounts.provers import Prover, Question
from laufruhe.prove.mounts.subdivision import divides
from laufruhe.solvers.mounts.places import started_at
from laufruhe.solvers.told_limits import over_read


def applies(problem: Problem) -> bool:
    """Return whether unbalances are open beside several numbers of mounts; boxes of one number are few."""
    return len(problem.decisions) > 1 and not divides(problem) and mixes_corners(problem)


def bounds(question: Question) -> Iterator[Divided]:
    """Yield one bound, with the best design that was met at a corner, whose value the question then has."""
    problem = question.problem
    if question.of_many or question.value == math.inf:
        return

    def judge(mounts: Array, columns: Array) -> float:
        design = started_at(problem, (mounts.tolist(), columns))
        if design is None or design.excess > 0.0:
            return math.inf
        return design.value - over_read(problem, design.evaluation)

    boxes = DesignBoxes(problem, question.value, judge)
    found = designed_bound(boxes, question.room, question.known)
    question.value = boxes.value
    yield replace(found, places=() if boxes.best is None else (np.concatenate(boxes.best),))


CORNERS = Prover("boxes of mounts, with unbalances", applies, bounds, "boxes of stiffness")
