"""The lead between two cranks that share chambers with gas in them: a search of designs, and boxes of leads (P15)."""

from __future__ import annotations

import math
import time

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import divide
from laufruhe.prove.boxes.shared_gas import SharedGasBoxes
from laufruhe.prove.certificate import Reach
from laufruhe.solvers.boxes.search import searched
from laufruhe.solvers.conclusion import KEPT, Design, Shown, better, concluded, judged, known_of, none_within
from laufruhe.solvers.result import Result

MOST_BOXES = 20_000
GRID, MOST_STARTS, MOST_STEPS = 48, 400, 80
"""Steps of a lead, and designs in all, among which searches begin, and their own steps."""
SHARE = 0.5
"""Of the tolerance, by which no design is better where boxes end."""


def solve_shared_leads(problem: Problem) -> Result:
    """The best leads, proven as far as boxes go."""
    started, initial = time.perf_counter(), evaluate(problem)
    lower, upper = (np.array([getattr(d, side) for d in problem.decisions]) for side in ("lower", "upper"))
    boxes, best = SharedGasBoxes(problem), _best(problem, lower, upper)
    allowed = best is not None and best.excess <= KEPT
    value = best.value if best is not None and allowed else math.inf
    most = problem.search.boxes_or(MOST_BOXES)
    room = SHARE * problem.tolerance * max(value, nothing_of(problem)) if allowed else 0.0
    known = known_of(best, np.array([float(x.real) for x in best.values])) if best is not None and allowed else None
    found = divide(boxes, lower, upper, value, room, most, known)
    timing = {"solve": time.perf_counter() - started}
    if best is None or (not allowed and math.isinf(found.bound)):
        return none_within(problem, initial, tuple(limit.name for limit in problem.limits), timing)
    method = f"local searches; lower bound on {found.boxes} box{'es' * (found.boxes > 1)} of leads"
    return concluded(best, initial, Shown(found.bound, Reach.WHOLE, math.inf, method), timing)


def _best(problem: Problem, lower: Array, upper: Array) -> Design | None:
    """Of a grid, and where searches from its best points end."""

    def design(leads: Array) -> Design | None:
        try:
            return judged(problem, [float(x) for x in np.clip(leads, lower, upper)])
        except ModelError:
            return None

    def penalised(leads: Array) -> float:
        found = design(leads)
        return math.inf if found is None else found.value * (1.0 + 1e3 * max(found.excess, 0.0))

    found = (design(end) for end in searched(penalised, lower, upper, GRID, MOST_STARTS, MOST_STEPS))
    best = design(np.array([d.start_number for d in problem.decisions]))
    for end in found:
        best = best if end is None else better(end, best)
    return best
