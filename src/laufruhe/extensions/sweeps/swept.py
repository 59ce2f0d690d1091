"""Study parts that solve a problem at each point: every case at every combination of swept values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from laufruhe.extensions.sweeps.sweep import SweepAxis, SweepTable, axis_of
from laufruhe.extensions.sweeps.swept_report import by_point
from laufruhe.files import fields as f
from laufruhe.files.measures import QuantityName
from laufruhe.files.study_tables import CaseTable, changed, keys_of
from laufruhe.problem import channels
from laufruhe.problem.problem import Problem
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import solve_scene
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr

_WORDS = {
    "objective_given": "{} of the initial design",
    "objective": "{} of the final design",
    "lower_bound": "lower bound of the {}",
}
_ON_MOUNTS = ("mean_given", "maximum_given", "mean", "maximum")


def dataset(
    points: Sequence[Point], records: Sequence[Mapping[str, Any]], extra: Mapping[str, Any], about: Mapping[str, Any]
) -> xr.Dataset:
    """Return the results of all points as one labelled dataset, with `extra` coordinates along the points.

    Engines of one part may have different mounts, decisions and limits; values that an engine lacks are NaN.
    """
    import xarray as xr

    mounts = list(dict.fromkeys(name for record in records for name in record["mean"]))
    units, limit_units = (
        {name: unit for record in records for name, unit in record[key].items()} for key in ("units", "limit_units")
    )
    metrics = {record["metric"]: record["unit"] for record in records if record["metric"]}
    # metrics of different units were refused before
    metric, unit = next(iter(metrics), "") if len(metrics) == 1 else "objective", next(iter(metrics.values()), "")
    by_order = {"order_force_given": "initial", "order_force": "final"}
    names = {order for record in records for name in by_order for order, size in record[name].items() if size}
    orders = sorted(names, key=float)
    along_points = {"case": [point.case.name for point in points]}
    along_points |= {name: [record[name] for record in records] for name in ("status", "proof")}
    variables = {
        name: variable("point", [record[name] for record in records], words.format(metric), unit)
        for name, words in _WORDS.items()
    }
    for name in _ON_MOUNTS:
        words = f"{name.replace('_', ' ')} of the mount's force"
        variables[name] = variable(("point", "mount"), _table(name, records, mounts), words, "N")
    decided = {"long_name": "final value, in decision_unit", "unit_of": "decision_unit"}
    variables["decided"] = (("point", "decision"), _table("decided", records, list(units)), decided)
    for name, design in by_order.items():
        words = f"amplitude by order, {design} design"
        variables[name] = variable(("point", "order"), _table(name, records, orders), words, "N")
    coords: dict[str, Any] = {
        "mount": np.array(mounts, dtype=str),
        "decision": list(units),
        "decision_unit": ("decision", list(units.values())),
        **{name: ("point", values) for name, values in along_points.items()},
        "order": [float(order) for order in orders],
    }
    if limit_units:
        value, price = (_table(name, records, list(limit_units)) for name in ("limit_value", "shadow_price"))
        value_words = {"long_name": "value of the limited measure, in limit_unit", "unit_of": "limit_unit"}
        price_words = "decrease of the metric per unit by which the limit is relaxed, in price_unit"
        prices = [f"{unit or '1'} per {limit_unit}" if limit_unit else unit for limit_unit in limit_units.values()]
        variables["limit_value"] = (("point", "limit"), value, value_words)
        variables["shadow_price"] = (("point", "limit"), price, {"long_name": price_words, "unit_of": "price_unit"})
        coords |= {"limit": list(limit_units), "limit_unit": ("limit", list(limit_units.values())),
                   "price_unit": ("limit", prices)}  # fmt: skip
    return xr.Dataset(variables, {**coords, **extra}, {**about, "metric": metric})


def _table(name: str, records: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> NDArray[np.float64]:
    values = [[record[name].get(column, math.nan) for column in columns] for record in records]
    return np.array(values, dtype=float).reshape(len(records), len(columns))


class SweptPart(Part):
    """Cases at every combination of the swept values."""

    metric: QuantityName | None = f.optional("Metric of the comparison; replaces the objective of the problem files.")
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)

    def swept_or_drawn(self) -> list[tuple[str, Callable[[], object]]]:
        """Return the readers of the sweeps."""
        return [(f"sweep[{k + 1}]", partial(axis_of, sweep)) for k, sweep in enumerate(self.sweep)]

    def size(self) -> int:
        """Return the number of cases times combinations."""
        return len(self.cases) * math.prod(sweep.count for sweep in self.sweep)

    def axes(self) -> list[SweepAxis]:
        """Return the swept axes."""
        return [axis_of(sweep) for sweep in self.sweep]

    def combinations(self, without: str | None = None) -> list[dict[str, Any]]:
        """Return every combination of swept values, the last sweep fastest; one empty combination without sweeps."""
        grids = [[(a.quantity, value) for value in a.values] for a in self.axes() if a.quantity != without]
        return [dict(grid) for grid in itertools.product(*grids)]

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return every case at every combination."""
        self.checked(problem_files)
        return [Point(case, changes, self.metric) for case in self.cases for changes in self.combinations()]

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of one point: its proven optimum, or the initial design if no number is open."""
        return solve_scene(problem_files.problem(point))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the records of all points as one labelled dataset."""
        return dataset(points, records, coordinates(self.axes(), points), self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a row per point."""
        return by_point(data)

    def checked(self, problem_files: ProblemFiles) -> list[Problem]:
        """Return the problem of every case at the first values of all sweeps.

        The last value of every sweep is built too, so that errors are found before the run. Raise `InputError` if a
        problem cannot be built, a number is swept and set or swept twice, or the metrics differ in unit.
        """
        axes = self.axes()
        first = {axis.quantity: axis.values[0] for axis in axes}
        problems = []
        for case in self.cases:
            self._check_distinct(case, problem_files)
            problems.append(problem_files.problem(Point(case, first, self.metric)))
            for axis in axes:
                problem_files.problem(Point(case, {**first, axis.quantity: axis.values[-1]}, self.metric))
            if problems[-1].objective_unit is None:
                rule = "is missing, so a study has nothing to compare"
                raise problem_files.refused(case, "objective", rule, "give a metric")
        units = {problem.objective_unit: case for problem, case in zip(problems, self.cases, strict=True)}
        if len(units) > 1:
            (one, first_case), (two, second_case) = list(units.items())[:2]
            unit_names = [unit or "several units together" for unit in (one, two)]
            rule = f"minimises in {unit_names[0]} in '{first_case.name}' and in {unit_names[1]} in '{second_case.name}'"
            raise problem_files.refused(self.cases[0], "objective", rule, "give the part one metric")
        return problems

    def _check_distinct(self, case: CaseTable, problem_files: ProblemFiles) -> None:
        """Raise `InputError` for a number that is both swept and set, or swept twice, however its path is written."""
        tables, reasons = problem_files.tables(Point(case.model_copy(update={"set": {}}))), {}
        for path, value in case.set.items():
            with problem_files.named(case):
                reasons[keys_of(tables, path, adds=True)] = f"is swept, and set by '{case.name}' too"
                tables = changed(tables, path, value)
        for sweep in self.sweep:
            with problem_files.named(case):
                keys = keys_of(tables, sweep.quantity, adds=True)
            for earlier, rule in reasons.items():
                if keys[: len(earlier)] == earlier[: len(keys)]:
                    raise problem_files.refused(case, sweep.quantity, rule, "leave out one of the two")
            reasons[keys] = "is swept twice"

    def check_moved_by_loads(self, problems: Sequence[Problem], problem_files: ProblemFiles, what: str) -> None:
        """Raise `InputError` if the metric, such as a sag, does not depend on loads."""
        for case, problem in zip(self.cases, problems, strict=True):
            measures = problem.measures
            if all(measure.is_mounting and measure.channel is not channels.TRANSMISSIBILITY for measure in measures):
                rule = f"is {problem.objective_name}, which no {what} changes"
                raise problem_files.refused(case, "objective", rule, "minimise a mount force or transmissibility")


def coordinates(axes: Sequence[SweepAxis], points: Sequence[Point]) -> dict[str, Any]:
    """Return swept values along the points: numbers with their unit, or labels as in a problem file."""
    coords: dict[str, Any] = {}
    for axis in axes:
        values = [point.changes[axis.quantity] for point in points]
        number = axis.by_value()
        # labels as in a problem file
        labels = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
        column = labels if axis.numbers is None else [number[value] for value in values]
        coords[axis.quantity] = ("point", column, {"units": axis.unit, "long_name": axis.name, "swept": 1})
    return coords
