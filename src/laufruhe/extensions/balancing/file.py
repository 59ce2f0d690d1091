"""[bob_weights] and [correction] of a problem file, and files with these tables alone."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field, ValidationError

from laufruhe import units
from laufruhe.errors import InputError, counted, refused
from laufruhe.extensions.balancing.bob_weights import RECIPROCATING, ROTATING, BobWeights
from laufruhe.extensions.balancing.physics import Dial, Drilling, Hole, Plane, plane_shares
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, complaints_of, errors_in_file, require_distinct, require_one_of
from laufruhe.files.fields import Name, Table
from laufruhe.files.problem_file import ExtensionContext, Key, UnitsTable
from laufruhe.files.reader import display_path, load_tables, tables_of
from laufruhe.machine import Engine
from laufruhe.machine.rotor import grade_of, permitted_unbalance
from laufruhe.numerics.exact_angles import direction
from laufruhe.problem.problem import Problem

MAX_PLACES, MAX_HOLES = 48, 8
MAX_SETS, MAX_HALF = 300_000, 300_000
"""Largest number of sets of places, and of choices of holes in half of a set."""
_ROUNDING = 1e-9
Masses: TypeAlias = Annotated[list[f.Mass], f.ListOrSingle(f.Mass)]
Diameters: TypeAlias = Annotated[list[f.PositiveLength], Field(min_length=1, max_length=12)]
Sector: TypeAlias = f.Pair[f.Angle]


class BobWeightsTable(Table):
    """Parts on the throws, for the bob weights that stand for them while the crankshaft is balanced."""

    closed: ClassVar[str] = "is weighed, and not decided"

    balance_factor: Annotated[float, f.Number("", minimum=0.0, maximum=1.0)] = f.required(
        "Share of the reciprocating masses in a bob weight."
    )
    big_end: Masses = f.required("Rotating mass of the rod; one for all cylinders, or one for each.")
    bearing_shells: Masses | None = f.optional("Both bearing shells of a rod.")
    piston: Masses | None = f.optional("Piston; without piston and small end, the reciprocating mass of [engine].")
    pin: Masses | None = f.optional("Piston pin.")
    rings: Masses | None = f.optional("Piston rings of a cylinder.")
    locks: Masses | None = f.optional("Locks of a piston pin.")
    small_end: Masses | None = f.optional("Reciprocating mass of the rod.")
    oil: f.Mass = f.optional("Oil in a throw.", 0.0)


class MeasuredTable(Table):
    """Unbalance that the balancing machine shows in a plane."""

    unbalance: f.Unbalance | None = f.optional("Reading of a machine that shows an unbalance.")
    mass: f.Mass | None = f.optional("Reading of a machine that shows a mass, at the radius.")
    radius: f.PositiveLength | None = f.optional("Radius that the machine is set to.")
    angle: f.Angle = f.required("Angle of the heavy spot, as read at the machine.")


class PlaneTable(Table):
    """Correction plane: a counterweight or disc, its unbalance, and the places for holes."""

    name: Name = f.required("Name of the plane in lists and pictures.")
    x: f.Length | None = f.optional("Place along the axis; needed with the centre of mass.")
    measured: MeasuredTable = f.required("Unbalance before correction, as the machine shows it.")
    radius: f.PositiveLength = f.required("Radius of the hole circle, or of the surface that radial holes start from.")
    angles: Annotated[list[f.Angle], Field(min_length=1, max_length=MAX_PLACES)] | None = f.optional(
        "Angles of the places on the crank, counted with the rotation."
    )
    places: int | None = Field(
        default=None, ge=1, le=MAX_PLACES, description="Number of places in equal steps, in place of their angles."
    )
    first_place: f.Angle = f.optional("Angle of the first of places in equal steps, on the crank.", 0.0)
    allowed: list[Sector] = Field(
        default_factory=list, description="Sectors for holes, each from an angle on the crank to another, with the "
        "rotation; by default the whole circle."
    )  # fmt: skip
    solid: list[Sector] = Field(default_factory=list, description="Sectors that no hole may touch.")
    max_depth: f.PositiveLength | None = f.optional("Largest depth in this plane, in place of that of all.")
    permitted_unbalance: f.Unbalance | None = f.optional("Permitted residual unbalance of this plane.")


class SlugsTable(Table):
    """Slugs of heavy metal, which fill holes of their diameter."""

    density: f.Density = f.required("Density of the heavy metal.")
    diameters: Diameters = f.required("Diameters of the slugs, and of their holes.")


class CorrectionTable(Table):
    """Holes and slugs that correct the unbalance of a rotor in two planes."""

    closed: ClassVar[str] = "is given, and the holes are decided"

    goal: Literal["fewest holes", "least residual"] = f.optional(
        "Fewest holes that leave a permitted residual, or the least residual of all designs.",
        "fewest holes",
    )
    planes: f.Pair[PlaneTable] = f.required("The two correction planes.")
    density: f.Density = f.required("Density of the rotor.")
    drills: Diameters = f.required("Diameters of the drills.")
    direction: Literal["axial", "radial"] = f.optional(
        "Direction of the holes: along the axis, or towards it.", "axial"
    )
    point_angle: Annotated[float, f.Number("rad", plain=math.radians(1.0), above=0.0, maximum=math.pi)] = f.optional(
        "Included angle of the drill's point; by default holes have a flat bottom.", math.pi
    )
    depth_step: f.PositiveLength = f.required("Holes are whole multiples of it deep, to the end of the full diameter.")
    min_depth: f.NonNegativeLength = f.optional("Least depth of a hole.", 0.0)
    max_depth: f.PositiveLength = f.required(
        "Largest depth of a hole, to the end of the full diameter; the drill's point goes deeper."
    )
    wall: f.NonNegativeLength = f.optional(
        "Least material between two holes, and to the edge of a sector; without it holes may touch.", 0.0
    )
    max_holes: int = Field(default=4, ge=1, le=MAX_HOLES, description="Largest number of holes in a plane.")
    slugs: SlugsTable | None = None
    permitted_unbalance: str | None = Field(
        default=None, description="Permitted in each plane: an unbalance, or the share of a plane in a grade of "
        "ISO 21940-11.", examples=["G 6.3", "50 g mm"],
    )  # fmt: skip
    rotor_mass: f.PositiveMass | None = f.optional("Mass of the rotor that has the grade.")
    service_speed: f.Speed | None = f.optional("Fastest service speed, for the grade.")
    centre_of_mass: f.Length | None = f.optional(
        "Place of the centre of mass along the axis; by default the planes have equal shares in the grade."
    )
    zero_mark: f.Angle = f.optional("Angle of the machine's zero mark on the crank.", 0.0)
    machine_counts: Literal["with rotation", "against rotation"] = f.optional(
        "Sense in which the machine counts its angles.", "with rotation"
    )


class CorrectionFile(Table):
    """File with a correction or bob weights, and without an engine."""

    title: str = Field(min_length=1)
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    tolerance: f.Tolerance = 1e-4
    units: UnitsTable = Field(default_factory=UnitsTable)
    correction: CorrectionTable | None = None
    bob_weights: BobWeightsTable | None = None


@dataclass(frozen=True, eq=False)
class Correction:
    """Unbalance in two planes, and what may correct it.

    Attributes
    ----------
    planes
        The two planes.
    drilling
        Material and form of the holes.
    dial
        Angles of the machine.
    is_fewest
        True for the fewest holes, False for the least residual.
    max_holes
        Largest number of holes in a plane.
    gaps
        Difference of two residuals that counts as none, for each plane [kg m].
    rule
        Permitted residual in words.
    """

    planes: tuple[Plane, ...]
    drilling: Drilling
    dial: Dial
    is_fewest: bool
    max_holes: int
    gaps: tuple[float, ...]
    rule: str


@dataclass(frozen=True, eq=False)
class Job:
    """Balancing job of a file: bob weights, a correction, or both; `units` are those of its report."""

    title: str
    source: str
    assumptions: Sequence[str]
    units: Mapping[str, str]
    engine: Engine | None
    weights: BobWeights | None
    correction: Correction | None


def load_job(path: Path) -> Job:
    """Return the balancing job of a file; raise `InputError` with one line for each fault."""
    tables, source = tables_of(path), display_path(path)
    if not tables.keys() & {"bob_weights", "correction"} and "study" not in tables:
        rule = "is missing, and this file has no [bob_weights] either"
        raise refused("correction", "", rule, "add one of the two tables", source)
    if tables.keys() & {"engine", "study"}:
        problem = load_tables(tables, source)
        table = tables.get("correction")
        correction = None if table is None else correction_of(_validated(table), problem.tolerance)
        engine, chosen = problem.engine, dict(problem.shown_units)
        weights = engine.extra(BobWeights)
        return Job(problem.title, problem.source, problem.assumptions, chosen, engine, weights, correction)
    try:
        with errors_in_file(source):
            file = CorrectionFile.model_validate(tables)
            correction = None if file.correction is None else correction_of(file.correction, file.tolerance)
            weights = None if file.bob_weights is None else _weights_of_a_pin(file.bob_weights)
    except ValidationError as error:
        raise InputError(str(source), complaints_of(error, CorrectionFile)) from None
    chosen = dict(file.units.by_si_unit())
    return Job(file.title, file.source, file.assumptions, chosen, None, weights, correction)


def _weights_of_a_pin(table: BobWeightsTable) -> BobWeights:
    # without an engine, a list has the mass of each rod on a crank pin
    if table.piston is None:
        rule = "is missing, and without [engine] there is no reciprocating mass"
        raise Refused("bob_weights.piston", None, rule, "add piston and small_end")
    rods = max(len(masses) for name in (*ROTATING, *RECIPROCATING) if (masses := getattr(table, name)) is not None)
    return BobWeights(table.balance_factor, table.oil, _parts_of(table, rods), (tuple(range(rods)),), ())


def _validated(table: Mapping[str, Any]) -> CorrectionTable:
    return CorrectionTable.model_validate(table)


def _read_correction(table: CorrectionTable, problem: Problem, _: ExtensionContext) -> Problem:
    # holes change nothing of the engine; the command decides them
    correction_of(table, problem.tolerance)
    return problem


def _read_bob_weights(table: BobWeightsTable, problem: Problem, context: ExtensionContext) -> Problem:
    cranks = problem.engine.slider_cranks
    if any(part.master_bank is not None for part in cranks):
        rule = "needs rods on the crank pins, and these are hinged to a master rod"
        raise Refused("bob_weights", None, rule, "leave it out")
    pins = dict[tuple[int, object], list[int]]()
    for k, throw in enumerate(context.throws):
        for i in throw.cylinders:
            # the parts of a split pin have bob weights of their own
            pins.setdefault((k, direction(cranks[i].throw)), []).append(i)
    masses = tuple(
        (throw.cylinders, abs(throw.unbalance) / cranks[throw.cylinders[0]].crank_radius) for throw in context.throws
    )
    parts = _parts_of(table, len(cranks))
    weights = BobWeights(table.balance_factor, table.oil, parts, tuple(map(tuple, pins.values())), masses)
    return replace(problem, engine=problem.engine.with_extra(weights))


def _parts_of(table: BobWeightsTable, cylinders: int) -> tuple[tuple[str, tuple[float, ...]], ...]:
    # names of the weighed parts, each with its mass at every cylinder [kg]
    listed = [name for name in RECIPROCATING if getattr(table, name) is not None]
    for name in ("piston", "small_end") if listed else ():
        if name not in listed:
            rule = f"is missing, and {listed[0]} is given"
            raise Refused(f"bob_weights.{name}", None, rule, "add it, or leave all reciprocating parts out")
    return tuple((name, _masses_of(table, name, cylinders)) for name in (*ROTATING, *listed))


def _masses_of(table: BobWeightsTable, name: str, cylinders: int) -> tuple[float, ...]:
    masses = getattr(table, name) or [0.0]
    if len(masses) not in (1, cylinders):
        rule = f"has {len(masses)} entries for {counted(cylinders, 'rod')}"
        raise Refused(f"bob_weights.{name}", None, rule, "give one mass, or one for each rod")
    return tuple(masses) * (cylinders // len(masses))


def correction_of(table: CorrectionTable, tolerance: float) -> Correction:
    """Return the correction that a table describes; `tolerance` is the relative gap of its proof."""
    slugs = table.slugs
    drilling = Drilling(
        table.density, table.direction != "axial", table.point_angle, None if slugs is None else slugs.density
    )
    if slugs is not None and slugs.density <= table.density:
        density = units.quantity_text(slugs.density, "kg/m^3")
        raise Refused("correction.slugs.density", density, "is not more than that of the rotor", "give the heavy metal")
    require_distinct([plane.name for plane in table.planes], "correction.planes", "planes have this name")
    dial = Dial(table.zero_mark, 1.0 if table.machine_counts == "with rotation" else -1.0)
    permitted, rule = _permitted(table)
    planes = tuple(
        _plane(table, k, _smaller(permitted[k], table.planes[k].permitted_unbalance), drilling, dial) for k in range(2)
    )
    if table.goal == "fewest holes" and any(plane.permitted is None for plane in planes):
        remedy = 'write for example permitted_unbalance = "G 6.3", or goal = "least residual"'
        raise Refused(
            "correction.permitted_unbalance", None, "is missing, and decides how many holes are enough", remedy
        )
    gaps = tuple(tolerance * (abs(plane.initial) if plane.permitted is None else plane.permitted) for plane in planes)
    return Correction(planes, drilling, dial, table.goal == "fewest holes", table.max_holes, gaps, rule)


def _smaller(first: float | None, second: float | None) -> float | None:
    return min((one for one in (first, second) if one is not None), default=None)


def _permitted(table: CorrectionTable) -> tuple[tuple[float | None, ...], str]:
    """Return the permitted residual of each plane [kg m], and the rule in words."""
    text, where = table.permitted_unbalance, "correction.permitted_unbalance"
    grade = None if text is None else grade_of(text)
    for key in ("rotor_mass", "service_speed", "centre_of_mass"):
        is_given = getattr(table, key) is not None
        if is_given and grade is None:
            raise Refused(f"correction.{key}", None, "needs a balance grade", 'add permitted_unbalance = "G 6.3"')
        if not is_given and grade is not None and key != "centre_of_mass":
            raise Refused(f"correction.{key}", None, "is missing, and a balance grade needs it", "add it")
    if text is None:
        return (None, None), ""
    if grade is None or table.rotor_mass is None or table.service_speed is None:
        try:
            unbalance = units.parse(text, "kg m")
        except units.UnitError:
            rule, remedy = "is neither a balance grade nor an unbalance", 'write for example "G 6.3" or "50 g mm"'
            raise Refused(where, text, rule, remedy) from None
        if unbalance <= 0.0:
            raise Refused(where, text, "must be more than 0", 'write for example "50 g mm"')
        return (unbalance, unbalance), f"{text} in each plane"
    if grade <= 0.0:
        raise Refused(where, text, "must be more than G 0", 'write for example "G 6.3"')
    whole = permitted_unbalance(grade, table.rotor_mass, table.service_speed)
    mass, speed = (units.quantity_text(*pair) for pair in ((table.rotor_mass, "kg"), (table.service_speed, "rad/s")))
    rule = f"{text} of ISO 21940-11 for {mass} at {speed}"
    return tuple(whole * share for share in _shares(table)), rule


def _shares(table: CorrectionTable) -> tuple[float, float]:
    places, centre = [plane.x for plane in table.planes], table.centre_of_mass
    if centre is None:
        return 0.5, 0.5
    known = [x for x in places if x is not None]
    if len(known) < 2 or not min(known) < centre < max(known):
        where = "correction.centre_of_mass"
        rule, remedy = "must be between the places x of the two planes", "give x of both planes, or leave it out"
        raise Refused(where, units.quantity_text(centre, "m"), rule, remedy)
    return plane_shares(known, centre)


def _plane(table: CorrectionTable, k: int, permitted: float | None, drilling: Drilling, dial: Dial) -> Plane:
    row, where = table.planes[k], f"correction.planes[{k + 1}]"
    require_one_of(row.measured, f"{where}.measured", "unbalance", "mass", named="mass and radius")
    if (row.measured.mass is None) != (row.measured.radius is None):
        key = "radius" if row.measured.radius is None else "mass"
        raise Refused(f"{where}.measured.{key}", None, "is missing", "give mass and radius, or unbalance")
    size = row.measured.unbalance
    if size is None:
        size = (row.measured.mass or 0.0) * (row.measured.radius or 0.0)
    require_one_of(row, where, "angles", "places")
    angles = row.angles or [row.first_place + math.tau * n / (row.places or 1) for n in range(row.places or 1)]
    degrees = [round(math.degrees(angle) % 360.0, 6) % 360.0 for angle in angles]
    require_distinct(degrees, f"{where}.angles", "places are at this angle", "leave one out")
    depth = row.max_depth or table.max_depth
    deepest = depth + max(map(drilling.point_height, table.drills)) * drilling.is_radial
    if drilling.is_radial and deepest >= row.radius:
        text = units.quantity_text(depth, "m")
        raise Refused(f"{where}.max_depth", text, "reaches the axis with the drill's point", "make it smaller")
    choices = _holes(table, depth, row.radius, drilling)
    if not choices:
        text = units.quantity_text(depth, "m")
        rule = "allows no depth that is a multiple of depth_step and at least min_depth"
        raise Refused(f"{where}.max_depth", text, rule, "make it larger, or depth_step smaller")
    sectors = _sectors(row.allowed), _sectors(row.solid)
    holes = [
        tuple(hole for hole in choices if _fits(angle, hole.end, 0.5 * hole.diameter + table.wall, *sectors))
        for angle in angles
    ]
    usable = [(angle, there) for angle, there in zip(angles, holes, strict=True) if there]
    if not usable:
        raise Refused(f"{where}.allowed", None, "and solid leave no place for any drill", "allow more")
    _check_effort(table.max_holes, len(usable), max(len(there) for _, there in usable))
    initial = cmath.rect(size, dial.on_crank(row.measured.angle))
    return Plane(
        row.name, row.radius, initial, tuple(angle for angle, _ in usable), tuple(there for _, there in usable),
        permitted, table.wall, sectors[1],
    )  # fmt: skip


def _check_effort(max_holes: int, places: int, choices: int) -> None:
    holes = min(max_holes, places)
    sets = max(math.comb(places, count) for count in range(holes + 1))
    if sets > MAX_SETS or choices ** -(-holes // 2) > MAX_HALF:
        rule = f"makes too many designs to prove one, with {places} places and {choices} holes for each"
        raise Refused("correction.max_holes", max_holes, rule, "lower it, or make depth_step larger")


def _holes(table: CorrectionTable, max_depth: float, radius: float, drilling: Drilling) -> tuple[Hole, ...]:
    first = max(math.ceil(table.min_depth / table.depth_step - _ROUNDING), 1)
    last = math.floor(max_depth / table.depth_step + _ROUNDING)
    kinds = [(diameter, False) for diameter in table.drills]
    kinds += [] if table.slugs is None else [(diameter, True) for diameter in table.slugs.diameters]
    return tuple(
        drilling.hole(diameter, depth, radius, filled)
        for diameter, filled in kinds
        for depth in (table.depth_step * step for step in range(first, last + 1))
    )


def _sectors(pairs: Sequence[Sequence[float]]) -> tuple[tuple[float, float], ...]:
    # two angles that are a whole number of turns apart enclose the circle
    return tuple((low, low + ((high - low) % math.tau or math.tau)) for low, high in pairs)


def _fits(
    angle: float, radius: float, room: float, allowed: Sequence[tuple[float, float]],
    solid: Sequence[tuple[float, float]],
) -> bool:  # fmt: skip
    # a circle of radius `room` is within an allowed sector and outside all solid ones (U5)
    return (not allowed or any(_depth_in(angle, radius, sector) >= room for sector in allowed)) and all(
        -_depth_in(angle, radius, sector) >= room for sector in solid
    )


def _depth_in(angle: float, radius: float, sector: tuple[float, float]) -> float:
    # distance of a place from the edges of a sector, negative outside it
    low, high = sector
    if high - low >= math.tau * (1.0 - 1e-12):
        return math.inf
    ways = [abs(math.remainder(angle - edge, math.tau)) for edge in sector]
    distance = min(radius * math.sin(min(way, 0.5 * math.pi)) for way in ways) * (1.0 + 1e-12)
    return distance if (angle - low) % math.tau <= high - low else -distance


BOB_WEIGHTS = Key("bob_weights", BobWeightsTable, _read_bob_weights)
CORRECTION = Key("correction", CorrectionTable, _read_correction)
