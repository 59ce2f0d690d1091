"""What every part of a study file is made of: cases, swept values, and words about it."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from laufruhe.files.file_models import Name, QuantityName, Table

Value: TypeAlias = bool | int | float | str


class SweepTable(Table):
    """One quantity of the scene and the values that it takes: listed, or spaced between two ends."""

    quantity: str = Field(
        description="Path in the problem file: engine.rod_ratio, counterweights.web.balance_fraction."
    )
    values: list[Value] | None = None
    first: int | float | str | None = Field(default=None, alias="from")
    last: int | float | str | None = Field(default=None, alias="to")
    points: int | None = Field(default=None, description="Values from the first to the last.")
    spacing: Literal["linear", "log"] | None = None


class CaseTable(Table):
    """One scene: a problem file, and what is changed of it."""

    name: Name
    problem: str
    set: dict[str, Value] = Field(default_factory=dict, description="Paths of the problem file and their new values.")
    without: list[str] = Field(default_factory=list, description="Tables left out, as balancer_shafts or gas.")
    equal_power_to: Annotated[int, Field(ge=1, le=48)] | None = Field(
        default=None, description="Rebuilt to the power that this many of its cylinders have."
    )


class PartTable(Table):
    """What the parts of every kind have: one dataset of the study, its cases, and words about it."""

    name: Annotated[str, Field(pattern="^[a-z0-9][a-z0-9-]*$", max_length=60)]
    title: Annotated[str, Field(min_length=1)]
    source: str = ""
    cases: list[CaseTable] = Field(min_length=1)

    def settings(self) -> dict[str, Any]:
        """What is asked of every point: all but words, cases, and what is swept."""
        return self.model_dump(exclude={"name", "title", "source", "cases", "sweep"})


class SweptPartTable(PartTable):
    """Cases at every combination of the swept values."""

    metric: QuantityName | None = Field(default=None, description="In place of the objective of the problem files.")
    sweep: list[SweepTable] = Field(default_factory=list, max_length=2)
