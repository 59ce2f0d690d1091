"""Deciding discs, shafts and absorbers of the crankshaft: local programs from many starts, and boxes (V13)."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.budget import passed
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided, divide
from laufruhe.prove.certificate import Reach, room_of
from laufruhe.prove.twist_boxes import TwistBoxes
from laufruhe.solvers.conclusion import KEPT, Design, Shown, concluded, judged, none_within
from laufruhe.solvers.local_programs import LocalProgram, looks, searched, shown
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

# open numbers that are divided, and boxes that this may take
MOST_OPEN, MOST_BOXES = 3, 3000


def solve_torsion(problem: Problem) -> Result:
    """The best discs, shafts and absorbers found, with what boxes prove; or the limits that none keeps.

    Root mean squares, inertia and irregularity are decided to a proven optimum of up to three numbers. What else
    is asked has a bound by these in it alone.
    """
    started = time.perf_counter()
    initial = evaluate(problem)
    program = LocalProgram.of(problem)
    best = searched(program, [program.shares(problem.start), *looks(problem)], problem.search.starts)
    design = judged(problem, program.values(best))
    boxes, divided = TwistBoxes(problem, initial), Divided(0.0, 0)
    most = _most_boxes(problem) if boxes.coordinates.is_exact and boxes.is_sampled_fully else 0
    for _ in range(2):
        if not most or passed():
            break
        met = design.excess <= KEPT
        if met and not boxes.has_terms:
            break
        value = design.value if met else math.inf
        room = room_of(value, problem.tolerance, nothing_of(problem)) if met else 0.0
        divided = divide(boxes, boxes.coordinates.lower, boxes.coordinates.upper, value, room, most)
        if not met and divided.bound == math.inf:
            names = tuple(limit.name for limit in problem.limits)
            return none_within(problem, initial, names, {"solve": time.perf_counter() - started})
        places = [program.shares(boxes.coordinates.decisions(x)) for x in divided.places]
        again = judged(problem, program.values(searched(program, [best, *places], 3)))
        if again.rank >= design.rank or again.value > value * (1.0 - 0.1 * problem.tolerance):
            break
        design, best = again, program.shares(again.values)
    proof = _shown(program, boxes, divided, design, best)
    return concluded(design, initial, proof, {"solve": time.perf_counter() - started})


def _most_boxes(problem: Problem) -> int:
    if problem.search.boxes is not None:
        return problem.search.boxes
    return MOST_BOXES if len(problem.decisions) <= MOST_OPEN else 0


def _shown(program: LocalProgram, boxes: TwistBoxes, divided: Divided, design: Design, best: Array) -> Shown:
    exact = boxes.coordinates.is_exact and boxes.knows_all
    # of a design that breaks a limit nothing is proven
    is_bounded = design.excess <= KEPT and boxes.coordinates.is_exact
    method = f"local programs; lower bound on {divided.boxes} boxes of discs and shafts"
    reach = Reach.NEAR if exact and is_bounded else Reach.ASIDE
    return shown(program, design, best, divided.bound if is_bounded else 0.0, reach, method)
