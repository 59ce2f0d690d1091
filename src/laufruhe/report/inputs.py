"""Inputs of a problem as a report states them, so that a reader can check them without the file."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from laufruhe.errors import counted
from laufruhe.files.gas import default_numbers
from laufruhe.files.numbering import USUAL
from laufruhe.machine import Engine, Mount, Rotor, SliderCrank
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.machine.mount import every_spring
from laufruhe.machine.slider_crank import displacement
from laufruhe.physics.rigid_body import turns_of
from laufruhe.present.numbers import DASH, DEGREE, fixed, trimmed, with_unit
from laufruhe.present.tables import Table
from laufruhe.problem.problem import Problem
from laufruhe.units import readable, readable_unbalance

NOTE = (
    "Throws at a crank angle of 0 (C5), which is the firing dead centre of the cylinder that fires at 0. The offset is "
    "that of the pin's path."
)
OF_MOUNTS = "Positions in the axes of the engine (C2). Axes are turned about x, then y, then z (E2)."
OF_ROTORS = "The unbalance of a throw is its rotating mass times the crank radius. Angles at a crank angle of 0 (C4)."


def input_tables(problem: Problem, engine: Engine) -> list[Table]:
    """Return tables of the engine of a result: what it is, and the numbers of its cylinders and rotating parts."""
    length, mass, all_rotors = readable("m")[0], readable("kg")[0], (*engine.pins, *engine.rotors)
    unbalance, factor = readable_unbalance(max((abs(rotor.unbalance) for rotor in all_rotors), default=0.0))
    x, y, z = (f"{axis} [{length}]" for axis in "xyz")
    sizes = (f"{name} [{length}]" for name in ("bore", "stroke", "rod", "offset"))
    of_cylinder = ("", x, "bank [deg]", "throw [deg]", "fires at [deg]", *sizes, f"reciprocating mass [{mass}]")
    of_rotor = ("", "shaft", "ratio", x, y, z, f"unbalance [{unbalance}]", "angle [deg]")
    of_mount = ("mount", x, y, z, "stiffness along its axes", "its axes turned [deg]")
    cylinders = [_cylinder(part) for part in engine.slider_cranks]
    rotors = [_rotor(rotor, factor) for rotor in all_rotors]
    tables = [Table(("input", "value"), list(_engine_rows(problem, engine)), left=2)]
    tables += [Table(of_cylinder, cylinders, note=NOTE)]
    tables += [Table(of_rotor, rotors, left=2, note=OF_ROTORS)] if rotors else []
    springs = [_mount(mount, engine.block is None) for _, mount in every_spring(engine.mounts)]
    return [*tables, *([Table(of_mount, springs, note=OF_MOUNTS)] if springs else [])]


def _engine_rows(problem: Problem, engine: Engine) -> Iterator[tuple[str, str]]:
    tables = problem.origin.tables if problem.origin is not None else {}
    table: Mapping[str, Any] = tables.get("engine", {})
    kind = LAYOUTS.get(table.get("layout", ""))
    fired = sorted(engine.cylinders, key=lambda part: part.firing_angle)
    yield "engine", ", ".join([*([kind.name] if kind else []), str(engine.cycle), counted(len(fired), "cylinder")])
    for key, usual in {**USUAL, "rotation": "clockwise"}.items():
        if kind is not None and kind.takes(key):
            yield key.replace("_", " "), f"{table.get(key, usual)}"
    if len(fired) > 1:
        order = "-".join(part.name.removeprefix(f"{part.noun} ") for part in fired)
        intervals = ", ".join(trimmed(DEGREE * angle) for angle in engine.firing_intervals)
        yield "firing order", f"{order}, after {intervals} deg"
    if all(part.bore is not None for part in fired):
        yield "displacement", f"{trimmed(1e3 * displacement(engine.slider_cranks))} l"
    if "gas" in tables:
        yield (
            "gas",
            ", ".join(f"{key} {value}" for key, value in tables["gas"].items() if isinstance(value, str | int | float)),
        )
        if defaults := ", ".join(f"{key} {text}" for key, text in default_numbers(tables["gas"])):
            yield "gas, by default", defaults
    if engine.block is not None:
        yield "mass on the mounts", with_unit(engine.block.mass, "kg")


def _cylinder(part: SliderCrank) -> tuple[str, ...]:
    angles = (part.bank, part.throw, part.firing_angle)
    factor = readable("m")[1]
    lengths = (part.bore, part.stroke, part.rod_length, part.offset)
    return (
        part.name, trimmed(factor * part.x), *(trimmed(DEGREE * angle) for angle in angles),
        *(DASH if length is None or math.isinf(length) else trimmed(factor * length, 5) for length in lengths),
        trimmed(readable("kg")[1] * part.reciprocating_mass),
    )  # fmt: skip


def _rotor(rotor: Rotor, factor: float) -> tuple[str, ...]:
    size, angle = abs(rotor.unbalance), cmath.phase(rotor.unbalance)
    millimetres = readable("m")[1]
    place = (trimmed(millimetres * length) for length in (rotor.x, rotor.shaft.y, rotor.shaft.z))
    turn = trimmed(DEGREE * (angle % math.tau)) if size else DASH
    return rotor.name, rotor.shaft.name, trimmed(rotor.shaft.ratio), *place, trimmed(factor * size, 5), turn


def _mount(mount: Mount, is_rigid: bool) -> tuple[str, ...]:
    millimetres = readable("m")[1]
    place = (trimmed(millimetres * length) for length in mount.position)
    name, factor = ("", 1.0) if is_rigid else readable("N/m")
    stiffness = ", ".join(trimmed(factor * value) for value in mount.stiffness) + f" {name}".rstrip()
    turns = ", ".join(fixed(DEGREE * angle, 2) for angle in turns_of(np.array(mount.orientation)))
    return mount.name, *place, stiffness, turns
