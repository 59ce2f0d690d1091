"""Study parts of many random draws, in pieces that depend only on the seed and the draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from laufruhe.extensions.random_studies.draws import COLUMNS, VALUES, Column, Draws
from laufruhe.files import fields as f
from laufruhe.numerics.arrays import Array
from laufruhe.present import picture as p
from laufruhe.studies.part import Part
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.units import readable

if TYPE_CHECKING:
    import xarray as xr

MAX_DRAWS = 1_000_000_000
MAX_TABLED = 50_000
"""Largest number of draws, over all cases, that are also written as CSV."""
LISTED = (5.0, 50.0, 95.0)
CURVE = np.arange(1, 400) / 4.0
_WORDS = 4
"""Random numbers that one step of the generator makes."""


class Sampled(Part):
    """Study part with many random draws for each case; all cases use the same random numbers."""

    draws: Annotated[int, Field(ge=1, le=MAX_DRAWS)] = f.required("Number of draws of each case.")
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1964
    chunk: Annotated[int | None, Field(ge=1, le=1_000_000)] = f.optional(
        "Draws in one piece of work; 10000 designs or 1000 problems by default."
    )
    own_chunk: ClassVar[int] = 1000

    def settings(self) -> dict[str, Any]:
        """Return the settings of a piece; a larger number of draws keeps existing pieces."""
        return {**super().settings(), "name": self.name, "draws": None, "chunk": self.piece}

    @property
    def piece(self) -> int:
        """Number of draws in one piece of work."""
        return self.chunk or self.own_chunk

    def size(self) -> int:
        """Return the number of pieces of all cases."""
        return len(self.cases) * -(-self.draws // self.piece)

    def check_objective(self, problem_files: ProblemFiles) -> None:
        """Raise `InputError` unless all cases have the same objective."""
        names = [(case, problem_files.problem(Point(case)).objective_name) for case in self.cases]
        for case, name in names:
            if not name:
                raise problem_files.refused(
                    case, "objective", "is missing, but the random draws are compared by it", "add an objective"
                )
            if name != names[0][1]:
                rule = f"is {name} in '{case.name}' and {names[0][1]} in '{names[0][0].name}'"
                raise problem_files.refused(case, "objective", rule, "give each its own part")

    def columns(self, problem_files: ProblemFiles) -> dict[str, Column]:
        """Return the columns of numbers that each draw has, by name."""
        raise NotImplementedError

    def store(self, folder: Path, points: Mapping[str, Point], problem_files: ProblemFiles) -> Draws:
        """Return the store of the pieces of draws."""
        return Draws(folder, self.columns(problem_files), points)

    def spans(self) -> list[tuple[int, int]]:
        """Return (first draw, end) of every piece."""
        return [(k, min(k + self.piece, self.draws)) for k in range(0, self.draws, self.piece)]

    def random(self, span: tuple[int, int], width: int) -> Array:
        """Return random numbers from 0 to 1 for a range of draws, (draws, width); they do not depend on the batches."""
        steps = -(-width // _WORDS)
        generator = np.random.Philox(key=self.seed)
        generator.advance(span[0] * steps)
        return np.random.Generator(generator).random((span[1] - span[0], steps * _WORDS))[:, :width]

    def gathered(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return all draws as a dataset with dimensions case and draw, and a variable for each column."""
        import xarray as xr

        first = next(k for k, point in enumerate(points) if point.span is not None)
        columns, cases = records[first][COLUMNS], [case.name for case in self.cases]
        values = np.empty((len(columns), len(cases), self.draws))
        for k, point in enumerate(points):
            if point.span is not None:
                values[:, cases.index(point.case.name), slice(*point.span)] = records[k][VALUES].T
        variables = {
            name: (("case", "draw"), column_values, {"units": column.unit, "long_name": column.words})
            for column_values, (name, column) in zip(values, columns.items(), strict=True)
        }
        return xr.Dataset(variables, {"case": cases}, self.about(seed=self.seed))

    @property
    def ends(self) -> tuple[Literal["nc", "csv", "png"], ...]:
        """Endings of the files; a CSV file up to `MAX_TABLED` draws."""
        return ("nc", "csv", "png") if len(self.cases) * self.draws <= MAX_TABLED else ("nc", "png")


def in_unit(values: xr.DataArray) -> tuple[Array, str]:
    """Return numbers in readable units, and the unit."""
    unit, factor = readable(str(values.attrs["units"]))
    return factor * np.asarray(values.values, dtype=float), unit


def share_below(values: Array, colour: p.Colour, label: str, dash: Sequence[float] = ()) -> p.Line:
    """Return the line of a picture that shows which percentage of values lies below each value."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return p.Line((), (), colour, label, dash=dash)
    return p.Line(np.percentile(finite, CURVE), CURVE, colour, label, dash=dash)


def percentiles_of(values: Array) -> list[float]:
    """Return the values below which 5, 50 and 95 % of all values lie; NaN without values."""
    finite = values[np.isfinite(values)]
    return [float(value) for value in np.percentile(finite, LISTED)] if len(finite) else [float("nan")] * len(LISTED)
