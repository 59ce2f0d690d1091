"""What a study keeps of a solved scene, and the dataset that scenes make together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import SolverError
from laufruhe.files.study_parts import SweptPartTable
from laufruhe.files.study_sweeps import Axis, axis_of
from laufruhe.problem.evaluation import Evaluation, measured
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve, state
from laufruhe.solvers.result import Result
from laufruhe.studies.scenes import Point

if TYPE_CHECKING:
    import xarray as xr

AS_GIVEN, FAILED = "as given", "failed"


@dataclass(frozen=True)
class Outcome:
    """What a study keeps of one scene [SI].

    Attributes
    ----------
    metric, unit
        Of the objective.
    status, proof
        As of a result; "as given" where nothing was open.
    objective_given, objective, lower_bound
        Of the design as given and as decided, and what no design falls below; NaN where
        there is none.
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

    def as_dict(self) -> dict[str, Any]:
        """For the file of finished points."""
        return asdict(self)


def solved(problem: Problem) -> Outcome:
    """Solve a scene; one without a design is kept as given, and says why."""
    try:
        result = solve(problem, many=True)
    except SolverError:
        return _outcome(state(problem, to_start_from=True), FAILED, "none")
    if result.objective is None:
        return _outcome(state(problem, to_start_from=True), str(result.status), "none")
    proof = str(result.certificate.kind) if result.certificate else AS_GIVEN if _is_closed(problem) else "none"
    return _outcome(result, str(result.status), proof)


def _outcome(shown: Result, status: str, proof: str) -> Outcome:
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
    return not problem.decisions and problem.phasing is None and not problem.mount_design.decisions


def _over_points(problem: Problem, evaluation: Evaluation) -> list[tuple[float, float]]:
    """Mean and maximum of every mount over the operating points [N]."""
    if not evaluation.engine.mounts:
        return []
    each = [measured(evaluation, k) for k in range(len(problem.points))]
    weights = [point.weight for point in problem.points]
    return [
        (
            sum(w * m.mean for w, m in zip(weights, of_mount, strict=True)) / sum(weights),
            max(m.max for m in of_mount),
        )
        for of_mount in zip(*each, strict=True)
    ]


def axes_of(part: SweptPartTable) -> list[Axis]:
    """What the part sweeps."""
    return [axis_of(sweep) for sweep in part.sweep]


def coordinates(axes: Sequence[Axis], points: Sequence[Point]) -> dict[str, Any]:
    """Swept values along the points, as numbers with their unit, or as labels."""
    found: dict[str, Any] = {}
    for axis in axes:
        values = [point.changes[axis.quantity] for point in points]
        number = axis.by_value()
        shown = [label(value) for value in values] if axis.numbers is None else [number[value] for value in values]
        found[axis.quantity] = ("point", shown, {"units": axis.unit, "long_name": axis.name, "swept": 1})
    return found


def label(value: Any) -> str:
    """A value as a problem file has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def dataset(
    part: SweptPartTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]], extra: Mapping[str, Any]
) -> xr.Dataset:
    """One labelled dataset of a part, along its points.

    Engines of one part may have different mounts and decisions; those that one lacks are NaN.

    Parameters
    ----------
    extra
        Coordinates along the points.
    """
    import xarray as xr

    outcomes = [Outcome(**record) for record in records]
    mounts = list(dict.fromkeys(name for o in outcomes for name in o.mounts))
    decided = {name: unit for o in outcomes for name, unit in o.units.items()}
    metric, unit = _metric(outcomes)

    def per_mount(name: str) -> tuple[tuple[str, str], Any, dict[str, str]]:
        rows = [dict(zip(o.mounts, getattr(o, name), strict=True)) for o in outcomes]
        words = f"{name.replace('_', ' ')} of the mount's force"
        return ("point", "mount"), _table(rows, mounts), {"units": "N", "long_name": words}

    def each(name: str, words: str) -> tuple[str, Any, dict[str, str]]:
        return "point", np.array([getattr(o, name) for o in outcomes]), {"units": unit, "long_name": words}

    return xr.Dataset(
        {
            "objective_given": each("objective_given", f"{metric} of the design as given"),
            "objective": each("objective", f"{metric} of the design as decided"),
            "lower_bound": each("lower_bound", f"{metric} that no design falls below"),
            **{name: per_mount(name) for name in ("mean_given", "maximum_given", "mean", "maximum")},
            "decided": (
                ("point", "decision"), _table([o.decisions for o in outcomes], list(decided)),
                {"long_name": "value decided, in decision_unit"},
            ),
        },
        coords={
            "mount": mounts,
            "decision": list(decided),
            "decision_unit": ("decision", list(decided.values())),
            "case": ("point", [point.case.name for point in points]),
            "status": ("point", [o.status for o in outcomes]),
            "proof": ("point", [o.proof for o in outcomes]),
            **extra,
        },
        attrs={"title": part.title, "kind": part.settings()["kind"], "source": part.source, "metric": metric},
    )  # fmt: skip


def _metric(outcomes: Sequence[Outcome]) -> tuple[str, str]:
    """What the outcomes measure, and its unit: one, or `kinds.swept.checked` has refused them."""
    metrics = {o.metric: o.unit for o in outcomes if o.metric}
    return next(iter(metrics), "") if len(metrics) == 1 else "objective", next(iter(metrics.values()), "")


def _table(rows: Sequence[Mapping[str, float]], columns: Sequence[str]) -> NDArray[np.float64]:
    """A row each, NaN where it has no such column, shape (rows, columns)."""
    values = [[row.get(column, math.nan) for column in columns] for row in rows]
    return np.array(values, dtype=float).reshape(len(rows), len(columns))
