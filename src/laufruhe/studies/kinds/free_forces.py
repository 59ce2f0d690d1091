"""Free forces and couples by layout, beside what tables print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.file_models import Table
from laufruhe.files.study_parts import CaseTable
from laufruhe.studies import picture as p
from laufruhe.studies.free_forces import FreeLoad, Layout, compared, layout, printed_agree
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.text import Rows, Text

if TYPE_CHECKING:
    import xarray as xr

WHAT = ("force", "couple")


class LiteratureTable(Table):
    """Printed free forces and couples, over those of one cylinder."""

    force_1: f.NonNegative | None = None
    couple_1: f.NonNegative | None = None
    force_2: f.NonNegative | None = None
    couple_2: f.NonNegative | None = None


class FreeForcesCase(CaseTable):
    """One layout, and what tables print of it."""

    literature: LiteratureTable = LiteratureTable()


class FreeForces(Part):
    """Free forces and couples of the first two orders by layout, beside the literature."""

    kind: Literal["free forces"]
    cases: list[FreeForcesCase] = Field(min_length=1)  # type: ignore[assignment]
    spacing: f.PositiveLength = Field(description="Unit of length of the couples: the distance of the throws.")
    digits: Annotated[int, Field(ge=0, le=12)] = Field(default=4, description="Printed after the point.")

    def settings(self) -> dict[str, Any]:
        """The unit of length alone: what is printed elsewhere changes nothing."""
        return {"kind": self.kind, "spacing": self.spacing}

    def points(self, scenes: Scenes) -> list[Point]:
        """Every layout."""
        points = [Point(case) for case in self.cases]
        for point in points:
            scenes.problem(point)
        return points

    def answer(self, point: Point, scenes: Scenes) -> Record:
        """Free loads of one layout."""
        with scenes.blamed(point):
            return asdict(layout(scenes.problem(point).engine, self.spacing))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Layouts side by side."""
        layouts = {point.case.name: _layout(record) for point, record in zip(points, records, strict=True)}
        given = {case.name: case.literature.model_dump(exclude_none=True) for case in self.cases}
        printed = {name: {key.replace("_", " "): value for key, value in of.items()} for name, of in given.items()}
        return compared(layouts, printed).assign_attrs(self.about(digits=self.digits))

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Free forces and couples by layout, printed values behind them where there are some."""
        columns = [(what, int(order)) for order in data["order"].values for what in WHAT]
        head = ["layout", "firing intervals [deg]", *(f"{what} {order}" for what, order in columns)]
        head += ["crank weights leave of force 1", "of couple 1"]
        rows = []
        for name in data["case"].values:
            row = data.sel(case=name)
            least, most = float(row["least_interval"]), float(row["largest_interval"])
            even = most - least < 1e-6
            cells = [str(name), f"{most:.4g}" if even else f"{least:.4g} to {most:.4g}"]
            cells += [_beside(row.sel(order=order), what) for what, order in columns]
            first = row.sel(order=1)
            rows.append([*cells, *(_plain(float(first[f"{what}_against"])) for what in WHAT)])
        agreed, of = printed_agree(data)
        words = f"{agreed} of {of} printed values agree to half of the last of {data.attrs['digits']} digits."
        legend = "Forces over one cylinder's of the same order, couples over that times the spacing; printed values "
        return [legend + "in brackets.", Rows(head, rows), words]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Bars of what is free, the part that crank weights cannot take beside it, printed values as dots."""
        count = data.sizes["case"]
        columns = [(what, order) for order in data["order"].values for what in WHAT]
        panels = [_column(data, what, order, first=k == 0) for k, (what, order) in enumerate(columns)]
        legend: list[p.Mark] = [
            p.Bars(label="free"),
            p.Bars(colour="pale", label="of it against the crank"),
            p.Line(marker="o", size=3.5, width=0.0, label="literature"),
        ]
        words = "Pistons alone, over one cylinder's force, couples times the spacing."
        size = (1.75, 0.2 * count + 0.2)
        return p.Picture(data.attrs["title"], words, panels, p.credit(data), size, 4, 0.3, room=1.1, legend=legend)


def _layout(record: Mapping[str, Any]) -> Layout:
    least, most = record["intervals"]
    return Layout(tuple(FreeLoad(**load) for load in record["loads"]), (least, most), record["cylinders"])


def _beside(row: xr.Dataset, what: str) -> str:
    ours, printed = float(row[what]), float(row[f"{what}_printed"])
    return _plain(ours) if printed != printed else f"{_plain(ours)} ({printed:g})"


def _plain(value: float) -> str:
    return "0" if abs(value) < 1e-9 else f"{value:.4f}"


def _column(data: xr.Dataset, what: str, order: Any, first: bool) -> p.Panel:
    here = data.sel(order=order)
    free, against, printed = (here[name].values for name in (what, f"{what}_against", f"{what}_printed"))
    rows = range(len(free))
    most = float(max(free.max(initial=0.0), np.nanmax(printed, initial=0.0))) or 1.0
    marks: list[p.Mark] = [
        p.Bars(rows, free, 0.62, upright=False),
        p.Bars(rows, against, 0.26, "pale", upright=False),
        p.Line(printed, rows, width=0.0, marker="o", size=3.5),
    ]
    for row, value in zip(rows, free, strict=True):
        marks.append(p.Words(value + 0.04 * most, row, f"{value:.4g}" if value > 1e-9 else "0", 6.5))
    ticks = [(float(k), str(name)) for k, name in enumerate(data["case"].values)] if first else []
    side = p.Axis(ends=(rows[-1] + 0.6, -0.6), ticks=ticks, small=7.5, grid=False)
    return p.Panel(marks, p.Axis(ends=(0.0, 1.3 * most)), side, f"{what}, order {order}")
