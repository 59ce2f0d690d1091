"""Parts whose scenes are each solved: every case at every combination of the swept values, and what is kept of each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from laufruhe.errors import ModelError, SolverError
from laufruhe.files import fields as f
from laufruhe.files.measures import QuantityName
from laufruhe.files.study_tables import Axis, CaseTable, SweepTable, axis_of, changed, keys_of
from laufruhe.present.measures import limits_of, main_load, mount_orders, shaking_orders
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation, measured
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve, state
from laufruhe.solvers.result import Result
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.swept_shown import by_point
from laufruhe.studies.text import Text

AS_GIVEN, FAILED = "as given", "failed"
_WORDS = {
    "objective_given": "{} of the design as given",
    "objective": "{} of the design as decided",
    "lower_bound": "{} that no design falls below",
}
HIGHEST_ORDER = 12.0
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


Further: TypeAlias = Callable[[Evaluation], float]
"""A further quantity of a design; `ModelError` says why it has none."""


def solved(problem: Problem, further: Mapping[str, Further] | None = None) -> Record:
    """What is kept of a scene [SI]; NaN for what it has not, as one without a design.

    Its metric and the unit of that, status and proof ("as given" where nothing was open), the
    objective as given, as decided, and what no design falls below; mean and maximum force by
    mount [N], means over the operating points by their weights; what was decided, and forces by
    order; how limits stand, and their shadow prices, by name; and the design in further quantities,
    or why it has none.
    """
    shown, status, proof = decided(problem)
    objective, bound = shown.objective, shown.certificate.lower_bound if shown.certificate else math.nan
    limits = limits_of(shown)
    designed = status not in (FAILED, "infeasible")
    told = {name: _told(shown.final, of) if designed else (math.nan, "") for name, of in (further or {}).items()}
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
        "order_force_given": _by_order(shown.initial),
        "order_force": _by_order(shown.final) if designed else {},
        "limit_value": {limit.name: _finite(limit.value) for limit in limits},
        "shadow_price": {limit.name: limit.shadow_price for limit in limits if shown.certificate},
        "limit_units": {limit.name: limit.unit for limit in limits},
        "further": {name: value for name, (value, _) in told.items()},
        "why_none": {name: why for name, (_, why) in told.items()},
    }


def _told(design: Evaluation, of: Further) -> tuple[float, str]:
    """A quantity of a design; NaN and why where it has none, as the mass of a weight without a radius."""
    try:
        return _finite(of(design)), ""
    except ModelError as error:
        return math.nan, str(error).partition("; ")[0]


def _by_order(design: Evaluation) -> dict[str, float]:
    """Amplitudes by order, largest of all operating points: of mounts their mean, without any the shaking force [N]."""
    found: dict[str, float] = {}
    for loads in design.loads if not design.resonance else ():
        load = main_load(loads)
        sizes = mount_orders(load).mean(axis=1) if loads.mount_forces is not None else shaking_orders(load)[0]
        for order, size in zip(load.orders.tolist(), sizes.tolist(), strict=True):
            if order <= HIGHEST_ORDER:
                found[f"{order:g}"] = max(found.get(f"{order:g}", 0.0), size)
    return found


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
    more, named = _orders_and_limits(records, unit)
    return xr.Dataset({**values, **more}, {**coords, **named, **extra}, {**about, "metric": metric})


def _orders_and_limits(records: Sequence[Mapping[str, Any]], unit: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Forces by order that any scene has, and how limits stand with what they cost; each with its coordinates."""
    told = {order for record in records for order, size in record["order_force_given"].items() if size}
    told |= {order for record in records for order, size in record["order_force"].items() if size}
    orders = sorted(told, key=float)
    units = {name: of for record in records for name, of in record["limit_units"].items()}
    given, decided = (_table(name, records, orders) for name in ("order_force_given", "order_force"))
    found = {
        "order_force_given": variable(("point", "order"), given, "amplitude by order, as given", "N"),
        "order_force": variable(("point", "order"), decided, "amplitude by order, as decided", "N"),
    }
    coords: dict[str, Any] = {"order": [float(order) for order in orders]}
    if not units:
        return found, coords
    value, price = (_table(name, records, list(units)) for name in ("limit_value", "shadow_price"))
    words = "fall of the metric for a unit by which the limit is relaxed, in price_unit"
    found["limit_value"] = (("point", "limit"), value, {"long_name": "what is limited, in limit_unit"})
    found["shadow_price"] = (("point", "limit"), price, {"long_name": words, "unit_of": "price_unit"})
    prices = [f"{unit or '1'} per {of}" if of else unit for of in units.values()]
    return found, {**coords, "limit": list(units), "limit_unit": ("limit", list(units.values())),
                   "price_unit": ("limit", prices)}  # fmt: skip


