"""Mounts, and unbalances with them, designed for run-up and shut-down: a smooth program with peaks told (E28b)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.extensions.run_ups.boxes import bounds_runs
from laufruhe.load_models.simulated import COARSER
from laufruhe.machine.mount import every_spring
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import ProofStrength
from laufruhe.prove.mounts.subdivision import divides
from laufruhe.solvers.conclusion import KEPT, ProofData, broken_limits, build_result, infeasible_result
from laufruhe.solvers.mounts.bounds import conflict_of, divided_by
from laufruhe.solvers.mounts.search import NEAR, MountSearch, SearchResult
from laufruhe.solvers.mounts.starts import place_of
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, distinct, ends_in_words

STARTS, STOPPED_STARTS = 6, 3
"""Of a search at most: each of its steps costs several run-ups, most of them with bump stops."""


def solve_run_mounts(problem: Problem, relaxed: Result | None) -> Result:
    """The best local optimum that several starts find.

    Parameters
    ----------
    relaxed
        Result without run-ups: the search starts there, and no design goes under its bound.
    """
    started = time.perf_counter()
    initial = evaluate_start(problem)
    stopped = any(spring.stop_stiffness > 0.0 for _, spring in every_spring(problem.engine.mounts))
    starts = min(problem.search.starts, STOPPED_STARTS if stopped else STARTS)
    limited = replace(problem, search=replace(problem.search, starts=starts))
    # from one start nothing is gained by looking roughly first
    alone = starts == 1
    first = None if relaxed is None or alone else place_of(problem, relaxed)
    search = MountSearch(limited, initial, first=first, beside=True, coarser=1 if alone else COARSER)
    bounded = divides(problem) and bounds_runs(problem)
    search.run()
    was_searched = bool(search.optima) and not stopped and not alone
    if was_searched and search.best is not None and search.best.design.violation <= NEAR:
        search.refined()
    divided = divided_by(problem, search, False) if bounded else BoxResult(0.0, 0)
    timing = {"solve": time.perf_counter() - started}
    best = search.chosen
    if best is None or best.design.violation > KEPT:
        conflict = conflict_of(problem) if divided.bound == math.inf else ()
        result = infeasible_result(problem, initial, conflict, timing)
        return result if conflict else _none(problem, search, best, result)
    return _best_result(problem, search, best, initial, relaxed, divided, timing)


def _best_result(
    problem: Problem, search: MountSearch, best: SearchResult, initial: Evaluation, relaxed: Result | None,
    divided: BoxResult, timing: dict[str, float],
) -> Result:  # fmt: skip
    """Return the result of the best design, with the better of both bounds."""
    certificate = None if relaxed is None else relaxed.certificate
    relaxed_bound = 0.0 if certificate is None else certificate.lower_bound
    optimum = best.optimum
    facts = ProofData(
        bound=max(relaxed_bound, divided.bound),
        strength=ProofStrength.PARTIAL if divided.boxes else ProofStrength.RELAXED,
        kkt_residual=math.inf if optimum is None else optimum.kkt_residual,
        method=_method(search.optima, max(best.design.value, numerical_zero(problem)), relaxed_bound, divided),
        prices={} if optimum is None else best.joint.prices(optimum),
    )
    design = replace(best.design, problem=problem)
    return build_result(design, initial, facts, timing)


def _method(optima: Sequence[LocalOptimum], scale: float, relaxed_bound: float, divided: BoxResult) -> str:
    ends = ends_in_words(optima, len(distinct(optima, scale, 1e-3)))
    if divided.bound > relaxed_bound:
        bound = f"; bounds of mounts and run-ups looked at in {divided.boxes} box{'es' if divided.boxes > 1 else ''}"
    elif relaxed_bound > 0.0:
        bound = "; the bound is that of the same without what is asked of run-ups"
    else:
        bound = "; nothing bounds a run-up alone"
    return f"{ends}, with run-ups integrated{bound}"


def _none(problem: Problem, search: MountSearch, best: SearchResult | None, result: Result) -> Result:
    names, miss = "the limits", ""
    if best is not None:
        names = " and ".join(f"'{name}'" for name in broken_limits(problem.limits, best.design.evaluation))
        miss = f" (nearest misses by {best.design.violation:.3g} of a limit)"
    starts = sum(optimum.starts for optimum in search.optima)
    message = f"no design found: from {starts} starts none keeps {names}{miss}; relax it, or open more"
    return replace(result, status=Status.FAILED, message=message)
