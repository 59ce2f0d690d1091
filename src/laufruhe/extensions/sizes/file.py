"""[running_gear] of a problem file: sizes of webs, rods, piston pins and bolts, and decisions about sizes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from laufruhe import units
from laufruhe.extensions.bearing_loads.file import MainBearingTable, bearings_in
from laufruhe.extensions.bearing_loads.machine import Bearing
from laufruhe.extensions.sizes.machine import (
    BIG_END,
    ROD_LENGTH,
    STEEL,
    Bolts,
    MovingGear,
    PistonPin,
    RunningGear,
    Shank,
    Size,
    Webs,
    on,
)
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key
from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Open, Table
from laufruhe.files.problem_file import ExtensionContext, Key, ProblemFile
from laufruhe.files.rotors import check_factors
from laufruhe.machine import CRANKSHAFT, SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.problem.decision import Decision, Kind, NumberDrive
from laufruhe.problem.problem import Problem


class WebsTable(Table):
    """The two webs adjacent to every pin."""

    width: f.OpenPositiveLength = f.required("Width of a web across the shaft.")
    thickness: f.OpenPositiveLength = f.required("Width along the shaft.")


class ShankTable(Table):
    """The round shank of every rod."""

    diameter: f.OpenPositiveLength
    bore: f.NonNegativeLength = 0.0


class PistonPinTable(Table):
    """The pin of every piston."""

    diameter: f.OpenPositiveLength
    bore: f.OpenNonNegativeLength = 0.0
    length: f.OpenPositiveLength
    in_bosses: Annotated[float, f.Number("", above=0.0, maximum=0.95)] = f.optional(
        "Share of the length of the pin that the bosses hold.", 0.5
    )
    span: f.PositiveLength | None = f.optional(
        "Distance between the middles of the bosses; by default it follows from in_bosses."
    )


class BoltsTable(Table):
    """The bolts of every big end."""

    count: Annotated[int, Field(ge=1, le=12)] = 2
    diameter: f.OpenPositiveLength = f.required("Diameter of a bolt at the root of the thread.")


class RunningGearTable(Table):
    """Sizes of webs, rods, bolts and piston pins, from which their stresses follow."""

    density: f.Density | None = f.optional(
        "Density of the parts; their masses and those of the crank pins are then added to those of [engine]."
    )
    elastic_modulus: f.PositivePressure = STEEL
    webs: WebsTable | None = None
    rod: ShankTable | None = None
    piston_pin: PistonPinTable | None = None
    bolts: BoltsTable | None = None


def _with_gear_masses(
    table: RunningGearTable, parts: tuple[SliderCrank, ...], throws: tuple[Throw, ...], file: ProblemFile
) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    # Z2: slider-cranks and throws with the masses of the initial sizes
    bearings = tuple(bearing for _, bearing in bearings_in(file, throws, parts))
    other_throws = tuple(throw for throw in throws if throw.shaft != CRANKSHAFT)
    throws = tuple(throw for throw in throws if throw.shaft == CRANKSHAFT)
    gear = _gear_of(table, parts, throws)
    moving = MovingGear(gear, parts, (), bearings)
    directions, size = dict(gear.throws).values(), moving.throw_unbalance
    crank_throws = tuple(
        replace(t, unbalance=t.unbalance + size * direction) for t, direction in zip(throws, directions, strict=True)
    )
    return moving.with_gear_masses().parts, (*crank_throws, *other_throws)


def _gear_of(table: RunningGearTable, parts: Sequence[SliderCrank], throws: Sequence[Throw]) -> RunningGear:
    if table.density is not None and any(type(p) is not SliderCrank or p.shaft != CRANKSHAFT for p in parts):
        rule = "needs plain slider-cranks on one crankshaft"
        density = units.quantity_text(table.density, "kg/m^3")
        raise Refused("running_gear.density", density, rule, "give the masses in [engine] in place of a density")
    if any(part.master_bank is not None for part in parts):
        rule = "needs rods on the crank pin, and these are hinged to a master rod"
        raise Refused("running_gear", None, rule, "leave it out")
    with errors_at_key("running_gear"):
        return RunningGear(
            table.elastic_modulus,
            table.density,
            None if table.webs is None else Webs(_start(table.webs.width), _start(table.webs.thickness)),
            None if table.rod is None else Shank(_start(table.rod.diameter), table.rod.bore),
            None if table.piston_pin is None else _piston_pin(table.piston_pin),
            None if table.bolts is None else Bolts(table.bolts.count, _start(table.bolts.diameter)),
            tuple((f"throw {k + 1}", cis(as_turn(throw.angle))) for k, throw in enumerate(throws)),
        )


def _start(value: float | Open) -> float:
    return Open.from_value(value).start


def _piston_pin(table: PistonPinTable) -> PistonPin:
    bore, diameter = Open.from_value(table.bore), Open.from_value(table.diameter)
    if bore.upper >= diameter.lower:
        rule = f"does not fit into a pin of {units.quantity_text(diameter.lower, 'm')}"
        raise Refused("running_gear.piston_pin.bore", units.quantity_text(bore.upper, "m"), rule, "make it smaller")
    return PistonPin(diameter.start, bore.start, _start(table.length), table.in_bosses, table.span)


def _sizes_in_file(
    table: RunningGearTable | None, engine: EngineTable, bearings: Sequence[tuple[MainBearingTable, Bearing]]
) -> Iterator[tuple[str, Size, Any]]:
    """Yield the name, the key and the file's value of each size that may be open."""
    yield "engine.rod_length", ROD_LENGTH, engine.rod_length
    for key in ("diameter", "width"):
        if engine.big_end is not None:
            yield f"engine.big_end.{key}", (BIG_END, key), getattr(engine.big_end, key)
        for row, bearing in bearings:
            yield f"{bearing.name}.{key}", (on(bearing), key), getattr(row, key)
    for name in ("webs", "rod", "piston_pin", "bolts") if table else ():
        part = getattr(table, name)
        for key in type(part).model_fields if part is not None else ():
            yield f"running_gear.{name}.{key}", (name, key), getattr(part, key)


