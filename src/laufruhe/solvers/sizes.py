"""Deciding sizes of the running gear: local programs find a design, boxes of sizes prove it (Z12)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.load_models.sized_model import SizeModel
from laufruhe.numerics.budget import passed
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided
from laufruhe.prove.certificate import Reach, room_of
from laufruhe.prove.size_boxes import MOST_BOXES, SizeBoxes, divided_sizes
from laufruhe.solvers.conclusion import KEPT, Design, Shown, concluded, judged, none_within
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.local_programs import LocalProgram, looks, searched, shown
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

STARTS, TRIES = 3, 2
# relative room that local programs leave inside limits, a part of what counts as kept
INSIDE = 1e-7


@dataclass(frozen=True, eq=False)
class _SizeProgram(LocalProgram):
    """Objective and rooms by the model of sizes, which is the exact one at the angles of the results."""

    model: SizeModel

    def numbers(self, shares: Array) -> Array:
        """The objective, then the relative room inside each limit."""
        x, problem = np.array(self.values(shares)), self.problem
        value = sum(term.weight * self.model.value(term.measure, x) for term in problem.objective)
        rooms = [limit.room(self.model.value(limit.measure, x))[0] - INSIDE for limit in problem.limits]
        return np.array([value, *rooms])


def solve_sizes(problem: Problem) -> Result:
    """The best sizes, proven where the length of the rod is given; or the limits that no sizes keep.

    Raises
    ------
    ModelError
        If nothing that is asked hangs on a size that is open.
    """
    started = time.perf_counter()
    initial, model = evaluate(problem), SizeModel(problem)
    _check_acts(model)
    program = _SizeProgram(problem, model.lower, model.upper, model)
    given = program.shares(problem.start)
    starts = [given, np.ones(len(given)), *looks(problem)]
    best = searched(program, starts, min(problem.search.starts, STARTS))
    design, divided, boxes = judged(problem, program.values(best)), Divided(0.0, 0), _boxes(model)
    for _ in range(TRIES):
        if boxes is None or passed():
            break
        met = design.excess <= KEPT
        divided = _divided(boxes, design if met else None)
        if not met and divided.bound == math.inf:
            names = _conflict(problem, boxes)
            return none_within(problem, initial, names, {"solve": time.perf_counter() - started})
        if met and divided.bound >= design.value - room_of(design.value, problem.tolerance, 0.0):
            break
        places = [program.shares(x) for x in divided.places]
        again = searched(program, [best, *places], len(places) + 1)
        if program.rank(again) >= program.rank(best):
            break
        best, design = again, judged(problem, program.values(again))
    proof = _shown(program, boxes, divided, design, best)
    return concluded(design, initial, proof, {"solve": time.perf_counter() - started})


def _boxes(model: SizeModel) -> SizeBoxes | None:
    """Boxes that bound what is asked; None where nothing bounds it."""
    try:
        return SizeBoxes(model)
    except ValueError:
        return None


def _divided(boxes: SizeBoxes, design: Design | None) -> Divided:
    problem = boxes.model.problem
    most = MOST_BOXES if problem.search.boxes is None else problem.search.boxes
    if design is None:
        return divided_sizes(boxes, math.inf, 0.0, most)
    room = room_of(design.value, problem.tolerance, nothing_of(problem, design.evaluation.engine))
    return divided_sizes(boxes, design.value, room, most)


def _conflict(problem: Problem, boxes: SizeBoxes) -> tuple[str, ...]:
    """Limits that no sizes keep together, as far as boxes tell."""
    return smallest_conflict(
        problem.limits, lambda kept: divided_sizes(boxes.keeping(kept), math.inf, 0.0, 64).bound == math.inf
    )


def _check_acts(model: SizeModel) -> None:
    """Refuse a size that nothing asked hangs on."""
    measures = dict.fromkeys(model.problem.measures)
    for k, decision in enumerate(model.problem.decisions):
        middle = 0.5 * (model.lower + model.upper)
        ends = [np.where(np.arange(len(middle)) == k, edge, middle) for edge in (model.lower, model.upper)]
        if all(model.value(measure, ends[0]) == model.value(measure, ends[1]) for measure in measures):
            raise ModelError(f"{decision.name} is open, and nothing that is asked depends on it; fix it, or limit it")


def _shown(program: LocalProgram, boxes: SizeBoxes | None, divided: Divided, design: Design, best: Array) -> Shown:
    if boxes is None:
        why = "local programs; nothing bounds the length of the rod" if _has_rod(program) else "local programs"
        return shown(program, design, best, 0.0, Reach.ASIDE, why)
    method = f"local programs; lower bound on {divided.boxes} boxes of sizes"
    return shown(program, design, best, divided.bound if design.excess <= KEPT else 0.0, Reach.WHOLE, method)


def _has_rod(program: LocalProgram) -> bool:
    return any(decision.name == "engine.rod_length" for decision in program.problem.decisions)
