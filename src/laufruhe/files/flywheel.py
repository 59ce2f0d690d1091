"""[flywheel] of a problem file: its table, the flywheel it makes, and what of it is decided."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, one_of
from laufruhe.files.fields import Open, Table
from laufruhe.machine import Arms, Flywheel, Rim
from laufruhe.problem.decision import Decision, Kind, NumberDrive


class ArmsTable(Table):
    """Oval arms between hub and rim."""

    count: Annotated[int, Field(ge=2, le=24)]
    at_rim: f.Pair[f.PositiveLength] = f.needed(
        "Width of an arm across the plane of rotation, and depth in it, at the rim."
    )
    at_hub: f.Pair[f.PositiveLength] = f.needed("Width and depth of an arm at the hub.")
    hub_diameter: f.PositiveLength


class RimTable(Table):
    """A ring of a rectangular section."""

    mean_diameter: f.OpenPositiveLength
    width: f.OpenPositiveLength = f.needed("Width along the shaft.")
    height: f.OpenPositiveLength = f.needed("Height of the rim along a radius.")
    density: f.Density = f.told("Density of the rim; by default that of cast iron.", 7250.0)
    whole: Annotated[float, f.Number("", least=1.0)] = f.told("Mass of the whole flywheel over that of its rim.", 1.0)
    arms: ArmsTable | None = None


class FlywheelTable(Table):
    """Everything that turns at crank speed, except pistons and rods."""

    inertia: f.OpenInertia | None = f.told("Moment of inertia of the whole flywheel, in place of a rim.")
    rim: RimTable | None = None
    crankshaft_inertia: f.PositiveInertia | None = f.told(
        "Moment of inertia of the crankshaft and all else that turns, beside a rim."
    )


_SECTION = ("mean_diameter", "width", "height")


def flywheel_of(table: FlywheelTable | None, crank_inertia: float | None) -> tuple[Flywheel | None, list[Decision]]:
    """The flywheel, or what [fidelity] says of its inertia, and the decisions about it."""
    if table is None:
        return None if crank_inertia is None else Flywheel(crank_inertia), []
    one_of(table, "flywheel", "inertia", "rim", named="[flywheel.rim]")
    if table.rim is None:
        if table.crankshaft_inertia is not None:
            rule = "needs a rim; inertia is that of all that turns"
            raise Refused("flywheel.crankshaft_inertia", None, rule, "leave it out")
        numbers = {"inertia": ("kg m^2", Open.of(table.inertia))}
        wheel = Flywheel(numbers["inertia"][1].start)
        decisions = _decided(numbers, 0)
    else:
        section = {key: ("m", Open.of(getattr(table.rim, key))) for key in _SECTION}
        wheel = Flywheel(table.crankshaft_inertia or 0.0, _rim(table.rim))
        decisions = _decided(section, 1)
    if crank_inertia is not None:
        rule, told = "is given by [flywheel] too", units.shown(crank_inertia, "kg m^2")
        raise Refused("fidelity.crank_inertia", told, rule, "keep one: with this one loads feel the uneven speed")
    return wheel, decisions


def _decided(numbers: dict[str, tuple[str, Open]], first: int) -> list[Decision]:
    return [
        decision
        for k, (key, (unit, given)) in enumerate(numbers.items(), first)
        for decision in given.decisions(f"flywheel.{key}", unit, NumberDrive(Kind.FLYWHEEL, k))
    ]


def _rim(table: RimTable) -> Rim:
    """The rim at the start of what is open; every section allowed leaves a hole and room for arms."""
    diameter, width, height = (Open.of(getattr(table, key)) for key in _SECTION)
    hole = diameter.lower - height.upper
    if hole <= 0.0:
        rule = "leaves no hole in the rim"
        raise Refused("flywheel.rim.height", units.shown(height.upper, "m"), rule, "make it less than the diameter")
    arms = None
    if table.arms is not None:
        if table.arms.hub_diameter >= hole:
            shown, rule = units.shown(table.arms.hub_diameter, "m"), "does not fit into the rim"
            raise Refused("flywheel.rim.arms.hub_diameter", shown, rule, "make it smaller")
        own = table.arms
        arms = Arms(own.count, (own.at_rim[0], own.at_rim[1]), (own.at_hub[0], own.at_hub[1]), own.hub_diameter)
    return Rim(diameter.start, width.start, height.start, table.density, table.whole, arms)
