"""What a study keeps of a solved scene, and the dataset that such scenes make together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.errors import SolverError
from laufruhe.problem.evaluation import Evaluation, measured
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve, state
from laufruhe.solvers.result import Result
from laufruhe.studies.part import Record, variable
from laufruhe.studies.scenes import Point

AS_GIVEN, FAILED = "as given", "failed"
_WORDS = {
    "objective_given": "{} of the design as given",
    "objective": "{} of the design as decided",
    "lower_bound": "{} that no design falls below",
}
_ON_MOUNTS = ("mean_given", "maximum_given", "mean", "maximum")


def decided(problem: Problem) -> tuple[Result, str, str]:
    """A scene as decided, its status and its proof; one without a design as given."""
    try:
        result = solve(problem)
    except SolverError:
        return state(problem, to_start_from=True), FAILED, "none"
    if result.objective is None:
        return state(problem, to_start_from=True), str(result.status), "none"
    is_closed = not problem.decisions and problem.phasing is None
    proof = str(result.certificate.kind) if result.certificate else AS_GIVEN if is_closed else "none"
    return result, str(result.status), proof


def solved(problem: Problem) -> Record:
    """What is kept of a scene [SI]; NaN for what it has not, as one without a design.

    Its metric and the unit of that, status and proof ("as given" where nothing was open), the
    objective as given, as decided, and what no design falls below; mean and maximum force by
    mount [N], means over the operating points by their weights; what was decided, by name.
    """
    shown, status, proof = decided(problem)
    objective, bound = shown.objective, shown.certificate.lower_bound if shown.certificate else math.nan
    designed = status not in (FAILED, "infeasible")
    nothing = dict.fromkeys(shown.initial.mount_names, (math.nan, math.nan))
    before, after = _on_mounts(problem, shown.initial), _on_mounts(problem, shown.final) if designed else nothing
    return {
        "metric": objective.name if objective else "",
        "unit": objective.unit if objective else "",
        "status": status,
        "proof": proof,
        "objective_given": _finite(objective.initial) if objective else math.nan,
        "objective": objective.value if objective and designed else math.nan,
        "lower_bound": bound,
        "mean_given": {name: _finite(mean) for name, (mean, _) in before.items()},
        "maximum_given": {name: _finite(most) for name, (_, most) in before.items()},
        "mean": {name: mean for name, (mean, _) in after.items()},
        "maximum": {name: most for name, (_, most) in after.items()},
        "decided": {decision.name: decision.value for decision in shown.decisions},
        "units": {decision.name: decision.unit for decision in shown.decisions},
    }


def _finite(value: float) -> float:
    """NaN for what has no size: loads of a design as given that stands on a resonance."""
    return value if math.isfinite(value) else math.nan


def _on_mounts(problem: Problem, evaluation: Evaluation) -> dict[str, tuple[float, float]]:
    """Mean and maximum of every mount over the operating points [N]."""
    if not evaluation.engine.mounts:
        return {}
    each = [measured(evaluation, k) for k in range(len(problem.points))]
    weights = [point.weight for point in problem.points]
    return {
        name: (sum(w * m.mean for w, m in zip(weights, of, strict=True)) / sum(weights), max(m.max for m in of))
        for name, of in zip(evaluation.mount_names, zip(*each, strict=True), strict=True)
    }


def dataset(
    points: Sequence[Point], records: Sequence[Mapping[str, Any]], extra: Mapping[str, Any], about: Mapping[str, Any]
) -> xr.Dataset:
    """One labelled dataset of solved scenes, along its points.

    Engines of one part may have different mounts and decisions; those that one lacks are NaN.

    Parameters
    ----------
    extra
        Coordinates along the points.
    about
        Attributes.
    """
    mounts = list(dict.fromkeys(name for record in records for name in record["mean"]))
    units = {name: unit for record in records for name, unit in record["units"].items()}
    metrics = {record["metric"]: record["unit"] for record in records if record["metric"]}
    # of several metrics the unit is one, or they were refused
    metric, unit = next(iter(metrics), "") if len(metrics) == 1 else "objective", next(iter(metrics.values()), "")
    found = {
        name: variable("point", [record[name] for record in records], words.format(metric), unit)
        for name, words in _WORDS.items()
    }
    for name in _ON_MOUNTS:
        words = f"{name.replace('_', ' ')} of the mount's force"
        found[name] = variable(("point", "mount"), _table(name, records, mounts), words, "N")
    in_unit = {"long_name": "value decided, in decision_unit"}
    coords = {
        "mount": mounts,
        "decision": list(units),
        "decision_unit": ("decision", list(units.values())),
        "case": ("point", [point.case.name for point in points]),
        "status": ("point", [record["status"] for record in records]),
        "proof": ("point", [record["proof"] for record in records]),
    }
    values = {**found, "decided": (("point", "decision"), _table("decided", records, list(units)), in_unit)}
    return xr.Dataset(values, {**coords, **extra}, {**about, "metric": metric})


def _table(name: str, records: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> NDArray[np.float64]:
    """A row each, NaN where it has no such column, shape (records, columns)."""
    values = [[record[name].get(column, math.nan) for column in columns] for record in records]
    return np.array(values, dtype=float).reshape(len(records), len(columns))
