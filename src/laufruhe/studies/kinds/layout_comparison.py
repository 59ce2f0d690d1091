"""Engines side by side, of equal cylinders or rebuilt to equal power (Hasselgruber 1964, Figs. 12 and 13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import xarray as xr

from laufruhe.studies.picture import Picture
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.swept import SweptPart
from laufruhe.studies.swept_shown import bars, claimed, over_sweep, swept_names

_SAME = 1e-9


class LayoutComparison(SweptPart):
    """Engines side by side, of equal cylinders or of equal power."""

    kind: Literal["layout comparison"]

    def points(self, scenes: Scenes) -> list[Point]:
        """Every case at every combination, if sizes are alike."""
        found = super().points(scenes)
        power = self.cases[0].equal_power_to
        odd = next((case for case in self.cases if case.equal_power_to != power), None)
        if odd is not None:
            rule = f"differs between cases '{self.cases[0].name}' and '{odd.name}'"
            raise scenes.refused(odd, "equal_power_to", rule, "give all cases the same, or none")
        self._check_cylinders(scenes)
        return found

    def _check_cylinders(self, scenes: Scenes) -> None:
        """Layouts are compared from one cylinder: else size would pass for layout."""
        sizes = []
        for case in self.cases:
            as_drawn = Point(case.model_copy(update={"equal_power_to": None}), self.combinations()[0], self.metric)
            sizes.append({(c.bore or 0.0, c.crank_radius) for c in scenes.problem(as_drawn).engine.slider_cranks})
        for case, size in zip(self.cases, sizes, strict=True):
            if len(size) > 1:
                rule = "has cylinders of different bore or stroke"
                raise scenes.refused(case, "engine", rule, "give all one size")
        bore_1, radius_1 = next(iter(sizes[0]))
        for case, ((bore, radius),) in zip(self.cases, sizes, strict=True):
            if abs(radius - radius_1) > _SAME * radius_1 or abs(bore - bore_1) > _SAME:
                rule = f"has another bore or stroke in '{case.name}' than in '{self.cases[0].name}'"
                raise scenes.refused(case, "engine", rule, "compare layouts of one cylinder")

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """As of every sweep, with the size that engines are compared at."""
        power = self.cases[0].equal_power_to
        at = "equal cylinders" if power is None else f"the power of {power} cylinders"
        return super().dataset(points, records).assign_attrs(at=at)

    @staticmethod
    def picture(data: xr.Dataset) -> Picture:
        """Bars of every engine as given and at its optimum; lines where something is swept."""
        at = data.attrs["at"]
        words = f"Engines of {at}." if at == "equal cylinders" else f"At {at}."
        if not swept_names(data):
            return bars(data, data["case"].values, words)
        if len(set(data["case"].values.tolist())) == 1:
            decided = (data["proof"].values != "as given").any()
            words = f"Every point: {claimed(data)}." if decided else "As given."
        return over_sweep(data, [], words)
