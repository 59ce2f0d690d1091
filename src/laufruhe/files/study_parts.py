"""What the parts of a study file are made of: cases and swept values."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, Field

from laufruhe.files.fields import Name, Table, refusal


def _single(given: object) -> object:
    if given is not None and not isinstance(given, bool | int | float | str):
        raise refusal("is neither a number nor a text; write one of them")
    return given


Value: TypeAlias = Annotated[bool | int | float | str, BeforeValidator(_single)]
End: TypeAlias = Annotated[int | float | str | None, BeforeValidator(_single)]


class SweepTable(Table):
    """One quantity of the scene and the values that it takes: listed, or spaced between two ends."""

    quantity: str = Field(description="Path in the problem file: engine.rod_ratio, counterweights.web.balance_factor.")
    values: list[Value] | None = None
    first: End = Field(default=None, alias="from")
    last: End = Field(default=None, alias="to")
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
