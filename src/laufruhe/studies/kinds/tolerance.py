"""Free forces that tolerances leave in several engines, at their worst and at random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from laufruhe.files import fields as f
from laufruhe.files.fields import Name, Table
from laufruhe.files.study_parts import CaseTable
from laufruhe.physics.modes import GRAVITY
from laufruhe.present.numbers import percent
from laufruhe.studies import picture as p
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.text import Rows, Text, number, said
from laufruhe.studies.tolerance import CAUSES, Spread, Tolerances, compared, rise_of, spread, verdicts

LEAST = 0.1
"""Left end of the axis [kp]; what is smaller stands there with its value."""
TALL = 0.7


class TolerancesTable(Table):
    """How far a built engine may stand from its drawing."""

    reciprocating_mass: f.Mass = Field(default=0.0, description="Of each cylinder, either way.")
    unbalance: f.Unbalance = Field(default=0.0, description="Left on each balancing plane, at any angle.")
    planes: Annotated[int, Field(ge=1, le=48)] = 2
    alignment: f.NonNegativeLength = Field(default=0.0, description="Eccentricity of each aligned mass.")
    aligned_masses: list[f.Mass] = Field(
        default_factory=list, max_length=48, description="Flywheel, clutch and whatever else is centred on the crank."
    )

    @model_validator(mode="after")
    def _is_something(self) -> TolerancesTable:
        aligned = self.alignment * sum(self.aligned_masses)
        if not self.reciprocating_mass + self.unbalance + aligned > 0.0:
            raise f.refusal("leave nothing to chance; give one above zero (alignment needs aligned_masses)")
        return self


class ToleranceCase(CaseTable):
    """One engine, and what the source says of finer balancing for it."""

    claim: Literal["promises nothing", "matters"] | None = Field(default=None, description="Of finer balancing.")


class MarkTable(Table):
    """A force that a picture shows beside ours."""

    name: Name
    force: f.Force


class Tolerance(Part):
    """Free forces that manufacturing tolerances leave, at their worst and at random."""

    kind: Literal["tolerance"]
    cases: list[ToleranceCase] = Field(min_length=1)  # type: ignore[assignment]
    tolerances: TolerancesTable
    engines: Annotated[int, Field(ge=100, le=1_000_000)] = Field(default=10_000, description="Built at random.")
    seed: Annotated[int, Field(ge=0)] = 1964
    marks: list[MarkTable] = Field(default_factory=list)

    def settings(self) -> dict[str, Any]:
        """What random engines hang on; marks are for pictures."""
        return self.model_dump(include={"kind", "tolerances", "engines", "seed"})

    def points(self, scenes: Scenes) -> list[Point]:
        """Every engine, at its one operating point."""
        for case in self.cases:
            if len(scenes.problem(Point(case)).points) != 1:
                rule = f"has several in '{case.name}', and tolerances are studied at one"
                raise scenes.refused(case, "operating_points", rule, "name an engine with one")
        return [Point(case) for case in self.cases]

    def answer(self, point: Point, scenes: Scenes) -> Record:
        """The spread of one engine."""
        given = self.tolerances.model_dump()
        tolerances = Tolerances(**{**given, "aligned_masses": tuple(given["aligned_masses"])})
        with scenes.blamed(point):
            return asdict(spread(scenes.problem(point), tolerances, self.engines, self.seed))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Engines side by side, with what is claimed of them."""
        found = compared({point.case.name: Spread(**record) for point, record in zip(points, records, strict=True)})
        names, forces = [mark.name for mark in self.marks], [mark.force for mark in self.marks]
        shown = {"mark_names": names, "mark_forces": forces} if names else {}
        about = self.about(seed=self.seed, engines=self.engines, **shown)
        return found.assign_coords(claim=("case", [case.claim or "" for case in self.cases])).assign_attrs(about)

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Nominal, worst and random free forces of every engine [kp], cause by cause, and what was said."""
        head = ["engine", "drawing [kp]", "worst sum [kp]", *(f"of it {cause} [kp]" for cause in CAUSES)]
        head += ["random: mean [kp]", "95 % below [kp]", "drawing over worst sum"]
        head += ["mean mount force, drawing [kp]", "95 % of built engines: at most"]
        rows = []
        for name in data["case"].values:
            row = data.sel(case=name)
            nominal, worst = float(row["nominal"]) / GRAVITY, float(row["worst"]) / GRAVITY
            parts = [f"{float(row['worst_' + cause.replace(' ', '_')]) / GRAVITY:.1f}" for cause in CAUSES]
            often = float(row["random"].sel(share=0.95, method="nearest")) / GRAVITY
            cells = [str(name), f"{nominal:.3g}", f"{worst:.1f}", *parts, f"{float(row['mean']) / GRAVITY:.1f}"]
            cells += [f"{often:.1f}", f"{nominal / worst:.2g}", number(float(row["mount"]) / GRAVITY, 3)]
            rows.append([*cells, percent(rise_of(row))])
        return [Rows(head, rows), *said(verdicts(data))]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Density over random engines, worst sum, and the free force of the drawing, a row an engine."""
        rows = [data.sel(case=name) for name in data["case"].values]
        stated = np.atleast_1d(data.attrs.get("mark_forces", []))
        most = max([float(data["nominal"].max()), float(data["worst"].max()), *stated]) / GRAVITY
        panel = p.Panel(
            [mark for k, row in enumerate(rows) for mark in _row(row, k)] + _marks(data, len(rows)),
            p.Axis("largest free force over the cycle [kp]", (LEAST, max(2.0 * most, 10.0 * LEAST)), log=(1.0,)),
            p.Axis(ends=(len(rows) - 0.5, -0.8), ticks=[(k, _label(row)) for k, row in enumerate(rows)], grid=False),
        )
        legend: list[p.Mark] = [
            p.Area(label=f"{data.attrs['engines']:,} random engines"),
            p.Line(colour="after", marker="|", size=12.0, width=0.0, label="worst sum"),
            p.Line(marker="D", width=0.0, label="drawing"),
        ]
        legend += [p.Line(colour="faint", dash=(3.0, 2.0), label="stated")] if len(stated) else []
        words = "What tolerances add to the free force. Percents: what 95 of 100 add to the mean mount force at most."
        credit, size = p.credit(data, f"Seed {data.attrs['seed']}. "), (7.2, 0.62 * len(rows) + 0.5)
        return p.Picture(data.attrs["title"], words, [panel], credit, size, legend=legend)


