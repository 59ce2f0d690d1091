"""[fidelity] of a problem file: explicit fidelity options, or the cheapest ones that are accurate enough."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from laufruhe.fidelity.automatic import DEFAULT_TOLERANCE
from laufruhe.fidelity.options import OPTIONS
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Table
from laufruhe.physics.fidelity import EXACT, ChoiceError
from laufruhe.problem.problem import Problem


def _with_options(table: type[f.TableModel]) -> type[f.TableModel]:
    keys: dict[str, Any] = {}
    for option in OPTIONS:
        if option.key not in table.model_fields:
            kind = Annotated[option.kind, f.Number(option.unit, above=0.0)] if option.unit else option.kind
            keys[option.key] = (kind | None, Field(default=None, **option.schema))
    return f.with_keys(table, keys)


@_with_options
class FidelityTable(Table):
    """Fidelity of the physics; exact by default."""

    closed: ClassVar[str] = "sets the accuracy of the computation, not the engine"

    kinematics: Literal["exact", "two-order", "auto"] = f.optional(
        "Motion of the pistons; auto is exact, and takes fewer samples for many designs.",
        "exact",
    )
    tolerance: f.Tolerance | None = f.optional("Relative error of the objective that auto may make.")

    def value_of(self, key: str) -> Any:
        """Return the value of a fidelity option."""
        return getattr(self, key)


def with_fidelity(problem: Problem, table: FidelityTable) -> Problem:
    """Return the problem at the model fidelity that the table [fidelity] states, or that is chosen automatically."""
    is_auto = table.kinematics == "auto"
    if table.tolerance is not None and not is_auto:
        rule, remedy = 'is for kinematics = "auto" only', 'add kinematics = "auto"'
        raise Refused("fidelity.tolerance", table.tolerance, rule, remedy)
    values: dict[str, Any] = {}
    for option in OPTIONS:
        value = getattr(table, option.key)
        if value is None or value == "auto":
            continue
        if is_auto and option.is_decided:
            raise Refused(
                f"fidelity.{option.key}", value, 'is chosen automatically if kinematics = "auto"', "leave it out"
            )
        refused = option.refusal(problem, value)
        if refused is not None:
            raise Refused(f"fidelity.{option.key}", value, *refused)
        values[option.key] = tuple(value) if isinstance(value, list) else value
    try:
        fidelity = replace(EXACT, **values)
    except ChoiceError as error:
        raise Refused(f"fidelity.{error.key}", getattr(table, error.key), error.rule, error.remedy) from None
    return problem.at(replace(fidelity, tolerance=(table.tolerance or DEFAULT_TOLERANCE) if is_auto else None))
