"""Base class of knobs: a knob is one field of the fidelity that a file may set or the program chooses (F1, F10)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from laufruhe.fidelity.error_bounds import Scale
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

PART_SHARE = 0.1
"""Fraction of the tolerance that omitting one part may use."""


@dataclass(frozen=True)
class OmittedPart:
    """Part of the physics that is not computed.

    Attributes
    ----------
    what
        Name of the part.
    why
        Reason for the omission.
    share
        Upper bound of the relative change of the objective if the part is computed.
    restored
        Fidelity with this part; None if the part is exactly zero.
    """

    what: str
    why: str
    share: float = 0.0
    restored: Fidelity | None = None


Rungs = list[tuple[str, Fidelity]]


class Knob:
    """Field of the fidelity, with its rules for the automatic choice; defaults are those of a field without effect.

    Attributes
    ----------
    key, kind, unit, schema
        Key in table [fidelity], its type, SI unit (empty without one), and keyword arguments of its pydantic field.
    is_decided
        True if the automatic choice decides it; a file with the automatic choice then may not set it.
    """

    key: ClassVar[str]
    kind: ClassVar[Any]
    unit: ClassVar[str] = ""
    schema: ClassVar[Mapping[str, Any]] = {}
    is_decided: ClassVar[bool] = True

    def refusal(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        """Return (rule, remedy) if a problem cannot have this value; None if it can."""
        return None

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        """Return the fidelity with the cheapest sufficient value of this field (F10).

        Parameters
        ----------
        scale
            Reference of the design.
        fidelity
            Fidelity so far.
        allowed_error
            Allowed relative error of the objective from all fields together.
        """
        return fidelity

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        """Return descriptions of the physics that the fidelity computes in this field."""
        return []

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        """Return the parts that the fidelity omits in this field, with upper bounds of their effect."""
        return []

    def rungs(self, scale: Scale) -> Rungs:
        """Return the fidelities that a trade tries for this field: (name, fidelity)."""
        return []

    def without_part(self, problem: Problem) -> Rungs:
        """Return fidelities of a problem without one part of its loads: (name of the part, fidelity)."""
        return []


def first_sufficient(
    fidelity: Fidelity, key: str, values: Sequence[int | None], is_sufficient: Callable[[Fidelity], bool]
) -> Fidelity:
    """Return the fidelity with the first sufficient value of a field; with the last value if none is sufficient."""
    candidate = fidelity
    for value in values:
        changed: dict[str, Any] = {key: value}
        candidate = replace(fidelity, **changed)
        if is_sufficient(candidate):
            break
    return candidate


def omitted_part(scale: Scale, chosen: Fidelity, restored: Fidelity, what: str, why: str) -> OmittedPart:
    """Return an omitted part with the bound of its effect, from the chosen fidelity and the one with the part."""
    share = scale.relative_loss(chosen, scale.evaluation(restored))
    return OmittedPart(what, why if share > 0.0 else "the objective does not count them", share, restored)
