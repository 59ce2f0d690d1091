"""Solver for discs, shafts and absorbers of the crankshaft: multistart search and branch and bound (V13)."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from laufruhe.extensions.torsion.boxes import TwistBoxes
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoxResult, bisect_box
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, Design, build_result, infeasible_result, witness_of
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import (
    LocalProgram,
    best_local_optimum,
    proof_data,
    prove_design,
    spread_starts,
)

# open numbers that are divided, and boxes that this may take
MAX_OPEN, MAX_BOXES = 3, 3000


def solve_torsion(problem: Problem) -> Result:
    """Return the best discs, shafts and absorbers, with a lower bound by boxes, or proven contradicting limits.

    Root mean squares, inertia and irregularity are decided to a proven optimum of up to three numbers. A bound
    of any other measure uses these numbers only.
    """
    started = time.perf_counter()
    initial = evaluate(problem)
    program = LocalProgram.of(problem)
    best = best_local_optimum(program, [program.shares(problem.start), *spread_starts(problem)], problem.search.starts)
    boxes = TwistBoxes(problem, initial)
    known = boxes.coordinates.is_exact and boxes.is_sampled_fully
    maximum = problem.search.boxes_or(MAX_BOXES if len(problem.decisions) <= MAX_OPEN else 0) if known else 0

    def bounded(value: float, room: float, design: Design) -> BoxResult:
        if not maximum or (value < math.inf and not boxes.has_terms):
            return BoxResult(0.0, 0)
        coordinates = boxes.coordinates
        place = coordinates.from_decisions(np.array([float(x.real) for x in design.values]))
        known = witness_of(design, place) if value < math.inf else None
        divided = bisect_box(boxes, coordinates.lower, coordinates.upper, value, room, maximum, known)
        return replace(divided, places=tuple(coordinates.decisions(x) for x in divided.places))

    outcome = prove_design(program, best, bounded)
    if outcome.excludes_all:
        names = tuple(limit.name for limit in problem.limits)
        return infeasible_result(problem, initial, names, {"solve": time.perf_counter() - started})
    method = f"local programs; lower bound on {outcome.divided.boxes} boxes of discs and shafts"
    is_near = boxes.coordinates.is_exact and boxes.knows_all and outcome.design.violation <= FEASIBILITY_TOL
    bound = outcome.bound if boxes.coordinates.is_exact else 0.0
    proof = proof_data(
        program, outcome.design, bound, ProofStrength.PARTIAL if is_near else ProofStrength.RELAXED, method
    )
    return build_result(outcome.design, initial, proof, {"solve": time.perf_counter() - started})
