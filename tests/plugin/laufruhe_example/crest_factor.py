"""Peak of a load over its root mean square."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray as xr

from laufruhe.numerics.norms import lengths
from laufruhe.present import picture as p
from laufruhe.problem.evaluation import evaluate
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text, marked_table, number


class CrestFactorPart(Part):
    """Crest factor of the first load that each case minimises, in the baseline design."""

    kind: Literal["crest factor"]

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return a point for each case, whose objective has to be a load."""
        for case in self.cases:
            if not any(term.measure.is_load for term in problem_files.problem(Point(case)).objective):
                raise problem_files.refused(
                    case, "objective", "is not a load over the cycle, such as mount force", "minimise one"
                )
        return [Point(case) for case in self.cases]

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the crest factor."""
        problem = problem_files.problem(point)
        measure = next(term.measure for term in problem.objective if term.measure.is_load)
        rows = evaluate(problem).rows(measure)
        size = lengths(rows.vectors)
        return {"value": float(size.max() / np.sqrt(np.square(size).mean()))}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return one number for each case."""
        values = [record["value"] for record in records]
        tables = {"crest_factor": variable("case", values, "crest factor", "1")}
        return xr.Dataset(tables, {"case": [point.case.name for point in points]}, self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a row for each case."""
        about = data["crest_factor"].attrs
        rows = [
            [str(case), number(float(value))]
            for case, value in zip(data["case"].values, data["crest_factor"].values, strict=True)
        ]
        return [marked_table(["case", f"{about['long_name']} [{about['units']}]"], rows)]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Return a mark for each case."""
        about = data["crest_factor"].attrs
        places = np.arange(data.sizes["case"], dtype=float)
        marks: list[p.Mark] = [p.Line(places, data["crest_factor"].values, p.colour(0, 1), width=0.0, marker="o")]
        names = list(zip(places.tolist(), map(str, data["case"].values), strict=True))
        panel = p.Panel(marks, p.Axis(ticks=names), p.Axis(f"load [{about['units']}]"))
        words = f"{about['long_name'][:1].upper()}{about['long_name'][1:]}, a dot for each case."
        return p.Picture(data.attrs["title"], words, [panel], p.credit(data))
