"""Base of all kinds of study parts: keys, points, dataset, table and picture."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol, TypeAlias

from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.fields import Name, Table
from laufruhe.files.study_tables import CaseTable, Value
from laufruhe.present.picture import Picture
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr

Record: TypeAlias = dict[str, Any]


class Store(Protocol):
    """Records of finished points by fingerprint."""

    @property
    def seconds(self) -> Mapping[str, float]:
        """Computing time of every point [s], by fingerprint."""

    def read(self, fingerprint: str) -> Record:
        """Return the record of the point with a fingerprint; all records together may exceed the memory."""

    def keep(self, fingerprint: str, seconds: float, record: Record) -> None:
        """Store the record and the computing time [s] of the point with a fingerprint, before this returns."""


class Part(Table):
    """Part of a study: its cases, and how they become points, records, a dataset, a table and a picture.

    A kind is a subclass in the table `laufruhe.studies.kinds.KINDS`, with its name as `kind: Literal[...]`;
    it is found there. Its fields are its keys in the study file.
    """

    name: f.Slug
    title: Annotated[str, Field(min_length=1)]
    source: str = ""
    cases: list[CaseTable] = Field(min_length=1)
    readings: dict[Name, dict[str, Value]] = f.optional(
        "Where a number of the source may be misprinted: paths and values, by a name of each reading; "
        "in a replication, numbers and values.",
        {},
    )

    def by_reading(self) -> list[Part]:
        """Return one part for each interpretation ("reading") of a doubtful printed number; itself without readings."""

        def read(value: Any, changes: dict[str, Value]) -> Any:
            if isinstance(value, list):
                return [read(entry, changes) for entry in value]
            return value.model_copy(update={"set": {**changes, **value.set}}) if isinstance(value, CaseTable) else value

        parts: list[Part] = []
        for name, changes in self.readings.items():
            slug = re.sub("[^a-z0-9]+", "-", name.lower()).strip("-")
            names = {"name": f"{self.name}-{slug}", "title": f"{self.title}; {name}", "readings": {}}
            parts.append(self.model_copy(update={key: read(value, changes) for key, value in self} | names))
        return parts or [self]

    def settings(self) -> dict[str, Any]:
        """Return the settings shared by all points."""
        return self.model_dump(exclude={"name", "title", "source", "cases", "readings", "sweep"})

    def swept_or_drawn(self) -> list[tuple[str, Callable[[], object]]]:
        """Return the tables that name quantities, by key, and functions that read them; these may raise `Refused`."""
        return []

    def size(self) -> int:
        """Return a lower bound of the number of points, without making the points."""
        return len(self.cases)

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the pieces of work; refuse a wrong part before any work begins."""
        raise NotImplementedError

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of one piece of work as JSON values; it depends on the settings and the point only.

        A `ModelError` is the fault of the point, and is recorded as such.
        """
        raise NotImplementedError

    def store(
        self, folder: Path, points: Mapping[str, Point], problem_files: ProblemFiles
    ) -> AbstractContextManager[Store]:
        """Return the store of ranges of draws, points by their fingerprints, in a folder; other parts have none."""
        raise NotImplementedError

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return records, in the order of the points, as one labelled dataset."""
        raise NotImplementedError

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return the paragraphs and tables of the report."""
        raise NotImplementedError

    @staticmethod
    def picture(data: xr.Dataset) -> Picture:
        """Return the picture of the dataset."""
        raise NotImplementedError

    @staticmethod
    def summary(datasets: Iterable[xr.Dataset]) -> str:  # noqa: ARG004
        """Return a summary of the datasets of all parts; may be empty."""
        return ""

    @property
    def ends(self) -> tuple[str, ...]:
        """Endings of the files of this part; "png" stands for its picture in any format."""
        return ("nc", "csv", "png")

    def about(self, **attributes: Any) -> dict[str, Any]:
        """Return the attributes of the dataset."""
        return {"title": self.title, "kind": self.settings()["kind"], "source": self.source, **attributes}


def variable(dims: str | tuple[str, ...], values: Any, words: str, unit: str = "1") -> tuple[Any, Any, dict[str, str]]:
    """Return values along dimensions with unit and long name, as xarray takes them."""
    return dims, values, {"units": unit or "1", "long_name": words}
