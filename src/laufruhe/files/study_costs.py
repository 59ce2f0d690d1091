"""The study file's parts on what balancing costs: economics, tolerances, and free forces by layout."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from laufruhe.files import fields as f
from laufruhe.files.file_models import Name, Table
from laufruhe.files.study_parts import CaseTable, PartTable

PLAIN = "plain"
"""Name of the engine without any of the shafts."""

Judgement = Literal["negligible", "noticeable", "better", "worth building", "not worth building"]


class ClaimTable(Table):
    """What the source says of a set of shafts; it is confirmed or not."""

    says: Judgement | None = None
    falls_by: Annotated[float, Field(gt=0.0, lt=1.0)] | None = Field(
        default=None, description="Share by which the force is said to fall."
    )
    against: Name = Field(default=PLAIN, description="Build that it is compared with.")
    where: str = Field(default="", description="Figure or passage.")

    @model_validator(mode="after")
    def _says_something(self) -> ClaimTable:
        if self.says is None and self.falls_by is None:
            raise f.refusal("claims nothing; give says, falls_by, or both")
        return self


class BuildTable(Table):
    """One set of shafts."""

    name: Name
    case: Name | None = Field(default=None, description="Case that has them; the first where left out.")
    shafts: list[Name] = Field(
        default_factory=list, description="Balancer shafts that are built; none makes the plain engine of another case."
    )
    claim: ClaimTable | None = None

    @model_validator(mode="after")
    def _is_not_plain(self) -> BuildTable:
        if not self.shafts and self.case is None:
            raise f.refusal("has no shafts, so it is the plain engine, which is always there; name its shafts")
        if len(set(self.shafts)) < len(self.shafts):
            raise f.refusal("names a shaft twice; name each once")
        return self


class EconomicsTable(PartTable):
    """Least force against number and mass of shafts, beside the engine with one more cylinder at equal power."""

    kind: Literal["economics"]
    mass_limits: list[f.Mass] = Field(description="Masses allowed on the shafts, ascending.")
    builds: list[BuildTable] = Field(min_length=1)
    more_cylinders: list[CaseTable] = Field(
        min_length=1, description="Plain engines, rebuilt at equal power; the first decides what is worth building."
    )

    @field_validator("mass_limits")
    @classmethod
    def _ascend(cls, limits: list[float]) -> list[float]:
        if len(limits) < 2:
            raise f.refusal("is no front; give two masses or more")
        if any(b <= a for a, b in pairwise(limits)):
            raise f.refusal("must ascend; order the masses and name each once")
        return limits

    @model_validator(mode="after")
    def _names_fit(self) -> EconomicsTable:
        built = [PLAIN, *(build.name for build in self.builds)]
        names = [*built, *(case.name for case in self.more_cylinders)]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise f.refusal(f"has two engines called '{twice[0]}'; give each its own name ('{PLAIN}' is taken)")
        cases = [case.name for case in self.cases]
        for build in self.builds:
            if build.claim is not None and build.claim.against not in built:
                raise f.refusal(f"compares '{build.name}' with '{build.claim.against}'; use one of: {', '.join(built)}")
            if build.case is not None and build.case not in cases:
                raise f.refusal(f"builds '{build.name}' on case '{build.case}'; use one of: {', '.join(cases)}")
        for case in (*self.cases, *self.more_cylinders):
            if case.equal_power_to is not None:
                raise f.refusal(f"rebuilds '{case.name}' by itself; leave equal_power_to out of its cases")
        return self

    def settings(self) -> dict[str, Any]:
        """Of a front, the masses alone: names and claims change nothing in it."""
        return {"kind": self.kind, "mass_limits": self.mass_limits}


class TolerancesTable(Table):
    """How far a built engine may stand from its drawing."""

    reciprocating_mass: f.Mass = Field(default=0.0, description="Of each cylinder, either way.")
    unbalance: f.Unbalance = Field(default=0.0, description="Left on each balancing plane, at any angle.")
    planes: Annotated[int, Field(ge=1, le=48)] = 2
    alignment: f.NonNegativeLength = Field(default=0.0, description="Eccentricity of each aligned mass.")
    aligned_masses: list[f.Mass] = Field(
        default_factory=list, description="Flywheel, clutch and whatever else is centred on the crank."
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


class ToleranceTable(PartTable):
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


class LiteratureTable(Table):
    """Printed free forces and couples, over those of one cylinder."""

    force_1: f.NonNegative | None = None
    couple_1: f.NonNegative | None = None
    force_2: f.NonNegative | None = None
    couple_2: f.NonNegative | None = None


class FreeForcesCase(CaseTable):
    """One layout, and what tables print of it."""

    literature: LiteratureTable = LiteratureTable()


class FreeForcesTable(PartTable):
    """Free forces and couples of the first two orders by layout, beside the literature."""

    kind: Literal["free forces"]
    cases: list[FreeForcesCase] = Field(min_length=1)  # type: ignore[assignment]
    spacing: f.PositiveLength = Field(description="Unit of length of the couples: the distance of the throws.")
    digits: Annotated[int, Field(ge=0, le=12)] = Field(default=4, description="Printed after the point.")

    def settings(self) -> dict[str, Any]:
        """The unit of length alone: what is printed elsewhere changes nothing."""
        return {"kind": self.kind, "spacing": self.spacing}
