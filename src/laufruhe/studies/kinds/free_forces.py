"""Free forces and couples by layout, beside what tables print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from laufruhe.files.study_costs import FreeForcesTable
from laufruhe.studies.free_forces import FreeLoad, Layout, compared, layout
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr


def _points(part: FreeForcesTable, scenes: Scenes) -> list[Point]:
    points = [Point(case) for case in part.cases]
    for point in points:
        scenes.problem(point)
    return points


def _answer(part: FreeForcesTable, point: Point, scenes: Scenes) -> dict[str, Any]:
    with scenes.blamed(point):
        return asdict(layout(scenes.problem(point).engine, part.spacing))


def _dataset(part: FreeForcesTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    layouts = {point.case.name: _layout(record) for point, record in zip(points, records, strict=True)}
    printed = {
        case.name: {
            key.replace("_", " "): value for key, value in case.literature.model_dump(exclude_none=True).items()
        }
        for case in part.cases
    }
    return compared(layouts, printed).assign_attrs(title=part.title, source=part.source, digits=part.digits)


def _layout(record: Mapping[str, Any]) -> Layout:
    loads = tuple(FreeLoad(**load) for load in record["loads"])
    least, most = record["intervals"]
    return Layout(loads, (least, most), record["cylinders"])


KIND = Kind(_points, _answer, _dataset)