def _read(table: RunningGearTable | None, problem: Problem, context: ExtensionContext) -> Problem:
    engine, throws = problem.engine, [throw for throw in context.throws if throw.shaft == CRANKSHAFT]
    bearings = bearings_in(context.file, context.throws, engine.slider_cranks)
    decisions = _decisions(table, context.engine, bearings)
    if decisions and table is not None and table.density is not None:
        check_factors(context.file.counterweights, "counts masses that follow from sizes, which are open")
    gear = RunningGear() if table is None else _gear_of(table, engine.slider_cranks, throws)
    if decisions or table is not None:
        _require_one_shape(context.engine)
        engine = engine.with_extra(gear)
    return replace(problem, engine=engine, decisions=(*problem.decisions, *decisions))


def _require_one_shape(table: EngineTable) -> None:
    for k, row in enumerate(table.single_cylinders, 1):
        for key in ("stroke", "rod_ratio", "rod_length", "offset", "rod"):
            if getattr(row, key) is not None:
                rule = "is that of a single cylinder, and sizes of the running gear are those of all"
                raise Refused(f"engine.single_cylinders[{k}].{key}", None, rule, "leave it out, or fix the sizes")


def _decisions(
    table: RunningGearTable | None, engine: EngineTable, bearings: Sequence[tuple[MainBearingTable, Bearing]]
) -> list[Decision]:
    decisions = list[Decision]()
    for name, size, value in _sizes_in_file(table, engine, bearings):
        decisions += Open.from_value(value).decisions(name, "m", NumberDrive(Kind.SIZE, size))
    if decisions and engine.rod is not None and isinstance(engine.rod_length, Open):
        raise Refused("engine.rod_length", None, "is open, but [engine.rod] has a fixed length", "fix it")
    if any(decision.name == "engine.rod_length" for decision in decisions):
        shortest = Open.from_value(engine.rod_length or math.inf).lower
        if engine.kind.is_free or engine.offset:
            rule = "can be open only in layouts without offset"
            raise Refused("engine.rod_length", None, rule, "fix it, or use a layout")
        if engine.stroke is not None and shortest <= 0.5 * engine.stroke:
            length = units.quantity_text(shortest, "m")
            raise Refused(
                "engine.rod_length", length, "leaves a rod too short for the crank to turn", "raise its lower bound"
            )
    return decisions


KEY = Key("running_gear", RunningGearTable, _read, adds=_with_gear_masses, always=True)
