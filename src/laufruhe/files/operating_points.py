"""Operating points of a problem file: their table, and the speeds and loads that it makes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, all_different, one_of
from laufruhe.files.fields import Name, Table
from laufruhe.files.friction import Brake
from laufruhe.machine import Cycle, GasModel, OperatingPoint, Seiliger, Wiebe
from laufruhe.physics.seiliger_cycle import motored_cycle

MOST_POINTS = 200
"""Of one problem, which weighs them all at once: 14 MB and a fifth of a second each where four mounts are asked."""


class OperatingPointTable(Table):
    """A speed and a load."""

    name: Name | None = None
    speed: f.Speed | None = None
    mean_piston_speed: f.PistonSpeed | None = None
    imep: f.Pressure | None = f.told("Indicated mean effective pressure at this point, in place of that of [gas].")
    bmep: f.PositivePressure | None = f.told(
        "Brake mean effective pressure; [friction] adds what friction takes, and its uncertainty."
    )
    brake_torque: f.PositiveTorque | None = f.told("Torque at the brake, in place of bmep.")
    motored: bool = f.told("The charge is compressed without combustion.", False)
    gas: bool = f.told("false: no gas at this point.", True)
    up_to: f.Speed | None = f.told("Highest speed of a range that starts at speed.")
    steps: Annotated[int, Field(ge=2, le=1000)] | None = f.told("Number of speeds in the range.")
    weight: f.Positive = 1.0


def operating_points(
    tables: Sequence[OperatingPointTable],
    gas: GasModel | None,
    cycle: Cycle,
    stroke: float | None,
    brake: Brake | None,
) -> tuple[OperatingPoint, ...]:
    """Speeds and loads of an engine whose gas, where a point says no other, is this."""
    points = []
    for k, table in enumerate(tables):
        where = f"operating_points[{k + 1}]"
        speeds = _speeds(table, stroke, where)
        for speed in speeds:
            at = units.shown(speed, "rad/s", 6)
            name = (f"{table.name} {at}" if len(speeds) > 1 else table.name) if table.name else at
            loads = _loads(table, speed, brake, where, name)
            for said, imep in loads:
                load = _loaded(gas, table.model_copy(update={"imep": imep}), cycle, where)
                share = table.weight / len(speeds) / len(loads)
                points.append(OperatingPoint(f"{name}{said}", speed, load, share))
    if len(points) > MOST_POINTS:
        rule = f"makes {len(points)} operating points, more than {MOST_POINTS}"
        raise Refused("operating_points", None, rule, "take wider steps, or sweep the speed in a study")
    all_different([p.name for p in points], "operating_points", "operating points have one name")
    return tuple(points)


def _speeds(table: OperatingPointTable, stroke: float | None, where: str) -> tuple[float, ...]:
    """One speed, or equal steps over a range that share the weight."""
    one_of(table, where, "speed", "mean_piston_speed")
    if table.speed is None and stroke is None:
        raise Refused(f"{where}.mean_piston_speed", None, "means nothing without pistons", "give the speed")
    # c_m = 2 s n (Roetscher eq. 290)
    first = math.pi * (table.mean_piston_speed or 0.0) / (stroke or 1.0) if table.speed is None else table.speed
    if table.up_to is None and table.steps is None:
        return (first,)
    if table.up_to is None or table.steps is None:
        missing = "up_to" if table.up_to is None else "steps"
        raise Refused(f"{where}.{missing}", None, "is missing", "give up_to and steps for a range, or neither")
    if table.up_to <= first:
        value = units.shown(table.up_to, "rad/s")
        raise Refused(f"{where}.up_to", value, "does not lie above the first speed", "give a higher one")
    return tuple(first + (table.up_to - first) * k / (table.steps - 1) for k in range(table.steps))


def _loads(
    table: OperatingPointTable, speed: float, brake: Brake | None, where: str, name: str
) -> list[tuple[str, float | None]]:  # fmt: skip
    """What the load adds to the name, and the indicated mean pressure: of one at the brake as friction may be."""
    given = [key for key in ("imep", "bmep", "brake_torque") if getattr(table, key) is not None]
    if len(given) > 1 or (table.motored and given[1:]):
        raise Refused(f"{where}.{given[0]}", None, f"is given beside {given[1]}", "keep one")
    if table.bmep is None and table.brake_torque is None:
        return [("", table.imep)]
    if brake is None:
        raise Refused(f"{where}.{given[0]}", None, "needs [friction]", "say what is lost between gas and brake")
    if table.motored or not table.gas:
        raise Refused(f"{where}.{given[0]}", None, "is for engines that burn fuel", "leave it out")
    bmep = table.bmep if table.bmep is not None else brake.pressure(table.brake_torque or 0.0)
    least, middle, largest = brake.indicated(bmep, speed, name)
    if least == largest:
        return [("", middle)]
    return [(", least load", least), (", mean load", middle), (", most load", largest)]


def _loaded(gas: GasModel | None, table: OperatingPointTable, cycle: Cycle, where: str) -> GasModel | None:
    if table.motored and table.imep is not None:
        rule = "is given to a motored engine, which burns nothing"
        raise Refused(f"{where}.imep", None, rule, "leave imep or motored out")
    if not table.gas:
        return None
    if not table.motored and table.imep is None:
        return gas
    if not isinstance(gas, Seiliger | Wiebe):
        key = "motored" if table.motored else "imep"
        raise Refused(f"{where}.{key}", None, "needs [gas] with model seiliger or wiebe", "give that, or leave it out")
    return motored_cycle(gas, cycle) if table.imep is None else replace(gas, imep=table.imep)
