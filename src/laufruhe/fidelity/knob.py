"""What a choice of fidelity has to say of itself, and how one is found that is enough (F1, F10)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from laufruhe.fidelity.error_bounds import Scale
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

PART_SHARE = 0.1
"""Share of the tolerance that one whole part may use."""


@dataclass(frozen=True)
class LeftOut:
    """A part of the physics that is not computed.

    Attributes
    ----------
    share
        Put back, it changes the objective by no more than this, relative.
    restored
        The choice with this part put back; None where nothing at all was lost.
    """

    what: str
    why: str
    share: float = 0.0
    restored: Fidelity | None = None


Rungs = list[tuple[str, Fidelity]]


class Knob:
    """A field of a fidelity.

    Attributes
    ----------
    key, kind, unit, schema
        In the [fidelity] table: its name, type, SI unit if it has one, and what a schema tells of it.
    is_decided
        Whether the automatic choice decides it, so that a file may not.
    """

    key: ClassVar[str]
    kind: ClassVar[Any]
    unit: ClassVar[str] = ""
    schema: ClassVar[Mapping[str, Any]] = {}
    is_decided: ClassVar[bool] = True

    def refused(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        """Why a problem cannot have this value, and the remedy; None where it can."""
        return None

    def chosen(self, scale: Scale, fidelity: Fidelity, room: float) -> Fidelity:
        """Return the fidelity with the cheapest sufficient value; `room` is the error allowed in total (F10)."""
        return fidelity

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        """Describe the kept physics in words."""
        return []

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[LeftOut]:
        """Return the omitted parts and their largest cost; parts that are exactly zero cost nothing."""
        return []

    def rungs(self, scale: Scale) -> Rungs:
        """Fidelities that a trade tries for its sake, by name."""
        return []

    def away(self, problem: Problem) -> Rungs:
        """The fidelity of a problem with a whole part of its loads taken away, by the name of the part."""
        return []


def first_sufficient(
    fidelity: Fidelity, key: str, values: Sequence[int | None], is_sufficient: Callable[[Fidelity], bool]
) -> Fidelity:
    """Return the fidelity with the first sufficient value; with the last one where no value suffices."""
    found = fidelity
    for value in values:
        changed: dict[str, Any] = {key: value}
        found = replace(fidelity, **changed)
        if is_sufficient(found):
            break
    return found


def part_left_out(scale: Scale, chosen: Fidelity, restored: Fidelity, what: str, why: str) -> LeftOut:
    """A part and what it changes of the objective itself; samples see that to within their own error."""
    both = scale.loses(chosen, scale.evaluation(restored))
    return LeftOut(what, why if both > 0.0 else "the objective does not count them", both, restored)
