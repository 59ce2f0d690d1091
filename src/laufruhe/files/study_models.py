"""The study file, key by key: scenes, what of them is swept, and what is compared (docs/studies.md)."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from laufruhe.files.file_models import Table
from laufruhe.files.study_costs import EconomicsTable, FreeForcesTable, ToleranceTable
from laufruhe.files.study_parts import SweptPartTable


class CounterweightFractionTable(SweptPartTable):
    """A metric over the balance fraction, its proven optimum marked."""

    kind: Literal["counterweight fraction"]


class BalancerSizingTable(SweptPartTable):
    """Engines with and without each of their balancer shafts, each at its proven optimum."""

    kind: Literal["balancer sizing"]


class LayoutComparisonTable(SweptPartTable):
    """Engines side by side, of equal cylinders or of equal power."""

    kind: Literal["layout comparison"]


# a new kind is one more table here, and one more line in studies.kinds and in report.study_kinds
AnyPart: TypeAlias = Annotated[
    CounterweightFractionTable
    | BalancerSizingTable
    | LayoutComparisonTable
    | EconomicsTable
    | ToleranceTable
    | FreeForcesTable,
    Field(discriminator="kind"),
]


class StudyTable(Table):
    """What a study consists of."""

    figures: Literal["tractor"] | None = Field(
        default=None, description="Every figure of Hasselgruber's study, beside what it says."
    )
    parts: list[AnyPart] = Field(default_factory=list)


class StudyFile(Table):
    """A whole study file."""

    title: Annotated[str, Field(min_length=1)]
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    study: StudyTable
