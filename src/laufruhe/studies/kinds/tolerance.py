"""Free forces that tolerances leave in several engines, at their worst and at random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from laufruhe.files.study_costs import ToleranceTable
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.kinds.swept import refused
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.tolerance import Tolerances
from laufruhe.studies.tolerance_study import Spread, compared, spread

if TYPE_CHECKING:
    import xarray as xr


def _points(part: ToleranceTable, scenes: Scenes) -> list[Point]:
    for case in part.cases:
        if len(scenes.problem(Point(case)).points) != 1:
            rule = f"has several in '{case.name}', and tolerances are studied at one"
            raise refused(scenes, case, "operating_points", rule, "name an engine with one")
    return [Point(case) for case in part.cases]


def _answer(part: ToleranceTable, point: Point, scenes: Scenes) -> dict[str, Any]:
    given = part.tolerances
    tolerances = Tolerances(
        given.reciprocating_mass, given.unbalance, given.planes, given.alignment, tuple(given.aligned_masses)
    )
    with scenes.blamed(point):
        return asdict(spread(scenes.problem(point), tolerances, part.engines, part.seed))


def _dataset(part: ToleranceTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    found = compared({point.case.name: Spread(**record) for point, record in zip(points, records, strict=True)})
    marks = {mark.name: mark.force for mark in part.marks}
    shown = {"mark_names": list(marks), "mark_forces": list(marks.values())} if marks else {}
    return found.assign_coords(claim=("case", [case.claim or "" for case in part.cases])).assign_attrs(
        title=part.title, source=part.source, seed=part.seed, engines=part.engines, **shown
    )


KIND = Kind(_points, _answer, _dataset)
