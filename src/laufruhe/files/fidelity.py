"""[fidelity] of a problem file: options of the physics, or "auto" (F1, F11)."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Table
from laufruhe.physics.fidelity import EXACT, ChoiceError, CrankshaftModel, MountModel, RodModel
from laufruhe.problem.problem import Problem

DEFAULT_TOLERANCE = 1e-3
_BY_HAND = ("crank_inertia", "crankshaft")
"""Keys that the automatic choice does not set."""
Steps = Annotated[int, Field(ge=48, le=100_000)]
LastOrder = Annotated[int, Field(ge=1)]


class FidelityTable(Table):
    """Fidelity of the physics; exact by default."""

    closed: ClassVar[str] = "sets the accuracy of the computation, not the engine"

    kinematics: Literal["exact", "two-order", "auto"] = f.optional(
        "Motion of the pistons; auto is exact, and takes fewer samples for many designs.",
        "exact",
    )
    tolerance: f.Tolerance | None = f.optional(
        f"Relative error of the objective that auto may make; {DEFAULT_TOLERANCE} by default."
    )
    rod: RodModel | None = None
    gas: bool | None = f.optional("false leaves the working gas out.")
    gas_samples: Steps | None = f.optional("Steps of the gas torque over the working cycle.")
    gas_orders: LastOrder | None = f.optional("Last order kept of the gas alone.")
    orders: LastOrder | None = f.optional("Last order kept of pistons, rods and gas.")
    crank_inertia: Annotated[float, f.Number("kg m^2", above=0.0)] | None = f.optional(
        "Inertia of all that turns with the crank; its speed varies within the cycle."
    )
    crankshaft: CrankshaftModel | None = f.optional(
        "How main bearings share its loads: cut in its journals, or a continuous beam."
    )
    mounts: MountModel | None = f.optional(
        "Elastic mounts order by order, as if they gave no way, or integrated in time."
    )
    modes: list[int] | None = f.optional("Natural modes that answer, 1 the lowest.")
    samples: Steps | None = f.optional("Steps over the working cycle.")


def with_fidelity(problem: Problem, table: FidelityTable) -> Problem:
    """Return the problem at the model fidelity that the table [fidelity] states."""
    is_auto = table.kinematics == "auto"
    options = table.model_dump(exclude_none=True, exclude={"tolerance", *(["kinematics"] if is_auto else [])})
    if table.tolerance is not None and not is_auto:
        rule, remedy = 'is for kinematics = "auto" only', 'add kinematics = "auto"'
        raise Refused("fidelity.tolerance", table.tolerance, rule, remedy)
    for key, value in options.items():
        if is_auto and key not in _BY_HAND:
            rule = 'is chosen automatically if kinematics = "auto"'
            raise Refused(f"fidelity.{key}", value, rule, "leave it out")
        if refusal := _refusal(problem, key, value):
            raise Refused(f"fidelity.{key}", value, *refusal)
    if "modes" in options:
        options["modes"] = tuple(options["modes"])
    try:
        fidelity = replace(EXACT, **options)
    except ChoiceError as error:
        raise Refused(f"fidelity.{error.key}", getattr(table, error.key), error.rule, error.remedy) from None
    return problem.at(replace(fidelity, tolerance=(table.tolerance or DEFAULT_TOLERANCE) if is_auto else None))


def _refusal(problem: Problem, key: str, value: Any) -> tuple[str, str] | None:
    """Return the rule that an option breaks in this problem, and the remedy; None if the problem can have it."""
    engine = problem.engine
    if key == "gas_orders" and all(point.gas is None for point in problem.points):
        return "needs working gas", "leave it out, or add [gas]"
    if key == "crankshaft" and not engine.supports:
        return "needs main bearings", "leave it out, or list them"
    if key not in ("mounts", "modes") or value == EXACT.mounts:
        return None
    if engine.block is None:
        return "needs elastic mounts", 'leave it out, or add mounts of kind "elastic"'
    if problem.mount_decisions:
        return "cannot be set while mounts are open", "leave it out, or fix the mounts"
    return None
