"""Study kind `counterweight fraction`: a metric over the balance factor (Hasselgruber 1964, Fig. 10)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from laufruhe.extensions.sweeps.sweep import SweepAxis
from laufruhe.extensions.sweeps.swept import SweptPart, coordinates, dataset
from laufruhe.extensions.sweeps.swept_report import (
    bars,
    claim_of,
    groups,
    lines,
    metric_axis,
    readable_metric,
    spread,
    swept_axis,
    swept_names,
)
from laufruhe.files.rotors import FACTORS
from laufruhe.files.study_tables import at
from laufruhe.present import picture as p
from laufruhe.studies.scenes import Point, ProblemFiles

if TYPE_CHECKING:
    import xarray as xr


class CounterweightFraction(SweptPart):
    """A metric over the balance factor, its proven optimum marked."""

    kind: Literal["counterweight fraction"]

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: each swept counterweight fraction and, for each speed, the open fraction."""
        problems = self.checked(problem_files)
        self.check_moved_by_loads(problems, problem_files, "counterweight")
        fraction = self._swept_fraction()
        if fraction is None:
            for case, problem in zip(self.cases, problems, strict=True):
                if not any(decision.name.endswith(FACTORS) for decision in problem.decisions):
                    rule = "has no open balance factor, and the part sweeps none"
                    raise problem_files.refused(
                        case, "counterweights", rule, "sweep counterweights.NAME.balance_factor"
                    )
            return [Point(case, changes, self.metric) for case in self.cases for changes in self.combinations()]
        points = []
        for case in self.cases:
            entry, numbers = at(problem_files.tables(Point(case)), fraction.quantity), fraction.numbers or ()
            left_open = entry if isinstance(entry, dict) else {"between": [min(numbers), max(numbers)]}
            for speed in self.combinations(without=fraction.quantity):
                tried = ({**speed, fraction.quantity: value} for value in (*fraction.values, left_open))
                points += [Point(case, changes, self.metric) for changes in tried]
        return points

    def _swept_fraction(self) -> SweepAxis | None:
        return next((axis for axis in self.axes() if axis.quantity.endswith(FACTORS)), None)

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the results of all fractions as a dataset; `optimum` marks the points with an open fraction."""
        fraction = self._swept_fraction()
        if fraction is None:
            return super().dataset(points, records)
        path, number = fraction.quantity, fraction.by_value()
        optimum = np.array([isinstance(point.changes[path], dict) for point in points])
        values = [
            _decided_fraction(record, path) if best else number[point.changes[path]]
            for point, record, best in zip(points, records, optimum, strict=True)
        ]
        other_axes = [axis for axis in self.axes() if axis.quantity != path]
        extra = {
            **coordinates(other_axes, points),
            path: ("point", values, {"units": "1", "long_name": "balance factor", "swept": 1}),
            "optimum": ("point", optimum, {"long_name": "true if the balance factor was open"}),
        }
        return dataset(points, records, extra, self.about())

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw the objective over the balance factor with dots at proven optima, or the best factor over speed."""
        data = readable_metric(data)
        if "optimum" not in data.coords:
            return _best_fraction(data)
        names = swept_names(data)
        along = next(name for name in names if name.endswith(FACTORS))
        best, marks, legend = data["optimum"].values, [], []
        x, y = data[along].values, data["objective"].values
        for label, chosen, colour in groups(data, [name for name in names if name != along]):
            # the line includes its optimum
            order = np.flatnonzero(chosen)[np.argsort(x[chosen])]
            marks += [
                p.Line(x[order], y[order], colour),
                p.Line(x[chosen & best], y[chosen & best], colour, width=0.0, marker="o"),
            ]
            legend.append(p.Line(colour=colour, marker="o", label=label))
        panel = p.Panel(marks, p.Axis("balance factor"), metric_axis(data))
        words = f"Dot: {claim_of(data)} with open balance factor."
        return p.Picture(data.attrs["title"], words, [panel], p.credit(data), legend=legend)


def _decided_fraction(record: Mapping[str, Any], quantity: str) -> float:
    decided = {name: value for name, value in record["decided"].items() if name.endswith(FACTORS)}
    only = next(iter(decided.values())) if len(decided) == 1 else math.nan
    return float(decided.get(quantity.split(".", 1)[-1], only))


def _best_fraction(data: xr.Dataset) -> p.Picture:
    names = swept_names(data)
    if not names:
        return bars(data, data["case"].values, "The balance factor is optimised.")
    axis, place = swept_axis(data, names[-1]), spread(data, names[-1])
    fractions = [k for k, name in enumerate(data["decision"].values) if str(name).endswith(FACTORS)]
    lower = [
        p.Line(place[chosen], data["decided"].values[chosen, k], colour)
        for _, chosen, colour in groups(data, names[:-1])
        for k in fractions
    ]
    upper = p.Panel(lines(data, names), swept_axis(data, names[-1], named=False), metric_axis(data))
    words = f"Every point: {claim_of(data)}."
    panels = [upper, p.Panel(lower, axis, p.Axis("best balance factor"))]
    return p.Picture(data.attrs["title"], words, panels, p.credit(data), size=(p.WIDE, 2.4))
