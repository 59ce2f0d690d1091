"""Engines side by side, of equal cylinders or rebuilt to equal power (Hasselgruber 1964, Figs. 12 and 13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from laufruhe.files.study_models import LayoutComparisonTable
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.kinds.swept import answer, checked, combinations, refused
from laufruhe.studies.outcome import axes_of, coordinates, dataset
from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr

_SAME = 1e-9


def _points(part: LayoutComparisonTable, scenes: Scenes) -> list[Point]:
    checked(part, scenes)
    powers = {case.equal_power_to for case in part.cases}
    if len(powers) > 1:
        odd = next(case for case in part.cases if case.equal_power_to != part.cases[0].equal_power_to)
        rule = f"differs between cases '{part.cases[0].name}' and '{odd.name}'"
        raise refused(scenes, odd, "equal_power_to", rule, "give all cases the same, or none")
    _check_cylinders(part, scenes)
    return [Point(case, changes, part.metric) for case in part.cases for changes in combinations(part)]


def _check_cylinders(part: LayoutComparisonTable, scenes: Scenes) -> None:
    """Layouts are compared from one cylinder: else size would pass for layout."""
    sizes = []
    for case in part.cases:
        as_drawn = case.model_copy(update={"equal_power_to": None})
        changes = combinations(part)[0]
        cylinders = scenes.problem(Point(as_drawn, changes, part.metric)).engine.slider_cranks
        sizes.append({(c.bore, c.crank_radius) for c in cylinders})
    for case, size in zip(part.cases, sizes, strict=True):
        if len(size) > 1:
            raise refused(scenes, case, "engine", "has cylinders of different bore or stroke", "give all one size")
    for case, size in zip(part.cases, sizes, strict=True):
        (bore, radius), (bore_1, radius_1) = next(iter(size)), next(iter(sizes[0]))
        if abs(radius - radius_1) > _SAME * radius_1 or abs((bore or 0.0) - (bore_1 or 0.0)) > _SAME:
            rule = f"has another bore or stroke in '{case.name}' than in '{part.cases[0].name}'"
            raise refused(scenes, case, "engine", rule, "compare layouts of one cylinder")


def _dataset(part: LayoutComparisonTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    found = dataset(part, points, records, coordinates(axes_of(part), points))
    power = part.cases[0].equal_power_to
    found.attrs["at"] = "equal cylinders" if power is None else f"the power of {power} cylinders"
    return found


KIND = Kind(_points, answer, _dataset)
