"""Parts whose scenes are each solved: every case at every combination of the swept values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import xarray as xr
from pydantic import Field

from laufruhe.files.asked import QuantityName
from laufruhe.files.study_parts import CaseTable, SweepTable
from laufruhe.files.study_paths import keys_of
from laufruhe.files.study_sweeps import Axis, axis_of
from laufruhe.problem import channels
from laufruhe.problem.problem import Problem
from laufruhe.studies.outcome import dataset, solved
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.swept_shown import by_point
from laufruhe.studies.text import Text


class SweptPart(Part):
    """Cases at every combination of the swept values."""

    metric: QuantityName | None = Field(default=None, description="In place of the objective of the problem files.")
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)

    def size(self) -> int:
        """Every case at every combination."""
        return len(self.cases) * math.prod(len(axis.values) for axis in self.axes())

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
        with scenes.blamed(point):
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

        Raises
        ------
        InputError
            If a scene cannot be made, a number is told twice, or the cases' metrics are of different dimensions.
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
        tables, told = scenes.tables(Point(case)), {}
        for path in case.set:
            told[keys_of(tables, path)] = f"is swept, and set by '{case.name}' too"
        for sweep in self.sweep:
            with scenes.named(case):
                keys = keys_of(tables, sweep.quantity)
            for other, rule in told.items():
                if keys[: len(other)] == other[: len(keys)]:
                    raise scenes.refused(case, sweep.quantity, rule, "leave out one of the two")
            told[keys] = "is swept twice"

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
