"""Replication of a source: its cases are computed, its statements judged and its figures drawn, by a study file."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails

from laufruhe.errors import ModelError
from laufruhe.extensions.replication.drawing import draw_picture
from laufruhe.extensions.replication.expressions import (
    ExpressionError,
    Place,
    check,
    check_name,
    checks_in,
    fill_in,
    filler,
    grid,
    numbers_of,
)
from laufruhe.extensions.replication.judging import count_confirmed, judge_statements, rows
from laufruhe.extensions.replication.models import PictureTable, ReplicaCase, StatementTable
from laufruhe.extensions.replication.quantities import DIMENSIONS, QuantityQuery, check_quantity, quantity_value
from laufruhe.files import fields as f
from laufruhe.files.study_tables import joined
from laufruhe.present.picture import Picture
from laufruhe.solvers import Status, solve
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr


class Replication(Part):
    """Part of a paper or textbook: its statements, compared with values computed here."""

    kind: Literal["replication"]
    says: str = f.optional("Statement of the source, in a sentence.", "")
    cases: list[ReplicaCase] = Field(default_factory=list)  # type: ignore[assignment]
    numbers: dict[str, Any] = f.optional("Numbers by name: single numbers, lists, expressions or grids.", {})
    problems: dict[str, dict[str, Any]] = f.optional(
        "Tables of problem files, numbers in braces; `like` names one to start from.", {}
    )
    quantities: dict[str, str | QuantityQuery] = f.optional("Quantities computed for every case, by name.", {})
    define: dict[str, str] = f.optional("Expressions that several others use.", {})
    statements: list[StatementTable] = Field(default_factory=list)
    picture_: PictureTable | None = Field(default=None, alias="picture")

    @model_validator(mode="after")
    def _validate_names(self) -> Replication:
        # check names, cases, functions and quantities before anything is computed
        wrong = list[InitErrorDetails]()
        for place, entry, check_it in self._checks():
            try:
                check_it(entry)
            except ModelError as error:
                wrong.append(InitErrorDetails(type=f.refusal(str(error)), loc=place, input=entry))
        if wrong:
            raise ValidationError.from_exception_data("replication", wrong)
        return self

    def _checks(self) -> Iterator[tuple[Place, Any, Callable[[Any], None]]]:
        """Yield address, value and check of every name and expression in the part, for messages about wrong ones."""
        for reading, numbers in self.readings.items():
            for name in numbers:
                yield ("readings", reading), name, partial(check_name, known=self.numbers, what="number")
        for name, what in self.quantities.items():
            yield ("quantities", name), what, check_quantity
        cases = [case.name for case in self.cases]
        known: dict[str, Sequence[Any]] = dict.fromkeys((*self.numbers, *self.quantities), ())
        for name, text in self.define.items():
            yield ("define", name), text, partial(check, known=known, cases=cases)
            known[name] = ()
        yield from checks_in(self.statements, {**known, "value": ()}, cases, at=("statements",))
        places = [*DIMENSIONS, *(name for case in self.cases for name in case.sweep)]
        yield from checks_in(self.picture_, known, cases, places, ("picture",))

    def by_reading(self) -> list[Part]:
        """Return this part, which shows all readings (interpretations of the source) side by side."""
        return [self]

    def settings(self) -> dict[str, Any]:
        """Return the settings shared by all cases; numbers and problem files belong to the points."""
        return {"kind": self.kind, "quantities": {k: str(what) for k, what in self.quantities.items()}}

    def size(self) -> int:
        """Return the number of cases times swept numbers times readings."""
        points_per_reading = sum(math.prod(numbers.count for numbers in case.sweep.values()) for case in self.cases)
        return points_per_reading * len(self._all_readings())

    @property
    def ends(self) -> tuple[str, ...]:
        """Endings of the files; no CSV, because quantities have dimensions of their own."""
        return ("nc", "png") if self.picture_ else ("nc",)

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: every case at every combination of swept numbers, for each interpretation."""
        points = []
        for reading, case in itertools.product(self._all_readings().values(), self.cases):
            grids = {name: grid(name, table).values.tolist() for name, table in case.sweep.items()}
            with self._blamed(case.name):
                tables = self._tables(case.problem, problem_files)
                fill = filler(tables)
                for values in itertools.product(*grids.values()):
                    swept = dict(zip(grids, values, strict=True))
                    names = numbers_of({**self.numbers, **reading, **case.numbers, **swept}, {})
                    changed = case.model_copy(update={"set": fill_in(case.set, names), "numbers": swept})
                    points.append(Point(changed, base=tables if fill is None else fill(names)))
        return points

    def _all_readings(self) -> Mapping[str, Mapping[str, Any]]:
        return self.readings or {"": {}}

    def _tables(self, name: Any, problem_files: ProblemFiles, *parents: Any) -> dict[str, Any]:
        if name in parents or not isinstance(name, str):
            raise ExpressionError(
                f"problem '{name}' refers to itself by `like`, or its `like` is not a name; correct `like`"
            )
        if name not in self.problems:
            return problem_files.file(name)
        tables = {key: value for key, value in self.problems[name].items() if key != "like"}
        like = self.problems[name].get("like")
        return tables if like is None else joined(self._tables(like, problem_files, name, *parents), tables)

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return every quantity of one point of the study, at its optimum if numbers are open."""
        problem, case = problem_files.problem(point), _case(point)
        result = solve(problem)
        if result.status in (Status.INFEASIBLE, Status.FAILED):
            raise ModelError(f"no design meets all limits of case '{case.name}'; relax one limit")
        return {name: quantity_value(result, what)._asdict() for name, what in self.quantities.items()}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the computed quantities along the points as a dataset, with the verdict on every statement."""
        import xarray as xr

        swept, readings = list(dict.fromkeys(name for case in self.cases for name in case.sweep)), self._all_readings()
        data = xr.Dataset(
            coords={
                "case": ("point", [point.case.name for point in points]),
                "reading": ("point", np.repeat([*readings], len(points) // len(readings))),
                **{name: ("point", [_case(point).numbers.get(name, np.nan) for point in points]) for name in swept},
            },
            attrs=self.about(
                says=self.says, part=self.model_dump_json(by_alias=True, exclude_defaults=True, exclude={"problems"})
            ),
        )
        for name in self.quantities if records else ():
            data = data.merge(_along_points([record[name] for record in records], name))
        with self._blamed("statements"):
            return data.assign_coords(judge_statements(self.statements, self.names(data)))

    def names(self, data: xr.Dataset) -> dict[str, dict[str, Any]]:
        """Return the values of all names by interpretation ("reading") of the source.

        Names are numbers, quantities by case, and definitions.
        """
        names, known = [str(name) for name in data.data_vars if "point" in data[name].dims], {}
        for reading, numbers in self._all_readings().items():
            part = data.isel(point=np.flatnonzero(data["reading"] == reading))
            quantities = {name: _by_case(part, name) for name in names}
            known[reading] = numbers_of(self.define, {**numbers_of({**self.numbers, **numbers}, {}), **quantities})
        return known

    @staticmethod
    def summary(datasets: Iterable[xr.Dataset]) -> str:
        """Return how many statements of all parts are confirmed."""
        return count_confirmed(datasets)

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return the source's words, and every statement with the computed value."""
        lead = [f"Source: {data.attrs['says']}"] if data.attrs["says"] else []
        return [*lead, *rows(data)]

    @staticmethod
    def picture(data: xr.Dataset) -> Picture:
        """Return the picture that the file describes."""
        part = Replication.model_validate_json(data.attrs["part"])
        assert part.picture_ is not None
        with part._blamed("picture"):
            return draw_picture(part.picture_, part.names(data), data)

    @contextmanager
    def _blamed(self, where: str) -> Iterator[None]:
        try:
            yield
        except ExpressionError as error:
            raise ModelError(str(error), f"part '{self.name}', {where}") from None


def _case(point: Point) -> ReplicaCase:
    assert isinstance(point.case, ReplicaCase)
    return point.case


class _Cases(dict[str, Any]):
    """Values of a quantity by case."""

    def __missing__(self, name: str) -> Any:
        check_name(name, self, "case")


def _by_case(data: xr.Dataset, name: str) -> _Cases:
    """Return a quantity by case, along its swept numbers and its own dimensions."""
    import xarray as xr

    cases = _Cases()
    swept = [str(c) for c, labels in data.coords.items() if labels.dims == ("point",) and c not in ("case", "reading")]
    for case in dict.fromkeys(data["case"].values.tolist()):
        selected = data.isel(point=np.flatnonzero(data["case"].values == case))
        coords = {
            c: np.array(list(dict.fromkeys(selected[c].values.tolist()))) for c in swept if selected[c].notnull().all()
        }
        labels_of = {str(dim): selected[dim].values for dim in selected[name].dims[1:]}
        padded = np.full([len(labels) for labels in (*coords.values(), *labels_of.values())], np.nan)
        # values are placed by label, because cases may nest their sweeps in any order
        places = [
            [labels.tolist().index(label) for label in selected[c].values.tolist()] for c, labels in coords.items()
        ]
        padded[tuple(places)] = selected[name].values if places else selected[name].values[0]
        values = xr.DataArray(padded, coords={**coords, **labels_of}, dims=[*coords, *labels_of])
        for dim in labels_of if selected[name].attrs.get("padded") else ():
            values = values.dropna(dim, how="all")
        cases[str(case)] = values if values.dims else values.item()
    return cases


def _along_points(records: Sequence[Mapping[str, Any]], name: str) -> xr.DataArray:
    # one quantity of all points, padded with NaN for missing labels
    import xarray as xr

    dims = list(records[0]["coords"])
    coords = {dim: list(dict.fromkeys(label for record in records for label in record["coords"][dim])) for dim in dims}
    values = np.full((len(records), *(len(labels) for labels in coords.values())), np.nan)
    for k, record in enumerate(records):
        places = [[coords[dim].index(label) for label in labels] for dim, labels in record["coords"].items()]
        values[np.ix_([k], *places)] = np.array(record["values"], dtype=float)
    padded = int(any(len(record["coords"][dim]) < len(labels) for record in records for dim, labels in coords.items()))
    return xr.DataArray(values, coords, ("point", *coords), name, {"padded": padded})
