"""[[main_bearings]] of a problem file: where the shafts are carried."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.fields import Name, Table
from laufruhe.machine import CRANKSHAFT, Bearing, SliderCrank


class MainBearingTable(Table):
    """A main bearing."""

    x: f.Length
    name: Name | None = f.told("Its number from the front where left out.")
    shaft: str = CRANKSHAFT.name
    diameter: f.PositiveLength | None = f.told("Of the journal; needed for a pressure.")
    width: f.PositiveLength | None = Field(default=None, description="Of the journal; needed for a pressure.")


def bearings_of(tables: Sequence[MainBearingTable], parts: Sequence[SliderCrank]) -> tuple[Bearing, ...]:
    """Main bearings, on the shafts that slider-cranks work on, beside every throw and clear of each other."""
    shafts = {part.shaft.name: part.shaft for part in parts}
    found: list[Bearing] = []
    for k, table in enumerate(tables):
        where = f"main_bearings[{k + 1}]"
        if table.shaft not in shafts:
            raise Refused(f"{where}.shaft", table.shaft, "is no shaft with cranks", nearest(table.shaft, list(shafts)))
        bearing = Bearing(table.name or str(k + 1), table.x, table.diameter, table.width, shafts[table.shaft])
        for other in found:
            _check_apart(bearing, other, where)
        if any(part.shaft == bearing.shaft and part.x == bearing.x for part in parts):
            rule = "is the place of a crank pin"
            raise Refused(f"{where}.x", units.shown(bearing.x, "m"), rule, "move it beside the throw")
        found.append(bearing)
    for shaft in dict.fromkeys(bearing.shaft for bearing in found):
        own = [bearing for bearing in found if bearing.shaft == shaft]
        if len(own) < 2:
            rule = f"leaves {shaft.name} on one bearing, which does not carry its throws"
            raise Refused("main_bearings", None, rule, "give it two at least")
    return tuple(found)


def _check_apart(bearing: Bearing, other: Bearing, where: str) -> None:
    if bearing.name == other.name:
        raise Refused(f"{where}.name", bearing.name, "is the name of another bearing", "give each its own name")
    apart = abs(bearing.x - other.x)
    if bearing.shaft == other.shaft and apart <= 0.5 * ((bearing.width or 0.0) + (other.width or 0.0)):
        rule = f"lets its journal overlap that of bearing {other.name}"
        raise Refused(f"{where}.x", units.shown(bearing.x, "m"), rule, "move one of them, or make it narrower")
