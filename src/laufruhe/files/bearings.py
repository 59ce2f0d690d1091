"""[[main_bearings]] of a problem file, and the bearings that they make."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.fields import Name, Open, Table
from laufruhe.machine import CRANKSHAFT, Bearing, Shaft, SliderCrank
from laufruhe.machine.layouts import Throw


class MainBearingTable(Table):
    """A main bearing."""

    x: f.Length | None = f.optional("Place along the shaft.")
    beside_throws: f.PositiveLength | None = f.optional(
        "In place of x, a bearing in the middle between neighbouring throws, and one so far beyond either end."
    )
    name: Name | None = f.optional("Name of the bearing; by default its number from the front.")
    shaft: str = CRANKSHAFT.name
    diameter: f.OpenPositiveLength | None = f.optional(
        "Diameter of the journal; needed for a pressure and for friction power."
    )
    width: f.OpenPositiveLength | None = f.optional("Width of the journal; needed for a pressure.")
    friction: f.NonNegative | None = f.optional("Coefficient of friction; needed for friction power.")


def one_by_one(tables: Sequence[MainBearingTable], throws: Sequence[Throw]) -> list[MainBearingTable]:
    """Return a table for every bearing, those beside throws in order from the front."""
    single: list[MainBearingTable] = []
    for k, table in enumerate(tables, 1):
        where, beyond = f"main_bearings[{k}]", table.beside_throws
        if (beyond is None) == (table.x is None):
            rule = "is missing; give a place, or beside_throws" if beyond is None else "is told beside beside_throws"
            raise Refused(f"{where}.x", None, rule, "leave one out" if beyond else '"-62.5 mm", for example')
        if beyond is None:
            single.append(table)
            continue
        if table.name is not None:
            raise Refused(f"{where}.name", table.name, "names several bearings", "leave it out")
        for key in ("diameter", "width"):
            if isinstance(getattr(table, key), Open):
                raise Refused(f"{where}.{key}", None, "is open for several bearings", "list them one by one, by x")
        pins = sorted({throw.x for throw in throws if throw.shaft.name == table.shaft}, reverse=True)
        if not pins:
            raise Refused(f"{where}.shaft", table.shaft, "has no throws", "name a shaft with cranks")
        places = [pins[0] + beyond, *(0.5 * (a + b) for a, b in pairwise(pins)), pins[-1] - beyond]
        single += [table.model_copy(update={"x": x, "beside_throws": None}) for x in places]
    return single


def bearings_of(tables: Sequence[MainBearingTable], parts: Sequence[SliderCrank]) -> tuple[Bearing, ...]:
    """Return the main bearings, on shafts with slider-cranks, beside every throw and clear of each other."""
    shafts = {part.shaft.name: part.shaft for part in parts}
    bearings: list[Bearing] = []
    for k, table in enumerate(tables, 1):
        where = f"main_bearings[{k}]"
        if table.shaft not in shafts:
            raise Refused(f"{where}.shaft", table.shaft, "is no shaft with cranks", nearest(table.shaft, list(shafts)))
        if table.friction is not None and table.diameter is None:
            rule = "rubs on a journal whose diameter is missing"
            raise Refused(f"{where}.friction", table.friction, rule, "add diameter")
        name = table.name or str(k)
        size = [None if each is None else Open.from_value(each).start for each in (table.diameter, table.width)]
        bearing = Bearing(name, table.x or 0.0, size[0], size[1], table.friction, shafts[table.shaft])
        for other in bearings:
            if name == other.name:
                raise Refused(f"{where}.name", name, "is the name of another bearing", "give each its own name")
            reach = 0.5 * ((bearing.width or 0.0) + (other.width or 0.0))
            if bearing.shaft == other.shaft and abs(bearing.x - other.x) <= reach:
                rule = f"lets its journal overlap that of bearing {other.name}"
                raise Refused(
                    f"{where}.x", units.quantity_text(bearing.x, "m"), rule, "move one of them, or make it narrower"
                )
        if any(part.shaft == bearing.shaft and part.x == bearing.x for part in parts):
            rule = "is the place of a crank pin"
            raise Refused(f"{where}.x", units.quantity_text(bearing.x, "m"), rule, "move it beside the throw")
        bearings.append(bearing)
    for shaft in shafts.values() if bearings else ():
        _check_carried(shaft, [b.x for b in bearings if b.shaft == shaft], [p for p in parts if p.shaft == shaft])
    return tuple(bearings)


def _check_carried(shaft: Shaft, bearings: Sequence[float], parts: Sequence[SliderCrank]) -> None:
    # throws lie between two bearings; a single one may hang over, and one at each end of an axle
    if len(bearings) < 2:
        rule = f"leaves {shaft.name} on {['no', 'one'][len(bearings)]} bearing, which does not carry its throws"
        raise Refused("main_bearings", None, rule, "give it two at least")
    places, first, last = sorted({part.x for part in parts}), min(bearings), max(bearings)
    is_axle = len(bearings) == len(places) == 2 and places[0] < first and last < places[1]
    for part in parts if len(places) > 1 and not is_axle else ():
        if not first < part.x < last:
            rule = f"leaves the throw of {part.name} at x = {units.quantity_text(part.x, 'm')} beside all bearings"
            raise Refused("main_bearings", None, rule, "put one on its other side")
