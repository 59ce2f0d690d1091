"""Provers of open mounts, unbalances and throws: multipliers at vertices of boxes, and boxes of all numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from laufruhe.extensions.joint_mounts.corner_boxes import DesignBoxes, mixes_corners
from laufruhe.extensions.joint_mounts.load_boxes import is_boxed, load_bounds
from laufruhe.extensions.joint_mounts.mounted_loads import throws_at
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import decision_vector, domains_of
from laufruhe.prove.branch_and_bound import BatchBisection, Box, BoxResult
from laufruhe.prove.mounts.provers import Prover, Question
from laufruhe.prove.mounts.subdivision import is_stiffness_problem
from laufruhe.prove.witness import Witness
from laufruhe.solvers.mounts.starts import design_at_start
from laufruhe.solvers.sampling_refinement import sampling_overestimate

EARLY = 0.1
"""Share of the box budget after which other provers run."""


def bounds_from_corners(question: Question) -> Iterator[BoxResult]:
    """Yield one lower bound of the objective, by branch and bound over boxes of mount numbers (E69).

    At each vertex of a box the unbalances are optimised, and their multipliers bound the objective in the box. If a
    design at a vertex is better than the incumbent, `question.value` is lowered to its objective.
    """
    problem = question.problem
    if question.in_batch or question.value == math.inf:
        return

    def objective_at(mounts: Array, columns: Array) -> float:
        design = design_at_start(problem, (mounts.tolist(), columns))
        if design is None or design.violation > 0.0:
            return math.inf
        return design.value - sampling_overestimate(problem, design.evaluation)

    boxes = DesignBoxes(problem, question.value, objective_at)

    class Branching(BatchBisection):
        """Branch and bound with designs at vertices as incumbents."""

        def propose(self, _: Box) -> None:
            """Lower the objective of the incumbent to that of the best vertex."""
            self.value = min(self.value, boxes.value)

    branching, maximum = Branching(boxes, boxes.value, question.gap_tolerance, question.witness), boxes.max_boxes
    if not maximum:
        return
    result = branching.run(branching.bound_boxes([(boxes.lower, boxes.upper)])[0], maximum)
    if question.witness is not None:
        branching.check_near(boxes.lower, boxes.upper, question.witness)
    question.value = boxes.value
    yield replace(result, places=() if boxes.best is None else (np.concatenate(boxes.best),))


def bounds_from_boxes(question: Question) -> Iterator[BoxResult]:
    """Yield lower bounds of the objective, by branch and bound over boxes of mount numbers and unbalances.

    The second bound is omitted if another prover has a better bound than the first.
    """
    if question.in_batch:
        return
    problem, witness = question.problem, _witness(question)
    # a problem of one number needs few boxes
    shares = (1.0,) if len(problem.decisions) == 1 else (EARLY, 1.0)
    for result in load_bounds(problem, question.value, question.gap_tolerance, shares, witness):
        yield replace(result, places=())
        if result.bound < question.bound:
            return


def bounds_with_throws(question: Question) -> Iterator[BoxResult]:
    """Yield one lower bound of the objective for any firing order, by boxes of throws, mounts and unbalances (E72)."""
    throws = None if question.open_throws is None else throws_at(question.problem, *question.open_throws)
    if throws is not None:
        witness = _witness(question)
        if witness is not None:
            witness = replace(witness, place=np.append(witness.place, throws.angles[throws.open]))
        yield from load_bounds(throws.waves.problem, question.value, question.gap_tolerance, (1.0,), witness, throws)


def _witness(question: Question) -> Witness | None:
    # the known design as a point: numbers of mounts, then columns of unbalances
    witness, problem = question.witness, question.problem
    if witness is None:
        return None
    pairs = zip(question.good_values, problem.decisions, strict=True)
    columns = decision_vector(
        domains_of(problem.unbalances), [value for value, decision in pairs if decision.is_affine]
    )
    return replace(witness, place=np.append(witness.place, columns))


CORNERS = Prover("boxes of mounts, with unbalances", mixes_corners, bounds_from_corners, "boxes of stiffness")
LOADS = Prover(
    "boxes of mounts and unbalances",
    lambda problem: not is_stiffness_problem(problem) and is_boxed(problem),
    bounds_from_boxes,
)
THROWS = Prover("boxes of throws, mounts and unbalances", lambda _: True, bounds_with_throws, for_open_throws=True)
