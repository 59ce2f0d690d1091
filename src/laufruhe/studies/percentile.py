"""Percentile of a load over the working cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from laufruhe.numerics.norms import lengths
from laufruhe.present import picture as p
from laufruhe.problem.evaluation import evaluate
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text, marked_table, number

if TYPE_CHECKING:
    import xarray as xr


class PercentilePart(Part):
    """A percentile over the cycle of the first load that each case minimises, of the initial design."""

    kind: Literal["percentile"]
    share: float = Field(95.0, gt=0.0, lt=100.0, description="Share of the cycle in percent.")

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: one for each case, whose objective must be a load."""
        for case in self.cases:
            if not any(term.measure.is_load for term in problem_files.problem(Point(case)).objective):
                raise problem_files.refused(
                    case, "objective", "is not a load over the cycle, such as mount force", "minimise one"
                )
        return [Point(case) for case in self.cases]

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the percentile of a load over the cycle, for one case [SI]."""
        problem = problem_files.problem(point)
        measure = next(term.measure for term in problem.objective if term.measure.is_load)
        rows = evaluate(problem).rows(measure)
        return {"value": float(np.percentile(lengths(rows.vectors), self.share)), "unit": measure.channel.unit}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the percentiles of all cases as a dataset."""
        import xarray as xr

        values = [record["value"] for record in records]
        words = f"load not exceeded in {self.share:g} % of the cycle"
        variables = {"percentile": variable("case", values, words, records[0]["unit"])}
        return xr.Dataset(variables, {"case": [point.case.name for point in points]}, self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a table of the percentiles, one row for each case."""
        about = data["percentile"].attrs
        values = zip(data["case"].values, data["percentile"].values, strict=True)
        rows = [[str(case), number(float(value))] for case, value in values]
        return [marked_table(["case", f"{about['long_name']} [{about['units']}]"], rows)]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Return a picture of the percentiles, one mark for each case."""
        about = data["percentile"].attrs
        places = np.arange(data.sizes["case"], dtype=float)
        marks: list[p.Mark] = [p.Line(places, data["percentile"].values, p.colour(0, 1), width=0.0, marker="o")]
        names = list(zip(places.tolist(), map(str, data["case"].values), strict=True))
        panel = p.Panel(marks, p.Axis(ticks=names), p.Axis(f"load [{about['units']}]"))
        words = f"{about['long_name'][:1].upper()}{about['long_name'][1:]}, a dot for each case."
        return p.Picture(data.attrs["title"], words, [panel], p.credit(data))
