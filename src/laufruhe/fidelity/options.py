"""Fidelity options that a problem file may set: keys of [fidelity], and the problems that may have them (F1, F10).

The schema and the reader of problem files use the list `OPTIONS` only. A new option needs a field of
`physics.fidelity.Fidelity`, physics that reads the field, and an entry here. If the automatic choice decides it, it
also needs a step in `fidelity.automatic`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from laufruhe.physics.fidelity import EXACT, CrankshaftModel, Kinematics, MountModel, RodModel
from laufruhe.problem.problem import Problem

Refusal = tuple[str, str] | None
"""Rule that a value breaks, and its remedy as text; None if a problem can have the value."""


@dataclass(frozen=True)
class Option:
    """Fidelity option: a field of the fidelity that a file may set.

    Attributes
    ----------
    key, kind, schema, unit
        Key in table [fidelity], its type, keyword arguments of its pydantic field, and SI unit (empty without one).
    is_decided
        True if the automatic choice decides it; a file with the automatic choice then may not set it.
    refusal
        Function of a problem and a value that returns the rule that the value breaks there, or None.
    """

    key: str
    kind: Any
    schema: Mapping[str, Any] = field(default_factory=dict)
    unit: str = ""
    is_decided: bool = True
    refusal: Callable[[Problem, Any], Refusal] = lambda *_: None


def has_gas(problem: Problem) -> bool:
    """Return True if an operating point has working gas."""
    return any(point.gas is not None for point in problem.points)


def _refuse_without_fixed_mounts(problem: Problem, value: Any) -> Refusal:
    if value == EXACT.mounts:
        return None
    if problem.engine.block is None:
        return "needs elastic mounts", 'leave it out, or add mounts of kind "elastic"'
    if problem.mount_decisions:
        return "cannot be set while mounts are open", "leave it out, or fix the mounts"
    return None


_STEPS = {"ge": 48, "le": 100_000}

OPTIONS = (
    Option("kinematics", Kinematics, is_decided=False),
    Option("rod", RodModel),
    Option("gas", bool, {"description": "false leaves the working gas out."}),
    Option("gas_samples", int, {"description": "Steps of the gas torque over the working cycle.", **_STEPS}),
    # set by hand only: the automatic choice limits the orders of all loads
    Option("gas_orders", int, {"description": "Last order kept of the gas alone.", "ge": 1},
           refusal=lambda p, _: None if has_gas(p) else ("needs working gas", "leave it out, or add [gas]")),
    Option("orders", int, {"description": "Last order kept of pistons, rods and gas.", "ge": 1}),
    Option("crank_inertia", float,
           {"description": "Inertia of all that turns with the crank; its speed varies within the cycle."},
           unit="kg m^2", is_decided=False),
    # set by hand only: real crankshafts lie between the two models
    Option("crankshaft", CrankshaftModel,
           {"description": "How main bearings share its loads: cut in its journals, or a continuous beam."},
           is_decided=False, refusal=lambda p, _: None if p.engine.bearings else (
               "needs main bearings", "leave it out, or list them")),
    Option("mounts", MountModel,
           {"description": "Elastic mounts order by order, as if they gave no way, or integrated in time."},
           refusal=_refuse_without_fixed_mounts),
    Option("modes", list[int], {"description": "Natural modes that answer, 1 the lowest."},
           refusal=_refuse_without_fixed_mounts),
    Option("samples", int, {"description": "Steps over the working cycle.", **_STEPS}),
)  # fmt: skip
