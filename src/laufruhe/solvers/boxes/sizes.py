"""Deciding sizes of the running gear: local programs find a design, boxes of sizes prove it (Z12)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.sized_model import SizeModel
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided
from laufruhe.prove.boxes.sizes import MOST_BOXES, SizeBoxes, divided_sizes
from laufruhe.prove.certificate import Reach
from laufruhe.solvers.conclusion import concluded, none_within
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, looks, proven, searched, shown

MOST_WITH_ROD = 300
"""Boxes where the length of the rod is open, which take ten times as long."""
STARTS = 3
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
    boxes = _boxes(model)

    def bounded(value: float, room: float) -> Divided:
        usual = MOST_WITH_ROD if model.moves_rod else MOST_BOXES
        most = usual if problem.search.boxes is None else problem.search.boxes
        return Divided(0.0, 0) if boxes is None else divided_sizes(boxes, value, room, most)

    found = proven(program, best, bounded)
    if boxes is not None and found.excludes_all:
        return none_within(problem, initial, _conflict(problem, boxes), {"solve": time.perf_counter() - started})
    told = _why(problem) if boxes is None else f"local programs; lower bound on {found.divided.boxes} boxes of sizes"
    proof = shown(program, found.design, found.bound, Reach.ASIDE if boxes is None else Reach.WHOLE, told)
    return concluded(found.design, initial, proof, {"solve": time.perf_counter() - started})


def _boxes(model: SizeModel) -> SizeBoxes | None:
    """Boxes that bound what is asked; None where nothing bounds it."""
    try:
        return SizeBoxes(model)
    except ValueError:
        return None


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


def _why(problem: Problem) -> str:
    has_rod = any(decision.name == "engine.rod_length" for decision in problem.decisions)
    why = "local programs; bends of a load move with the length of the rod, and nothing bounds it"
    return why if has_rod else "local programs"
