"""[flywheel] of a problem file, and the decisions about it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from pydantic import Field

from laufruhe import units
from laufruhe.extensions.flywheel.machine import FLYWHEEL, Arms, Flywheel, Rim
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, require_one_of
from laufruhe.files.fields import Open, Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.problem.decision import Decision, NumberDrive
from laufruhe.problem.problem import Problem


class ArmsTable(Table):
    """Oval arms between hub and rim."""

    count: Annotated[int, Field(ge=2, le=24)]
    at_rim: f.Pair[f.PositiveLength] = f.required(
        "Width of an arm across the plane of rotation, and depth in it, at the rim."
    )
    at_hub: f.Pair[f.PositiveLength] = f.required("Width and depth of an arm at the hub.")
    hub_diameter: f.PositiveLength


class RimTable(Table):
    """A ring of a rectangular section."""

    mean_diameter: f.OpenPositiveLength
    width: f.OpenPositiveLength = f.required("Width along the shaft.")
    height: f.OpenPositiveLength = f.required("Height of the rim along a radius.")
    density: f.Density = f.optional("Density of the rim; by default that of cast iron.", 7250.0)
    whole: Annotated[float, f.Number("", minimum=1.0)] = f.optional(
        "Mass of the whole flywheel over that of its rim.", 1.0
    )
    arms: ArmsTable | None = None


class FlywheelTable(Table):
    """Parts that turn at crank speed, without pistons and rods."""

    inertia: f.OpenInertia | None = f.optional(
        "Moment of inertia of all that turns with the crank, big ends of rods included; in place of a rim."
    )
    mass: f.PositiveMass | None = f.optional("Mass of a ring with mean_diameter, in place of an inertia or a rim.")
    mean_diameter: f.PositiveLength | None = f.optional("Mean diameter of the ring with this mass.")
    rim: RimTable | None = None
    crankshaft_inertia: f.PositiveInertia | None = f.optional(
        "Moment of inertia of the crankshaft, big ends of rods and all else that turns, beside a mass or a rim."
    )


_SECTION = ("mean_diameter", "width", "height")


def _read(table: FlywheelTable | None, problem: Problem, context: ExtensionContext) -> Problem:
    """Return the problem with its flywheel and open numbers; without [flywheel], one with fidelity.crank_inertia."""
    crank_inertia = context.file.fidelity.crank_inertia
    if table is None:
        return problem if crank_inertia is None else _with_flywheel(problem, Flywheel(crank_inertia))
    table = _with_ring(table)
    require_one_of(table, "flywheel", "inertia", "rim", named="[flywheel.rim]")
    if table.rim is None:
        if table.crankshaft_inertia is not None:
            rule = "needs a rim, because without one the inertia includes all rotating parts"
            raise Refused("flywheel.crankshaft_inertia", None, rule, "leave it out")
        numbers = [("inertia", "kg m^2", Open.from_value(table.inertia))]
        wheel = Flywheel(numbers[0][2].start)
    else:
        numbers = [(key, "m", Open.from_value(getattr(table.rim, key))) for key in _SECTION]
        wheel = Flywheel(table.crankshaft_inertia or 0.0, _rim(table.rim))
    if crank_inertia is not None:
        rule, text = "is given by [flywheel] too", units.quantity_text(crank_inertia, "kg m^2")
        remedy = "keep one; fidelity.crank_inertia also makes the crank speed uneven"
        raise Refused("fidelity.crank_inertia", text, rule, remedy)
    decisions = (
        decision
        for key, unit, number in numbers
        for decision in number.decisions(f"flywheel.{key}", unit, NumberDrive(FLYWHEEL, key))
    )
    return _with_flywheel(problem, wheel, *decisions)


def _with_flywheel(problem: Problem, wheel: Flywheel, *decisions: Decision) -> Problem:
    return replace(problem, engine=problem.engine.with_extra(wheel), decisions=(*problem.decisions, *decisions))


def _with_ring(table: FlywheelTable) -> FlywheelTable:
    """Return the table with the inertia m D^2 / 4 of a ring in place of its mass and mean diameter (T5)."""
    if table.mass is None and table.mean_diameter is None:
        return table
    for key in ("mass", "mean_diameter"):
        if getattr(table, key) is None:
            raise Refused(f"flywheel.{key}", None, "is missing", "give mass and mean_diameter of a ring, or inertia")
    if table.inertia is not None or table.rim is not None:
        rule = f"is given beside {'rim' if table.inertia is None else 'inertia'}"
        raise Refused("flywheel.mass", None, rule, "keep one")
    ring = 0.25 * (table.mass or 0.0) * (table.mean_diameter or 0.0) ** 2
    return table.model_copy(update={"inertia": ring + (table.crankshaft_inertia or 0.0), "crankshaft_inertia": None})


def _rim(table: RimTable) -> Rim:
    """Return the rim with open numbers at their start; refuse bounds that leave no hole or no space for arms."""
    diameter, width, height = (Open.from_value(getattr(table, key)) for key in _SECTION)
    hole = diameter.lower - height.upper
    if hole <= 0.0:
        text, remedy = units.quantity_text(height.upper, "m"), "make it less than the diameter"
        raise Refused("flywheel.rim.height", text, "leaves no hole in the rim of the flywheel", remedy)
    arms = None
    if table.arms is not None:
        if table.arms.hub_diameter >= hole:
            text, rule = units.quantity_text(table.arms.hub_diameter, "m"), "does not fit into the rim"
            raise Refused("flywheel.rim.arms.hub_diameter", text, rule, "make it smaller")
        (rim_width, rim_depth), (hub_width, hub_depth) = table.arms.at_rim, table.arms.at_hub
        arms = Arms(table.arms.count, (rim_width, rim_depth), (hub_width, hub_depth), table.arms.hub_diameter)
    return Rim(diameter.start, width.start, height.start, table.density, table.whole, arms)


KEY = Key(
    "flywheel", FlywheelTable, _read, lambda table: [("flywheel", ("flywheel", "rim"))] if "rim" in table else (),
    always=True,
)  # fmt: skip
