"""A metric over the balance fraction at every speed, and the fraction proven best (Hasselgruber 1964, Fig. 10)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from laufruhe.files.study_models import CounterweightFractionTable
from laufruhe.files.study_paths import at
from laufruhe.files.study_sweeps import Axis
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.kinds.swept import answer, check_moved_by_loads, checked, combinations, refused
from laufruhe.studies.outcome import axes_of, coordinates, dataset
from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr

_FRACTION = "balance_fraction"


def _points(part: CounterweightFractionTable, scenes: Scenes) -> list[Point]:
    """Every fraction swept, and last for each speed the fraction left open."""
    problems = checked(part, scenes)
    check_moved_by_loads(problems, part, scenes, "counterweight")
    fraction = _fraction(part)
    if fraction is None:
        for case, problem in zip(part.cases, problems, strict=True):
            if not any(decision.name.endswith(_FRACTION) for decision in problem.decisions):
                rule = "leaves no balance fraction open and the part sweeps none"
                raise refused(scenes, case, "counterweights", rule, "sweep counterweights.NAME.balance_fraction")
        return [Point(case, changes, part.metric) for case in part.cases for changes in combinations(part)]
    points = []
    for case in part.cases:
        left_open = _left_open(Point(case), fraction, scenes)
        for speed in combinations(part, without=fraction.quantity):
            points += [Point(case, {**speed, fraction.quantity: value}, part.metric) for value in fraction.values]
            points.append(Point(case, {**speed, fraction.quantity: left_open}, part.metric))
    return points


def _left_open(point: Point, fraction: Axis, scenes: Scenes) -> dict[str, Any]:
    """The file's own bounds where it leaves the fraction open, else the ends of the sweep."""
    given = at(scenes.tables(point), fraction.quantity)
    numbers = fraction.numbers or ()
    return given if isinstance(given, dict) else {"between": [min(numbers), max(numbers)]}


def _fraction(part: CounterweightFractionTable) -> Axis | None:
    """The swept balance fraction."""
    return next((axis for axis in axes_of(part) if axis.quantity.endswith(_FRACTION)), None)


def _dataset(
    part: CounterweightFractionTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]
) -> xr.Dataset:
    import numpy as np

    fraction = _fraction(part)
    if fraction is None:
        return dataset(part, points, records, coordinates(axes_of(part), points))
    others = [axis for axis in axes_of(part) if axis is not fraction and axis.quantity != fraction.quantity]
    optimum = np.array([isinstance(point.changes[fraction.quantity], dict) for point in points])
    number = fraction.by_value()
    values = [
        _decided(record, fraction.quantity) if best else number[point.changes[fraction.quantity]]
        for point, record, best in zip(points, records, optimum, strict=True)
    ]
    swept = {"units": "1", "long_name": "balance fraction", "swept": 1}
    return dataset(
        part,
        points,
        records,
        {
            **coordinates(others, points),
            fraction.quantity: ("point", values, swept),
            "optimum": ("point", optimum, {"long_name": "whether the fraction was left open, and decided"}),
        },
    )


def _decided(record: Mapping[str, Any], quantity: str) -> float:
    """The fraction decided for the counterweight of this path, which may count it instead of naming it."""
    decided = {name: value for name, value in record["decisions"].items() if name.endswith(_FRACTION)}
    only = next(iter(decided.values())) if len(decided) == 1 else math.nan
    return float(decided.get(quantity.split(".", 1)[-1], only))


KIND = Kind(_points, answer, _dataset)
