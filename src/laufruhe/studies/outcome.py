"""What a study keeps of a solved scene."""

from __future__ import annotations

import math
from dataclasses import dataclass

from laufruhe.errors import SolverError
from laufruhe.problem.evaluation import Evaluation, measured
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve, state
from laufruhe.solvers.result import Result

AS_GIVEN, FAILED = "as given", "failed"


@dataclass(frozen=True)
class Outcome:
    """What a study keeps of one scene [SI]; NaN where there is no such number.

    Attributes
    ----------
    metric, unit
        Of the objective.
    status, proof
        As of a result; "as given" where nothing was open.
    objective_given, objective, lower_bound
        Of the design as given and as decided, and what no design falls below.
    mounts
        Names.
    mean_given, maximum_given, mean, maximum
        Per mount [N]; means over the operating points by their weights.
    decisions, units
        Values decided, by name.
    """

    metric: str
    unit: str
    status: str
    proof: str
    objective_given: float
    objective: float
    lower_bound: float
    mounts: list[str]
    mean_given: list[float]
    maximum_given: list[float]
    mean: list[float]
    maximum: list[float]
    decisions: dict[str, float]
    units: dict[str, str]


def decided(problem: Problem) -> tuple[Result, str, str]:
    """A scene as decided, its status and its proof; one without a design as given."""
    try:
        result = solve(problem, many=True)
    except SolverError:
        return state(problem, to_start_from=True), FAILED, "none"
    if result.objective is None:
        return state(problem, to_start_from=True), str(result.status), "none"
    proof = str(result.certificate.kind) if result.certificate else AS_GIVEN if _is_closed(problem) else "none"
    return result, str(result.status), proof


def solved(problem: Problem) -> Outcome:
    """Solve a scene; one without a design is kept as given, and says why."""
    shown, status, proof = decided(problem)
    nothing = math.nan
    objective, designed = shown.objective, status not in (FAILED, "infeasible")
    before = _over_points(shown.problem, shown.initial)
    after = _over_points(shown.problem, shown.final) if designed else [(nothing, nothing)] * len(before)
    return Outcome(
        metric=objective.name if objective else "",
        unit=objective.unit if objective else "",
        status=status,
        proof=proof,
        objective_given=_finite(objective.initial) if objective else nothing,
        objective=objective.value if objective and designed else nothing,
        lower_bound=shown.certificate.lower_bound if shown.certificate else nothing,
        mounts=shown.initial.mount_names if shown.initial.engine.mounts else [],
        mean_given=[_finite(mean) for mean, _ in before],
        maximum_given=[_finite(most) for _, most in before],
        mean=[mean for mean, _ in after],
        maximum=[most for _, most in after],
        decisions={decision.name: decision.value for decision in shown.decisions},
        units={decision.name: decision.unit for decision in shown.decisions},
    )


def _finite(value: float) -> float:
    """NaN for what has no size: loads of a design as given that stands on a resonance."""
    return value if math.isfinite(value) else math.nan


def _is_closed(problem: Problem) -> bool:
    return not problem.decisions and problem.phasing is None


def _over_points(problem: Problem, evaluation: Evaluation) -> list[tuple[float, float]]:
    """Mean and maximum of every mount over the operating points [N]."""
    if not evaluation.engine.mounts:
        return []
    each = [measured(evaluation, k) for k in range(len(problem.points))]
    weights = [point.weight for point in problem.points]
    return [
        (sum(w * m.mean for w, m in zip(weights, of, strict=True)) / sum(weights), max(m.max for m in of))
        for of in zip(*each, strict=True)
    ]
