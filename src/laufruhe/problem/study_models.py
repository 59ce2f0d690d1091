"""The study file, key by key: scenes, what of them is swept, and what is compared."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from laufruhe.problem.file_models import Name, Table

Value = bool | int | float | str


class SweepTable(Table):
    """One quantity of the scene and the values that it takes."""

    quantity: str = Field(
        description="Path in the problem file: engine.rod_ratio, counterweights.web.balance_fraction."
    )
    values: list[Value]


class CaseTable(Table):
    """One scene: a problem file, and what is changed of it."""

    name: Name
    problem: str
    set: dict[str, Value] = Field(default_factory=dict, description="Paths of the problem file and their new values.")
    without: list[str] = Field(default_factory=list, description="Tables left out, as balancer_shafts or gas.")
    equal_power_to: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Forces scaled to the power of an engine of this many cylinders."
    )


class PartTable(Table):
    """One dataset of the study: cases, at every combination of the swept values."""

    name: Annotated[str, Field(pattern="^[a-z0-9][a-z0-9-]*$")]
    kind: Literal["counterweight fraction", "balancer sizing", "layout comparison"]
    title: str
    source: str = ""
    cases: list[CaseTable] = Field(min_length=1)
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)


class StudyTable(Table):
    """What a study consists of."""

    figures: Literal["tractor"] | None = Field(
        default=None, description="Every figure of Hasselgruber's study, beside what it says."
    )
    parts: list[PartTable] = Field(default_factory=list)


class StudyFile(Table):
    """A whole study file."""

    title: Annotated[str, Field(min_length=1)]
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    study: StudyTable
