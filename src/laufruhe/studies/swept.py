"""Parts whose scenes are each solved: every case at every combination of the swept values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from laufruhe.files.file_models import QuantityName
from laufruhe.files.study_parts import SweepTable
from laufruhe.files.study_sweeps import Axis, axis_of
from laufruhe.problem import channels
from laufruhe.problem.problem import Problem
from laufruhe.studies.outcome import Outcome, solved
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.swept_shown import by_point
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr


class SweptPart(Part):
    """Cases at every combination of the swept values."""

    metric: QuantityName | None = Field(default=None, description="In place of the objective of the problem files.")
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)

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
        problem = scenes.problem(point)
        with scenes.blamed(point):
            return asdict(solved(problem))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """All that is kept of every scene, along its point."""
        return dataset(points, records, coordinates(self.axes(), points), self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """A row a point."""
        return by_point(data)

    def checked(self, scenes: Scenes) -> list[Problem]:
        """The first scene of every case, after the ends of every sweep were tried on each.

        Raises
        ------
        InputError
            If a scene cannot be made, or the cases' metrics are of different dimensions.
        """
        axes = self.axes()
        first = {axis.quantity: axis.values[0] for axis in axes}
        found = []
        for case in self.cases:
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

    def check_moved_by_loads(self, problems: Sequence[Problem], scenes: Scenes, what: str) -> None:
        """Whether balancing can change what is minimised: sag and stiffness know no loads.

        Raises
        ------
        InputError
            If loads neither make up an objective nor are limited beside it.
        """
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
        shown = [_label(value) for value in values] if axis.numbers is None else [number[value] for value in values]
        found[axis.quantity] = ("point", shown, {"units": axis.unit, "long_name": axis.name, "swept": 1})
    return found


def _label(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


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

    in_unit = {"long_name": "value decided, in decision_unit"}
    return xr.Dataset(
        {
            "objective_given": each("objective_given", f"{metric} of the design as given"),
            "objective": each("objective", f"{metric} of the design as decided"),
            "lower_bound": each("lower_bound", f"{metric} that no design falls below"),
            **{name: per_mount(name) for name in ("mean_given", "maximum_given", "mean", "maximum")},
            "decided": (("point", "decision"), _table([o.decisions for o in outcomes], list(decided)), in_unit),
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
        attrs={**about, "metric": metric},
    )


def _metric(outcomes: Sequence[Outcome]) -> tuple[str, str]:
    """What the outcomes measure, and its unit: one, or `SweptPart.checked` has refused them."""
    metrics = {o.metric: o.unit for o in outcomes if o.metric}
    return next(iter(metrics), "") if len(metrics) == 1 else "objective", next(iter(metrics.values()), "")


def _table(rows: Sequence[Mapping[str, float]], columns: Sequence[str]) -> NDArray[np.float64]:
    """A row each, NaN where it has no such column, shape (rows, columns)."""
    values = [[row.get(column, math.nan) for column in columns] for row in rows]
    return np.array(values, dtype=float).reshape(len(rows), len(columns))