def _label(row: xr.Dataset) -> str:
    """Name, and what tolerances do to the mounts."""
    rise = rise_of(row)
    return str(row["case"].item()) + (f"\n{percent(rise)}" if np.isfinite(rise) else "")


def _row(row: xr.Dataset, k: int) -> list[p.Mark]:
    places, density = _density(row["random"].values / GRAVITY, row["share"].values)
    worst, nominal = float(row["worst"]) / GRAVITY, float(row["nominal"]) / GRAVITY
    at = max(nominal, LEAST)
    return [
        p.Area(places, np.full(len(places), k), k - TALL * density),
        p.Line([worst], [k - 0.3], "after", marker="|", size=14.0, width=0.0),
        p.Words(worst * 1.08, k - 0.3, f"{worst:.0f}", 8.0, "after"),
        p.Line([at], [k - 0.3], marker="D", width=0.0),
        p.Words(at * 1.12, k - 0.3, f"{nominal:.3g}", 8.0),
    ]


def _density(quantiles: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Density over the logarithm of the force, its peak at one, from quantiles four percent apart."""
    force = np.maximum(quantiles, 1e-6)[::8]
    steps = np.diff(np.log(force))
    density = np.diff(shares[::8]) / np.maximum(steps, 1e-9)
    middle = np.sqrt(force[1:] * force[:-1])
    places = np.concatenate([force[:1], middle, force[-1:]])
    return places, np.concatenate([[0.0], density / density.max(), [0.0]])


def _marks(data: xr.Dataset, count: int) -> list[p.Mark]:
    names, forces = (np.atleast_1d(data.attrs.get(key, [])) for key in ("mark_names", "mark_forces"))
    found: list[p.Mark] = []
    for name, force in zip(names, forces / GRAVITY if len(forces) else forces, strict=True):
        found.append(p.Line([force] * 2, [-0.55, count - 0.5], "faint", width=1.2, dash=(3.0, 2.0), behind=True))
        found.append(p.Words(force, -0.58, f"{name}: {force:.0f}", colour="faint", across="center", along="bottom"))
    return found
