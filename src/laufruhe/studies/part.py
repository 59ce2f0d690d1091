"""What every kind of study part is: one class with its keys, points, dataset, table and picture."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import xarray as xr
from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.fields import Name, Table
from laufruhe.files.study_tables import CaseTable, Value
from laufruhe.present.picture import Picture
from laufruhe.studies.scenes import Point, Scenes
from laufruhe.studies.text import Text

Record: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Column:
    """A number that every draw has."""

    unit: str
    words: str


@dataclass(frozen=True)
class Template:
    """How the numbers of many draws are laid out before any is known.

    Attributes
    ----------
    draws, chunk
        Of each case, and of one piece of work.
    columns
        By their names.
    """

    cases: tuple[str, ...]
    draws: int
    chunk: int
    columns: Mapping[str, Column]


class Part(Table):
    """One dataset of a study, its cases, and words about it.

    A kind is a subclass in a module of `laufruhe.studies.kinds` with its name as `kind: Literal[...]`;
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

    def each_reading(self) -> list[Part]:
        """The part in each reading of a doubtful number, which is set in all of its cases; itself where none is."""
        return [self._in_reading(*reading) for reading in self.readings.items()] or [self]

    def _in_reading(self, name: str, values: dict[str, Value]) -> Part:
        def read(told: Any) -> Any:
            if isinstance(told, list):
                return [read(one) for one in told]
            return told.model_copy(update={"set": {**values, **told.set}}) if isinstance(told, CaseTable) else told

        slug = re.sub("[^a-z0-9]+", "-", name.lower()).strip("-")
        own = {"name": f"{self.name}-{slug}", "title": f"{self.title}; {name}", "readings": {}}
        return self.model_copy(update={**{key: read(told) for key, told in self}, **own})

    def settings(self) -> dict[str, Any]:
        """What is asked of every point: all but words, cases, and what is swept."""
        return self.model_dump(exclude={"name", "title", "source", "cases", "readings", "sweep"})

    def swept_or_drawn(self) -> list[tuple[str, Callable[[], object]]]:
        """Tables that name quantities, by their keys, and what reads them: `Refused` where one does not fit."""
        return []

    def size(self) -> int:
        """How many points it makes at least, counted before any is made."""
        return len(self.cases)

    def points(self, scenes: Scenes) -> list[Point]:
        """The pieces of work. What is wrong with the part is refused here, before any is done."""
        raise NotImplementedError

    def answer(self, point: Point, scenes: Scenes) -> Record:
        """One piece of work as JSON can hold it; it depends on the settings and the point alone.

        A `ModelError` is the fault of the point, and is told so.
        """
        raise NotImplementedError

    def template(self, scenes: Scenes) -> Template | None:  # noqa: ARG002
        """How records of points with a span are laid out; None where each point has a record of its own shape."""
        return None

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Records, in the order of the points, as one labelled dataset."""
        raise NotImplementedError

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """What the report says of the dataset."""
        raise NotImplementedError

    @staticmethod
    def picture(data: xr.Dataset) -> Picture:
        """What is drawn of the dataset."""
        raise NotImplementedError

    @staticmethod
    def summary(datasets: Iterable[xr.Dataset]) -> str:  # noqa: ARG004
        """Return what a report says of the datasets of all parts together; empty where that is nothing."""
        return ""

    @property
    def ends(self) -> tuple[str, ...]:
        """Kinds of files that are written."""
        return ("nc", "csv", "png")

    def about(self, **more: Any) -> dict[str, Any]:
        """Attributes of the dataset that every part has, and more."""
        return {"title": self.title, "kind": self.settings()["kind"], "source": self.source, **more}


def variable(dims: str | tuple[str, ...], values: Any, words: str, unit: str = "1") -> tuple[Any, Any, dict[str, str]]:
    """Values along dimensions with their unit and what they are, as xarray takes them."""
    return dims, values, {"units": unit, "long_name": words}
