"""[[main_bearings]] of a problem file, and the bearings that they make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from laufruhe import units
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.fields import Name, Open, Table
from laufruhe.files.nested import Place
from laufruhe.files.problem_file import ExtensionContext, Key, ProblemFile
from laufruhe.machine import CRANKSHAFT, Shaft, SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.problem.problem import Problem


class MainBearingTable(Table):
    """Main bearing, or one bearing between each pair of neighbouring throws."""

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


def _expanded(tables: Sequence[MainBearingTable], throws: Sequence[Throw]) -> list[MainBearingTable]:
    """Return a table for each bearing; `beside_throws` makes bearings between and beyond the throws of a shaft."""
    single: list[MainBearingTable] = []
    for k, table in enumerate(tables, 1):
        where, beyond = f"main_bearings[{k}]", table.beside_throws
        if (beyond is None) == (table.x is None):
            rule = "is missing" if beyond is None else "is given twice, also by beside_throws"
            remedy = "leave one out" if beyond else 'give a place such as "-62.5 mm", or beside_throws'
            raise Refused(f"{where}.x", None, rule, remedy)
        if beyond is None:
            single.append(table)
            continue
        if table.name is not None:
            raise Refused(f"{where}.name", table.name, "would be the name of several bearings", "leave it out")
        for key in ("diameter", "width"):
            if isinstance(getattr(table, key), Open):
                rule = "is open, but stands for several bearings"
                raise Refused(f"{where}.{key}", None, rule, "list the bearings one by one, each with its x")
        pins = sorted({throw.x for throw in throws if throw.shaft.name == table.shaft}, reverse=True)
        if not pins:
            raise Refused(f"{where}.shaft", table.shaft, "has no throws", "name a shaft with cranks")
        places = [pins[0] + beyond, *(0.5 * (a + b) for a, b in pairwise(pins)), pins[-1] - beyond]
        single += [table.model_copy(update={"x": x, "beside_throws": None}) for x in places]
    return single


def bearings_in(
    file: ProblemFile, throws: Sequence[Throw], parts: Sequence[SliderCrank]
) -> list[tuple[MainBearingTable, Bearing]]:
    """Return the main bearings of a file, each with its table.

    Raise `Refused` for shafts without cranks, overlapping journals, and throws without support.
    """
    tables = _expanded(getattr(file, "main_bearings", None) or (), throws)
    shafts = {part.shaft.name: part.shaft for part in parts}
    bearings: list[Bearing] = []
    for k, table in enumerate(tables, 1):
        where = f"main_bearings[{k}]"
        if table.shaft not in shafts:
            raise Refused(f"{where}.shaft", table.shaft, "is no shaft with cranks", nearest(table.shaft, list(shafts)))
        if table.friction is not None and table.diameter is None:
            rule = "needs the diameter of the journal, which is missing"
            raise Refused(f"{where}.friction", table.friction, rule, "add diameter")
        name = table.name or str(k)
        size = [None if value is None else Open.from_value(value).start for value in (table.diameter, table.width)]
        bearing = Bearing(name, table.x or 0.0, size[0], size[1], table.friction, shafts[table.shaft])
        for placed in bearings:
            if name == placed.name:
                raise Refused(f"{where}.name", name, "is already the name of another bearing", "give each its own name")
            reach = 0.5 * ((bearing.width or 0.0) + (placed.width or 0.0))
            if bearing.shaft == placed.shaft and abs(bearing.x - placed.x) <= reach:
                text, remedy = units.quantity_text(bearing.x, "m"), "move one of them, or make it narrower"
                raise Refused(f"{where}.x", text, f"lets its journal overlap that of bearing {placed.name}", remedy)
        if any(part.shaft == bearing.shaft and part.x == bearing.x for part in parts):
            rule = "is the place of a crank pin"
            raise Refused(f"{where}.x", units.quantity_text(bearing.x, "m"), rule, "move it beside the throw")
        bearings.append(bearing)
    for shaft in shafts.values() if bearings else ():
        _check_carried(shaft, [b.x for b in bearings if b.shaft == shaft], [p for p in parts if p.shaft == shaft])
    return list(zip(tables, bearings, strict=True))


def _check_carried(shaft: Shaft, bearings: Sequence[float], parts: Sequence[SliderCrank]) -> None:
    # throws must lie between bearings, except a single overhung throw and the two end cranks of an axle
    if len(bearings) < 2:
        rule = f"leaves {shaft.name} on {['no', 'one'][len(bearings)]} bearing, which does not carry its throws"
        raise Refused("main_bearings", None, rule, "give the shaft at least two bearings")
    places, first, last = sorted({part.x for part in parts}), min(bearings), max(bearings)
    is_axle = len(bearings) == len(places) == 2 and places[0] < first and last < places[1]
    for part in parts if len(places) > 1 and not is_axle else ():
        if not first < part.x < last:
            place = units.quantity_text(part.x, "m")
            rule = f"leaves the throw of {part.name} at x = {place} on one side of all bearings"
            raise Refused("main_bearings", None, rule, "put a bearing on its other side")


def _read(_: object, problem: Problem, context: ExtensionContext) -> Problem:
    bearings = tuple(bearing for _, bearing in bearings_in(context.file, context.throws, problem.engine.slider_cranks))
    return replace(problem, engine=problem.engine.with_extra(MainBearings(bearings)))


def _names(tables: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Place]]:
    for k, table in enumerate(tables):
        yield table.get("name", str(k + 1)), ("main_bearings", k)


KEY = Key("main_bearings", list[MainBearingTable], _read, _names)
