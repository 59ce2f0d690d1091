"""The keys of a replication: its cases, what the source states, and what is drawn (docs/reference/study-files.md)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from laufruhe.files import fields as f
from laufruhe.files.fields import Table
from laufruhe.files.study_tables import CaseTable
from laufruhe.present.picture import SERIES

Expression: TypeAlias = int | float | str
Loops: TypeAlias = Annotated[
    dict[str, list[int | float | str]],
    Field(alias="for", description="Name and values: it is drawn once for every value."),
]


Hue: TypeAlias = Literal[
    "ink", "faint", "grey", "pale", "sky", "blue", "indigo", "orange", "vermilion", "rust", "green", "leaf", "olive",
    "mint", "purple", "white",
]  # fmt: skip
Inches: TypeAlias = Annotated[float, Field(ge=0.5, le=20.0)]
Points: TypeAlias = Annotated[float, Field(ge=0.0, le=20.0)]
EXPRESSIONS = frozenset({"x", "y", "ends", "filled", "outline", "value", "is", "holds"})
"""Keys that hold expressions; in the texts of other keys they stand in braces."""


class GridTable(Table):
    """Numbers: listed, or equally spaced between two ends."""

    values: list[int | float] | None = None
    first: int | float | None = Field(default=None, alias="from")
    last: int | float | None = Field(default=None, alias="to")
    points: Annotated[int, Field(ge=2, le=100_000)] | None = None

    @model_validator(mode="after")
    def _is_one(self) -> GridTable:
        spaced = None not in (self.first, self.last, self.points)
        if spaced == bool(self.values):
            raise f.refusal("is no grid; give values, or from, to and points")
        return self

    @property
    def count(self) -> int:
        """Number of values, or of points; zero without either."""
        return len(self.values or ()) or self.points or 0


class ReplicaCase(CaseTable):
    """Case of a replication: its numbers replace those of the study part."""

    problem: str = f.required("A name under problems, or a problem file.")
    numbers: dict[str, Any] = f.optional("Numbers in place of those of the part.", {})
    sweep: dict[str, GridTable] = f.optional("Numbers that take several values.", {})


class StatementTable(Table):
    """Statement of the source, and how it is computed here."""

    text: Annotated[str, Field(min_length=1)]
    where: str = f.optional("Figure, page or equation.", "")
    printed: str | None = f.optional("Words or number of the source; without it the statement is not counted.")
    value: str
    unit: str = ""
    expected: Expression | None = Field(default=None, alias="is", description="Printed number in that unit.")
    within: int | float | f.Share | None = f.optional('Allowed: a number in that unit, or "15 %".')
    holds: str | None = f.optional("Condition, with the name value, in place of is and within.")
    why: str = ""

    @model_validator(mode="after")
    def _has_verdict(self) -> StatementTable:
        if (self.holds is None) == (self.expected is None):
            raise f.refusal("is a statement with `is` and `within`, or with `holds`; give one of the two")
        if (self.expected is None) != (self.within is None):
            raise f.refusal("is a statement that needs `is` and `within` together; give both")
        return self


class AxisTable(Table):
    """Axis of a panel."""

    label: str = ""
    ends: list[Expression] | None = Field(default=None, min_length=2, max_length=2)
    names: list[str] | str | None = f.optional("Names of the places 0, 1, 2 ..., in place of numbers.")
    ticks: list[int | float] | None = None
    log: list[Annotated[float, Field(ge=1.0, lt=10.0)]] = f.optional(
        "First digits of the ticks of a logarithmic axis.", []
    )


class CurveTable(Table):
    """A line, or dots where it has a marker and no width."""

    y: Expression
    x: Expression | None = f.optional("Place along the horizontal axis; by default the dimension of y.")
    loops: Loops = Field(default_factory=dict, alias="for")
    label: str = ""
    end: str = f.optional("Words beside the last point.", "")
    colours: list[Hue] = Field(default=list(SERIES), min_length=1)  # type: ignore[arg-type]
    width: Points = 2.0
    dash: list[Points] = Field(default_factory=list, max_length=2)
    marker: Literal["", "o", "s", "D", "^", "v", "x", "+", "|", "."] = ""


class BarsTable(Table):
    """Groups of bars, one of each group for every value."""

    filled: str
    outline: str | None = None
    loops: Loops = Field(default_factory=dict, alias="for")
    label: str = ""
    labels: list[str] = Field(default_factory=list)
    number: f.Format = f.optional("Format of the numbers on the bars; three figures by default.", "")
    colours: list[Hue] = Field(default=["grey", "sky", "orange", "blue", "vermilion", "green"], min_length=1)


class WordsTable(Table):
    """Words at a point of a picture."""

    x: Expression
    y: Expression
    text: str
    colour: Hue = "faint"
    across: Literal["left", "center", "right"] = "left"
    along: Literal["bottom", "center", "top"] = "center"


class AreaTable(Table):
    """Area between two values of y, from one x to another."""

    x: list[Expression] = Field(min_length=2, max_length=2)
    y: list[Expression] = Field(min_length=2, max_length=2)
    colour: Hue = "pale"
    label: str = ""


class PanelTable(Table):
    """A panel of a picture with two axes, drawn once for each interpretation ("reading") of the source."""

    title: str = ""
    once: bool = f.optional("Whether one drawing serves all readings.", False)
    x: AxisTable = AxisTable()
    y: AxisTable = AxisTable()
    areas: list[AreaTable] = Field(default_factory=list)
    curves: list[CurveTable] = Field(default_factory=list)
    bars: BarsTable | None = None
    words: list[WordsTable] = Field(default_factory=list)


class PictureTable(Table):
    """The picture of a study part; by default its title is that of the part."""

    title: str | None = None
    words: str = ""
    size: list[Inches] = Field(
        default=[7.2, 4.0], min_length=2, max_length=2, description="Width and height of a panel, in inches."
    )
    columns: Annotated[int, Field(ge=1, le=8)] = 1
    gap: Annotated[float, Field(ge=0.0, le=5.0)] = 0.7
    panels: list[PanelTable] = Field(min_length=1, max_length=24)
