"""Records of solved problems of a study."""

from __future__ import annotations

import math
from typing import TypeAlias

from laufruhe.errors import SolverError
from laufruhe.present.measures import limits_of, main_load, mount_orders, shaking_orders
from laufruhe.problem.evaluation import Evaluation, place_measures
from laufruhe.problem.problem import Problem
from laufruhe.solvers import evaluate_only, solve
from laufruhe.solvers.result import Result
from laufruhe.studies.part import Record

FAILED = "failed"
NOTHING_OPEN = "nothing open"
"""Proof of a problem without decisions."""
HIGHEST_ORDER = 12.0


Decided: TypeAlias = tuple[Result, str, str]
"""Result, status and proof of a problem of a study."""


def decide_scene(problem: Problem) -> Decided:
    """Return result, status and proof of a study's problem; without a solution, those of the initial design."""
    try:
        result = solve(problem)
    except SolverError:
        return evaluate_only(problem, allow_resonance=True), FAILED, "none"
    if result.objective is None:
        return evaluate_only(problem, allow_resonance=True), str(result.status), "none"
    has_no_decisions = not problem.decisions and problem.phasing is None
    proof = str(result.certificate.kind) if result.certificate else NOTHING_OPEN if has_no_decisions else "none"
    return result, str(result.status), proof


def has_design(decided: Decided) -> bool:
    """Return True if a problem of a study has a final design."""
    return decided[1] not in (FAILED, "infeasible")


def solve_scene(problem: Problem) -> Record:
    """Return the record of a problem of a study, as `record_of`."""
    return record_of(problem, decide_scene(problem))


def record_of(problem: Problem, decided: Decided) -> Record:
    """Return the record of a decided problem of a study [SI], NaN for missing values.

    The record has the metric with its unit, status and proof ("nothing open" without decisions), the initial and
    final objective, and the lower bound. It has mean and maximum force by mount [N]; the mean is weighted over
    operating points. It has the decisions, forces by order, and values and shadow prices of the limits, by name.
    """
    result, status, proof = decided
    objective, bound = result.objective, result.certificate.lower_bound if result.certificate else math.nan
    limits = limits_of(result)
    designed = has_design(decided)
    no_forces = dict.fromkeys(result.initial.mount_names, (math.nan, math.nan))
    initial, final = _on_mounts(problem, result.initial), _on_mounts(problem, result.final) if designed else no_forces
    return {
        "metric": objective.name if objective else "",
        "unit": objective.unit if objective else "",
        "status": status,
        "proof": proof,
        "objective_given": _finite(objective.initial) if objective else math.nan,
        "objective": objective.value if objective and designed else math.nan,
        "lower_bound": bound,
        "mean_given": {name: _finite(mean) for name, (mean, _) in initial.items()},
        "maximum_given": {name: _finite(maximum) for name, (_, maximum) in initial.items()},
        "mean": {name: mean for name, (mean, _) in final.items()},
        "maximum": {name: maximum for name, (_, maximum) in final.items()},
        "decided": {decision.name: decision.value for decision in result.decisions},
        "units": {decision.name: decision.unit for decision in result.decisions},
        "order_force_given": _by_order(result.initial),
        "order_force": _by_order(result.final) if designed else {},
        "limit_value": {limit.name: _finite(limit.value) for limit in limits},
        "shadow_price": {limit.name: limit.shadow_price for limit in limits if result.certificate},
        "limit_units": {limit.name: limit.unit for limit in limits},
    }


def _by_order(design: Evaluation) -> dict[str, float]:
    amplitudes: dict[str, float] = {}
    for loads in design.loads if not design.resonance else ():
        load = main_load(loads)
        sizes = mount_orders(load).mean(axis=1) if loads.mount_forces is not None else shaking_orders(load)[0]
        for order, size in zip(load.orders.tolist(), sizes.tolist(), strict=True):
            if order <= HIGHEST_ORDER:
                amplitudes[f"{order:g}"] = max(amplitudes.get(f"{order:g}", 0.0), size)
    return amplitudes


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _on_mounts(problem: Problem, evaluation: Evaluation) -> dict[str, tuple[float, float]]:
    if not evaluation.engine.mounts:
        return {}
    weights = [point.weight for point in problem.points]
    by_mount = zip(*(place_measures(evaluation, k) for k in range(len(weights))), strict=True)
    return {
        name: (
            sum(weight * m.mean for weight, m in zip(weights, measures, strict=True)) / sum(weights),
            max(m.max for m in measures),
        )
        for name, measures in zip(evaluation.mount_names, by_mount, strict=True)
    }
