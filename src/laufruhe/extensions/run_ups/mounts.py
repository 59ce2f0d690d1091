"""Optimum of mounts and unbalances for run-up and shut-down: a smooth program over peaks of the exact model (E28b)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.errors import counted
from laufruhe.extensions.run_ups.boxes import bounds_runs
from laufruhe.load_models.simulated import COARSE_STEP
from laufruhe.machine.mount import every_spring
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.mounts.subdivision import is_stiffness_problem
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, build_result, infeasible_result
from laufruhe.solvers.mounts.nonlinear import bound_search, failed_search, minimal_conflict, search_proof
from laufruhe.solvers.mounts.search import NEAR, MountSearch
from laufruhe.solvers.mounts.starts import start_of_result
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, describe_starts, distinct_optima

STARTS, STOPPED_STARTS = 6, 3
"""Most starts of a search, without and with bump stops: each step costs several run-ups."""


def solve_run_mounts(problem: Problem, relaxed: Result | None) -> Result:
    """Return the best mounts for run-ups, a local optimum of several starts, with a lower bound.

    The result without run-ups, `relaxed`, gives a start and a lower bound.
    """
    started = time.perf_counter()
    initial = evaluate_start(problem)
    has_stops = any(spring.stop_stiffness > 0.0 for _, spring in every_spring(problem.engine.mounts))
    starts = min(problem.search.starts, STOPPED_STARTS if has_stops else STARTS)
    search_problem = replace(problem, search=replace(problem.search, starts=starts))
    # a rough first search helps only with several starts
    is_single_start = starts == 1
    first = None if relaxed is None or is_single_start else start_of_result(problem, relaxed)
    search = MountSearch(
        search_problem, initial, first=first, keep_initial=True, coarser=1 if is_single_start else COARSE_STEP
    )
    has_bound = is_stiffness_problem(problem) and bounds_runs(problem)
    search.run()
    can_refine = bool(search.optima) and not has_stops and not is_single_start
    if can_refine and search.best is not None and search.best.design.violation <= NEAR:
        search.refine()
    box_result = bound_search(problem, search, False) if has_bound else BoxResult(0.0, 0)
    timing = {"solve": time.perf_counter() - started}
    best = search.best_or_initial
    if best is None or best.design.violation > FEASIBILITY_TOL:
        conflict = minimal_conflict(problem) if box_result.bound == math.inf else ()
        result = infeasible_result(problem, initial, conflict, timing)
        return result if conflict else failed_search(search, result)
    certificate = None if relaxed is None else relaxed.certificate
    relaxed_bound = 0.0 if certificate is None else certificate.lower_bound
    method = _method(search.optima, max(best.design.value, numerical_zero(problem)), relaxed_bound, box_result)
    proof = search_proof(best, box_result, max(relaxed_bound, box_result.bound), method)
    return build_result(replace(best.design, problem=problem), initial, proof, timing)


def _method(optima: Sequence[LocalOptimum], scale: float, relaxed_bound: float, box_result: BoxResult) -> str:
    ends = describe_starts(optima, len(distinct_optima(optima, scale, 1e-3)))
    if box_result.bound > relaxed_bound:
        bound = f"; bounds of mounts and run-ups on {counted(box_result.boxes, 'box')}"
    elif relaxed_bound > 0.0:
        bound = "; bound of the problem without run-ups"
    else:
        bound = "; no bound of a run-up alone"
    return f"{ends}, with run-ups integrated{bound}"
