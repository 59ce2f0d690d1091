"""Study kind `free forces`: free forces and couples of the first two orders by layout, compared with the literature.

Handbooks tabulate them for the choice of a crankshaft: forces over the force F_h of one cylinder, couples about the
middle over F_h times the spacing a. Crank weights balance the part of an order that turns with the crank; the part that
turns against it needs a balancer shaft (Hasselgruber 1964, eq. 33, Fig. 29).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from laufruhe.errors import ModelError
from laufruhe.files import fields as f
from laufruhe.files.fields import Table
from laufruhe.files.study_tables import CaseTable
from laufruhe.machine import Engine, SliderCrank
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.order_coefficients import piston_acceleration_orders
from laufruhe.physics.rigid_body import turning_parts
from laufruhe.physics.shaking_loads import reciprocating_loads
from laufruhe.present import picture as p
from laufruhe.present.numbers import fixed
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text, marked_table

if TYPE_CHECKING:
    import xarray as xr

ORDERS, WHAT = (1, 2), ("force", "couple")
SPEED = 100.0
"""Crank speed [rad/s] at which loads are taken; it drops out of the ratios."""
_WORDS = {
    "force": "free force over one cylinder's",
    "couple": "free couple over one cylinder's force times the spacing",
    "force_against": "free force that turns against the crank",
    "couple_against": "free couple that turns against the crank",
}


@dataclass(frozen=True)
class FreeLoad:
    """Free load of one order that the pistons leave, its largest value over a turn relative to one cylinder's [1].

    Couples are relative to force times spacing. `against` is the part that turns against the crank; no crank
    weight balances it.
    """

    force: float
    couple: float
    force_against: float
    couple_against: float


def free_load(engine: Engine, order: int, spacing: float) -> FreeLoad:
    """Return the free force and couple that the reciprocating masses leave in one order, about the engine's middle.

    `order` is a multiple of crank speed; `spacing` is the unit of length of the couples [m]. Raise `ModelError` if
    cylinders differ in mechanism, because then no single cylinder gives the unit of force.
    """
    shapes = {(p.crank_radius, p.rod_length, p.offset, p.reciprocating_mass) for p in engine.slider_cranks}
    if len(shapes) > 1:
        raise ModelError(
            f"the cylinders of '{engine.name}' differ, so free forces have no common unit; give all the same size"
        )
    part = engine.slider_cranks[0]
    if type(part) is not SliderCrank:
        raise ModelError(f"free forces are counted in those of a slider-crank, which '{part.name}' is not")
    amplitude = abs(piston_acceleration_orders(part.rod_ratio, part.offset_ratio, order)[order])
    unit = part.reciprocating_mass * part.crank_radius * SPEED**2 * float(amplitude)
    load = reciprocating_loads(engine, SPEED).at(order)
    force, couple = load[1:3] / unit, load[4:6] / (unit * spacing)
    force_against, couple_against = (float(abs(turning_parts(*load)[1])) for load in (force, couple))
    return FreeLoad(float(order_amplitude(force)), float(order_amplitude(couple)), force_against, couple_against)


def count_agreeing(data: xr.Dataset) -> tuple[int, int]:
    """Return how many printed values agree to half of their last digit, and the number of printed values."""
    half = 0.5 * 10.0 ** -int(data.attrs["digits"]) * (1.0 + 1e-9)
    differences = np.array([abs(data[what].values - data[f"{what}_printed"].values) for what in WHAT])
    return int((differences <= half).sum()), int(np.isfinite(differences).sum())


class LiteratureTable(Table):
    """Published free forces and couples, relative to those of one cylinder."""

    force_1: f.NonNegative | None = None
    couple_1: f.NonNegative | None = None
    force_2: f.NonNegative | None = None
    couple_2: f.NonNegative | None = None


class FreeForcesCase(CaseTable):
    """Layout, and its printed values in tables."""

    literature: LiteratureTable = LiteratureTable()


class FreeForces(Part):
    """Free forces and couples of the first two orders by layout, compared with the literature."""

    kind: Literal["free forces"]
    cases: list[FreeForcesCase] = Field(min_length=1)  # type: ignore[assignment]
    spacing: f.PositiveLength = f.required("Unit of length of the couples: the distance of the throws.")
    digits: Annotated[int, Field(ge=0, le=12)] = f.optional("Digits after the decimal point.", 4)

    def settings(self) -> dict[str, Any]:
        """Return the unit of length only; printed values change nothing."""
        return {"kind": self.kind, "spacing": self.spacing}

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: one for each engine layout."""
        points = [Point(case) for case in self.cases]
        for point in points:
            problem_files.problem(point)
        return points

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return free forces and couples of one layout, and its shortest and longest firing interval [rad]."""
        engine = problem_files.problem(point).engine
        loads = [asdict(free_load(engine, order, self.spacing)) for order in ORDERS]
        intervals = engine.firing_intervals
        return {"loads": loads, "intervals": [min(intervals), max(intervals)], "cylinders": len(engine.cylinders)}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:  # noqa: ARG002
        """Return the free forces of all layouts as a dataset, with printed values.

        NaN where the literature has none.
        """
        import xarray as xr

        along = ("case", "order")
        table = {
            name: variable(along, [[load[name] for load in record["loads"]] for record in records], words)
            for name, words in _WORDS.items()
        }
        literature = [case.literature.model_dump(exclude_none=True) for case in self.cases]
        for what in WHAT:
            values = [[values_of.get(f"{what}_{order}", math.nan) for order in ORDERS] for values_of in literature]
            table[f"{what}_printed"] = variable(along, values, f"free {what} in the literature")
        for k, (name, which) in enumerate((("least", "shortest"), ("largest", "longest"))):
            ends = np.degrees([record["intervals"][k] for record in records])
            table[f"{name}_interval"] = variable("case", ends, f"{which} firing interval", "deg")
        cylinders = ("case", [record["cylinders"] for record in records], {"units": "1"})
        coords = {"case": [case.name for case in self.cases], "order": list(ORDERS), "cylinders": cylinders}
        return xr.Dataset(table, coords, self.about(digits=self.digits))

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a table of free forces and couples by layout, values of the literature in brackets."""
        columns = [(what, int(order)) for order in data["order"].values for what in WHAT]
        head = ["layout", "firing intervals [deg]", *(f"{what} {order}" for what, order in columns)]
        head += ["force 1 left by crank weights", "couple 1 left by crank weights"]
        rows = []
        for name in data["case"].values:
            row = data.sel(case=name)
            minimum, maximum = float(row["least_interval"]), float(row["largest_interval"])
            even = maximum - minimum < 1e-6
            cells = [str(name), f"{maximum:.4g}" if even else f"{minimum:.4g} to {maximum:.4g}"]
            for what, order in columns:
                computed, printed = (float(row.sel(order=order)[name]) for name in (what, f"{what}_printed"))
                cells.append(fixed(computed, 4) + ("" if math.isnan(printed) else f" ({printed:g})"))
            first = row.sel(order=1)
            rows.append([*cells, *(fixed(float(first[f"{what}_against"]), 4) for what in WHAT)])
        agreed, printed_count = count_agreeing(data)
        words = (
            f"{agreed} of {printed_count} printed values agree to half of the last of {data.attrs['digits']} digits."
        )
        legend = "Unit: force of one cylinder in the same order, for couples times the spacing; printed values "
        return [legend + "in brackets.", marked_table(head, rows), words]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw bars of free forces and of the part that crank weights cannot balance; printed values are dots."""
        count = data.sizes["case"]
        columns = [(what, order) for order in data["order"].values for what in WHAT]
        panels = []
        for k, (what, order) in enumerate(columns):
            names = (what, f"{what}_against", f"{what}_printed")
            free, against, printed = (data.sel(order=order)[name].values for name in names)
            rows, maximum = range(count), float(max(free.max(initial=0.0), np.nanmax(printed, initial=0.0))) or 1.0
            marks: list[p.Mark] = [
                p.Bars(rows, free, 0.62, upright=False),
                p.Bars(rows, against, 0.26, "pale", upright=False),
                p.Line(printed, rows, width=0.0, marker="o", size=3.5),
            ]
            for row, value in zip(rows, free, strict=True):
                marks.append(p.Words(value + 0.04 * maximum, row, f"{value:.4g}" if value > 1e-9 else "0"))
            ticks = [(float(row), str(name)) for row, name in enumerate(data["case"].values)] if k == 0 else []
            side = p.Axis(ends=(count - 0.4, -0.6), ticks=ticks, grid=False)
            panels.append(p.Panel(marks, p.Axis(ends=(0.0, 1.3 * maximum)), side, f"{what}, order {order}"))
        legend: list[p.Mark] = [
            p.Bars(label="free"),
            p.Bars(colour="pale", label="part against the crank"),
            p.Line(marker="o", size=3.5, width=0.0, label="literature"),
        ]
        words = "Free loads of the pistons. Unit: force of one cylinder, for couples times the spacing."
        size = (1.75, 0.2 * count + 0.2)
        return p.Picture(data.attrs["title"], words, panels, p.credit(data), size, 4, 0.3, legend=legend)
