"""Solve for the phase lead between two cranks that share gas chambers, by branch and bound (P15)."""

from __future__ import annotations

import math
import time

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.boxes.shared_gas import SharedGasBoxes
from laufruhe.prove.branch_and_bound import bisect_box
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.boxes.search import search_from_grid
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    Design,
    ProofData,
    build_result,
    evaluate_design,
    infeasible_result,
    witness_of,
)
from laufruhe.solvers.result import Result

MAX_BOXES = 20_000
GRID, MAX_STARTS, MAX_STEPS = 48, 400, 80
"""Points of the start grid along a lead and in all, and iterations of a simplex search."""
SHARE = 0.5
"""Share of the tolerance at which the branch and bound search ends."""


def solve_shared_leads(problem: Problem) -> Result:
    """Return the best leads, with a lower bound by branch and bound over leads."""
    started, initial = time.perf_counter(), evaluate(problem)
    lower, upper = real_bounds(problem.decisions)
    boxes, best = SharedGasBoxes(problem), _best_design(problem, lower, upper)
    value, gap_tolerance, witness = math.inf, 0.0, None
    if best is not None and best.violation <= FEASIBILITY_TOL:
        value = best.value
        gap_tolerance = SHARE * problem.tolerance * max(value, numerical_zero(problem))
        witness = witness_of(best, np.array([float(x.real) for x in best.values]))
    division = bisect_box(boxes, lower, upper, value, gap_tolerance, problem.search.boxes_or(MAX_BOXES), witness)
    timing = {"solve": time.perf_counter() - started}
    if best is None or (witness is None and math.isinf(division.bound)):
        return infeasible_result(problem, initial, tuple(limit.name for limit in problem.limits), timing)
    method = f"local searches; lower bound on {division.boxes} box{'es' * (division.boxes > 1)} of leads"
    return build_result(best, initial, ProofData(division.bound, ProofStrength.EXACT, math.inf, method), timing)


def _best_design(problem: Problem, lower: Array, upper: Array) -> Design | None:
    """Return the best of the initial design and the ends of simplex searches from a grid of leads."""

    def design(leads: Array) -> Design | None:
        try:
            return evaluate_design(problem, [float(x) for x in np.clip(leads, lower, upper)])
        except ModelError:
            return None

    def penalised(leads: Array) -> float:
        candidate = design(leads)
        return math.inf if candidate is None else candidate.value * (1.0 + 1e3 * max(candidate.violation, 0.0))

    start = np.array([d.real_start for d in problem.decisions])
    ends = [*search_from_grid(penalised, lower, upper, GRID, MAX_STARTS, MAX_STEPS), start]
    return min(filter(None, map(design, ends)), key=lambda design: design.rank, default=None)