def _table(name: str, records: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> NDArray[np.float64]:
    """A row each, NaN where it has no such column, shape (records, columns)."""
    values = [[record[name].get(column, math.nan) for column in columns] for record in records]
    return np.array(values, dtype=float).reshape(len(records), len(columns))


class SweptPart(Part):
    """Cases at every combination of the swept values."""

    metric: QuantityName | None = f.optional("What is compared, in place of the objective of the problem files.")
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)

    def swept_or_drawn(self) -> list[tuple[str, Callable[[], object]]]:
        """Of every sweep."""
        return [(f"sweep[{k + 1}]", partial(axis_of, sweep)) for k, sweep in enumerate(self.sweep)]

    def size(self) -> int:
        """Every case at every combination."""
        return len(self.cases) * math.prod(sweep.count for sweep in self.sweep)

    def axes(self) -> list[Axis]:
        """What is swept."""
        return [axis_of(sweep) for sweep in self.sweep]

    def combinations(self, without: str | None = None) -> list[dict[str, Any]]:
        """Every combination of the swept values, the last sweep fastest; one empty one without sweeps."""
        grids = [[(a.quantity, value) for value in a.values] for a in self.axes() if a.quantity != without]
        return [dict(grid) for grid in itertools.product(*grids)]

    def points(self, scenes: Scenes) -> list[Point]:
        """Every case at every combination."""
        self.checked(scenes)
        return [Point(case, changes, self.metric) for case in self.cases for changes in self.combinations()]

    def answer(self, point: Point, scenes: Scenes) -> Record:
        """The proven optimum of one scene, or its numbers as given where nothing is open."""
        return solved(scenes.problem(point))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """All that is kept of every scene, along its point."""
        return dataset(points, records, coordinates(self.axes(), points), self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """A row a point."""
        return by_point(data)

    def checked(self, scenes: Scenes) -> list[Problem]:
        """The first scene of every case, after the ends of every sweep were tried on each.

        `InputError` where one cannot be made, tells a number twice, or has a metric of another dimension.
        """
        axes = self.axes()
        first = {axis.quantity: axis.values[0] for axis in axes}
        found = []
        for case in self.cases:
            self._check_apart(case, scenes)
            found.append(scenes.problem(Point(case, first, self.metric)))
            for axis in axes:
                scenes.problem(Point(case, {**first, axis.quantity: axis.values[-1]}, self.metric))
            if found[-1].objective_unit is None:
                rule = "is missing, so a study has nothing to compare"
                raise scenes.refused(case, "objective", rule, "give a metric")
        units = {problem.objective_unit: case for problem, case in zip(found, self.cases, strict=True)}
        if len(units) > 1:
            (one, first_case), (two, second_case) = list(units.items())[:2]
            said = [unit or "several units together" for unit in (one, two)]
            rule = f"minimises in {said[0]} in '{first_case.name}' and in {said[1]} in '{second_case.name}'"
            raise scenes.refused(self.cases[0], "objective", rule, "give the part one metric")
        return found

    def _check_apart(self, case: CaseTable, scenes: Scenes) -> None:
        """Whether every number is told once, however its path is written."""
        tables, told = scenes.tables(Point(case.model_copy(update={"set": {}}))), {}
        for path, value in case.set.items():
            with scenes.named(case):
                told[keys_of(tables, path)] = f"is swept, and set by '{case.name}' too"
                tables = changed(tables, path, value)
        for sweep in self.sweep:
            with scenes.named(case):
                keys = keys_of(tables, sweep.quantity)
            for other, rule in told.items():
                if keys[: len(other)] == other[: len(keys)]:
                    raise scenes.refused(case, sweep.quantity, rule, "leave out one of the two")
            told[keys] = "is swept twice"

    def check_moved_by_loads(self, problems: Sequence[Problem], scenes: Scenes, what: str) -> None:
        """`InputError` where balancing cannot change what is minimised: sag and stiffness know no loads."""
        for case, problem in zip(self.cases, problems, strict=True):
            asked = problem.measures
            if all(measure.is_mounting and measure.channel is not channels.TRANSMISSIBILITY for measure in asked):
                rule = f"is {problem.objective_name}, which no {what} changes"
                raise scenes.refused(case, "objective", rule, "minimise a mount force or transmissibility")


def coordinates(axes: Sequence[Axis], points: Sequence[Point]) -> dict[str, Any]:
    """Swept values along the points, as numbers with their unit, or as labels as a problem file has them."""
    found: dict[str, Any] = {}
    for axis in axes:
        values = [point.changes[axis.quantity] for point in points]
        number = axis.by_value()
        # labels as a problem file has them
        labels = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
        shown = labels if axis.numbers is None else [number[value] for value in values]
        found[axis.quantity] = ("point", shown, {"units": axis.unit, "long_name": axis.name, "swept": 1})
    return found
