"""`body` of a weight and [crankcase] of a problem file: sizes of bodies, and the limits that they set to unbalances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from laufruhe import units
from laufruhe.errors import Complaint, ModelError
from laufruhe.extensions.workshop.bodies import Body, BodyRange
from laufruhe.extensions.workshop.crankcase import Crankcase, RodSize, RoundPart, Seat, Wall, clearances
from laufruhe.extensions.workshop.part import Workshop, fit_of, seat_of
from laufruhe.extensions.workshop.shapes import SHAPES, Shape
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, refuse_keys, require_distinct
from laufruhe.files.fields import Open, Table
from laufruhe.files.problem_file import ExtensionContext, Key, ProblemFile, WeightKey
from laufruhe.files.rotors import SizedTable, UnbalanceTable, name_of_unbalance
from laufruhe.machine import Rotor
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.problem.decision import Decision, RotorDrive, domains_of, projected_vector
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector

STEEL = 7850.0
_DEG = math.radians(1.0)
_COLLINEAR = 1e-9
OpeningAngle = Annotated[float | Open, f.Number("rad", plain=_DEG, above=0.0, below=math.tau, openable=True)]
_OPEN_UP_TO = 180.0


class BodyTable(Table):
    """Body of a weight, from which its mass and unbalance follow."""

    kind: Literal["sector", "slab", "cheek"] = f.required(
        "A sector of a disc or ring; a slab with a flat inner side; a web cheek with a round end about the crank pin."
    )
    outer_radius: f.OpenPositiveLength = f.required("Radius that the body sweeps about its shaft.")
    inner_radius: f.NonNegativeLength = f.optional(
        "Inner radius of a sector, or distance of the flat side of a slab from the shaft.", 0.0
    )
    angle: OpeningAngle | None = f.optional("Opening angle of a sector, or of the wide end of a cheek.")
    width: f.OpenPositiveLength | None = f.optional("Width of a slab or cheek across its middle line.")
    tail: f.PositiveLength | None = f.optional("Distance of the round end of a cheek from the shaft.")
    thickness: f.OpenNonNegativeLength = f.required("Length along the shaft, of each of two bodies.")
    fillet: f.NonNegativeLength = f.optional("Radius at every corner that points outwards.", 0.0)
    density: f.Density = f.optional("Density; that of steel by default.", STEEL)
    spacing: f.NonNegativeLength = f.optional(
        "Distance between the middles of two equal bodies, one on either web of a throw; 0 for one body.", 0.0
    )


class RodSizeTable(Table):
    """Rod as a part that weights must not hit."""

    width: f.PositiveLength = f.required("Width of the shank across the shaft.")
    thickness: f.PositiveLength = f.required("Width along the shaft.")
    big_end: f.PositiveLength = f.required("Outer diameter of the big end.")
    small_end: f.NonNegativeLength = f.optional("Outer diameter of the small end.", 0.0)


class WallTable(Table):
    """Flat wall along the shafts, such as a sump."""

    name: f.Name
    angle: f.Angle = f.required("Direction from the crank axis to the wall: 0 is up, 90 left, 180 down.")
    distance: f.PositiveLength = f.required("Distance of the wall from the crank axis.")


class RoundPartTable(Table):
    """Round part along the shafts, such as a camshaft."""

    name: f.Name
    position: f.Pair[f.Length] = f.required("Position of its axis: y to the left, z up.")
    radius: f.PositiveLength = f.required("Radius that it takes, such as that of a cam.")
    x: f.Pair[f.Length] | None = f.optional("Rear and front end; without them it is as long as the engine.")


class CrankcaseTable(Table):
    """Space in which weights turn."""

    clearance: f.NonNegativeLength = f.optional("Smallest distance that weights keep from all parts.", 0.0)
    skirt: f.NonNegativeLength | None = f.optional(
        "Distance from the piston pin to the lower edge of the piston; without it pistons are not checked."
    )
    rod: RodSizeTable | None = f.optional("Sizes of the rods; without them rods are not checked.")
    walls: list[WallTable] = f.optional("Flat walls along the shafts.", [])
    round_parts: list[RoundPartTable] = f.optional("Round parts along the shafts.", [])


_SHAPE_KEYS = {"sector": ("inner_radius", "angle"), "slab": ("inner_radius", "width"),
               "cheek": ("width", "tail", "angle")}  # fmt: skip
_REQUIRED = {"sector": ("angle",), "slab": (), "cheek": ("width", "tail")}


@dataclass(frozen=True)
class _Row:
    """Weight of a file: its table, its key, and the names of its rotors."""

    table: SizedTable
    where: str
    rotors: tuple[str, ...]

    @property
    def body(self) -> BodyTable | None:
        body: BodyTable | None = getattr(self.table, KEY_OF_BODY.name, None)
        return body


def _rows(file: ProblemFile, rotors: Sequence[str] = ()) -> Iterator[_Row]:
    for k, weight in enumerate(file.counterweights, 1):
        of_throws = tuple(name for name in rotors if name.startswith(f"{weight.name}."))
        yield _Row(weight, f"counterweights[{k}]", of_throws if weight.factor_key else (weight.name,))
    for k, shaft in enumerate(file.balancer_shafts, 1):
        names = [row.name for row in shaft.unbalances]
        for j, row in enumerate(shaft.unbalances):
            name = name_of_unbalance(shaft.name, names, j)
            yield _Row(row, f"balancer_shafts[{k}].unbalances[{j + 1}]", (name,))


def _range_of(body: BodyTable, where: str) -> BodyRange:
    """Return the range of bodies of a table; raise `Refused` for sizes that are missing or out of place."""
    keys, kind = _SHAPE_KEYS[body.kind], SHAPES[body.kind]
    foreign = [
        key for key in ("inner_radius", "angle", "width", "tail") if key not in keys and key in body.model_fields_set
    ]
    refuse_keys(body, foreign, where, f"does not belong to a {body.kind}", f"a {body.kind} has {', '.join(keys)}")
    for key in _REQUIRED[body.kind]:
        if getattr(body, key) is None:
            raise Refused(f"{where}.{key}", None, f"is missing, but a {body.kind} needs it", "add it")
    values = {key: Open.from_value(getattr(body, key)) for key in keys if getattr(body, key) is not None}
    for key, value in values.items():
        if value.is_open and key != kind.breadth:
            names = " and ".join(filter(None, ("outer_radius", "thickness", kind.breadth)))
            rule = f"is open, but of a {body.kind} only {names} can be"
            raise Refused(f"{where}.{key}", None, rule, "give a number")
        if value.is_open and key == "angle" and value.upper > math.radians(_OPEN_UP_TO) * (1.0 + 1e-12):
            text = units.quantity_text(value.upper, "rad")
            raise Refused(f"{where}.angle", text, "is above 180 deg, from where the unbalance falls", "open it to 180")
    with errors_at_key(where):
        sides = (_body(body, kind, values, side) for side in ("lower", "upper"))
        return BodyRange(*sides)


def _body(table: BodyTable, kind: type[Shape], values: dict[str, Open], side: str) -> Body:
    sizes = {key: getattr(value, side) for key, value in values.items()}
    shape = kind(outer_radius=getattr(Open.from_value(table.outer_radius), side), fillet=table.fillet, **sizes)
    thickness = getattr(Open.from_value(table.thickness), side)
    body = Body(shape, thickness, table.density, table.spacing)
    if table.spacing and thickness > table.spacing:
        raise ModelError("the two bodies are thicker than their spacing; increase the spacing")
    if not shape.moments.first.real > 0.0:
        raise ModelError("the centre of mass is not on the side of the weight; increase the outer radius or the angle")
    return body


def _prepare(file: ProblemFile) -> ProblemFile:
    """Return the file with the masses, radii and unbalances of bodies in the tables of weights."""
    sized = {row.where: _sized(row) for row in _rows(file)}
    weights = [sized[f"counterweights[{k}]"] for k in range(1, len(file.counterweights) + 1)]
    shafts = [
        shaft.model_copy(update={
            "unbalances": [sized[f"balancer_shafts[{k}].unbalances[{j + 1}]"] for j in range(len(shaft.unbalances))]
        })
        for k, shaft in enumerate(file.balancer_shafts, 1)
    ]  # fmt: skip
    return file.model_copy(update={"counterweights": weights, "balancer_shafts": shafts})


def _sized(row: _Row) -> SizedTable:
    table, body = row.table, row.body
    if body is None:
        return table
    where = f"{row.where}.body"
    sizes = _range_of(body, where)
    refuse_keys(table, ("mass", "radius"), row.where, "cannot stand beside a body, which gives it", "leave it out")
    lever = None if sizes.has_open_shape else sizes.largest.shape.lever
    follows = getattr(table, "factor_key", None) or getattr(table, "coupled", None) or table.unbalance is not None
    if follows:
        if not sizes.is_open:
            rule, remedy = "has fixed sizes beside an unbalance that is given", "open its thickness or outer_radius"
            raise Refused(where, None, rule, f"{remedy}, or leave the unbalance out")
        return table.model_copy(update={"radius": lever})
    if lever is None:
        start = _at_start(body)
        size = Open(sizes.smallest.unbalance, sizes.largest.unbalance, start.unbalance)
        return table.model_copy(update={"unbalance": size})
    thickness = Open.from_value(body.thickness)
    if not thickness.upper > 0.0:
        raise Refused(f"{where}.thickness", units.quantity_text(0.0, "m"), "must be more than 0 m", "make it larger")
    size = Open(sizes.smallest.mass, sizes.largest.mass, replace(sizes.smallest, thickness=thickness.start).mass)
    return table.model_copy(update={"mass": size, "radius": lever})


def _at_start(body: BodyTable) -> Body:
    kind, keys = SHAPES[body.kind], _SHAPE_KEYS[body.kind]
    values = {key: Open.from_value(getattr(body, key)) for key in keys if getattr(body, key) is not None}
    return _body(body, kind, values, "start")


def _read(table: CrankcaseTable | None, problem: Problem, context: ExtensionContext) -> Problem:
    crankcase = _crankcase(table or CrankcaseTable())
    rotors, bodies = {rotor.name: rotor for rotor in problem.engine.rotors}, dict[str, BodyRange]()
    rows = list(_rows(context.file, list(rotors)))
    for row in rows:
        leader = row.table.coupled.to if isinstance(row.table, UnbalanceTable) and row.table.coupled else ""
        for name in row.rotors:
            if row.body is not None:
                bodies[name] = _range_of(row.body, f"{row.where}.body")
                problem = _within_body(problem, crankcase, rotors[name], bodies[name], f"{row.where}.body")
            elif leader in bodies:
                bodies[name] = bodies[leader]
                problem = _within_body(problem, crankcase, rotors[name], bodies[name], row.where)
    if not bodies:
        return problem
    problem = _restarted(problem)
    return replace(problem, engine=problem.engine.with_extra(Workshop(tuple(bodies.items()), crankcase)))


def _crankcase(table: CrankcaseTable) -> Crankcase:
    names = [*(wall.name for wall in table.walls), *(part.name for part in table.round_parts)]
    require_distinct(names, "crankcase", "is the name of two parts")
    rod = None
    if table.rod is not None:
        rod = RodSize(table.rod.width, table.rod.thickness, table.rod.big_end, table.rod.small_end)
    walls = tuple(Wall(wall.name, cis(as_turn(wall.angle)), wall.distance) for wall in table.walls)
    round_parts = []
    for k, part in enumerate(table.round_parts, 1):
        ends = (-math.inf, math.inf) if part.x is None else (part.x[0], part.x[1])
        if ends[0] >= ends[1]:
            raise Refused(f"crankcase.round_parts[{k}].x", None, "has its ends reversed", "write the rear end first")
        place = complex(part.position[1], part.position[0])
        round_parts.append(RoundPart(part.name, place, part.radius, ends))
    return Crankcase(table.clearance, table.skirt, rod, walls, tuple(round_parts))


def _within_body(problem: Problem, crankcase: Crankcase, rotor: Rotor, sizes: BodyRange, where: str) -> Problem:
    """Return the problem with the unbalance of a rotor limited to bodies that keep their clearances.

    Raise `Refused` if no body fits.
    """
    engine = problem.engine
    places = [one for one in problem.decisions if any(drive.rotor == rotor.name for drive in one.place_drives)]
    if places and sizes.has_open_shape:
        rule = f"has an open radius, angle or width while {places[0].name} is open"
        raise Refused(where, None, rule, "fix the place, or leave only the thickness open")
    seat = _seat(rotor, problem.decisions)
    fit = fit_of(sizes, crankcase, engine.slider_cranks, engine.cycle.angle, seat)
    reach = sizes.largest.shape.outer_radius
    if not places and not fit.fits:
        distances = sorted(
            clearances(crankcase, engine.slider_cranks, engine.cycle.angle, sizes.smallest, seat),
            key=lambda one: one.minimum.distance,
        )
        # bodies that overlap have no order of distances
        hit = " and ".join(one.part for one in distances if one.minimum.bound < crankcase.clearance) or "other parts"
        rule, remedy = f"does not keep its clearance from {hit}", "make it smaller, or move it"
        if sizes.has_open_shape:
            raise Refused(where, None, rule, remedy)
        problem = replace(problem, warnings=(*problem.warnings, Complaint(where, "", rule, remedy)))
    elif sizes.has_open_shape:
        reach = fit.narrow.outer_radius
    low, high = fit.bounds if sizes.has_open_shape else (sizes.smallest.unbalance, sizes.largest.unbalance)
    decisions = tuple(_cut(decision, rotor, low, high, where) for decision in problem.decisions)
    if sizes.is_open and not any(_drives(decision, rotor) for decision in decisions) and rotor.unbalance:
        with errors_at_key(where):
            fit.body_of(abs(rotor.unbalance))
    moved = tuple(replace(one, reach=reach) if one.name == rotor.name else one for one in engine.rotors)
    return replace(problem, engine=replace(engine, rotors=moved), decisions=decisions)


def _drives(decision: Decision, rotor: Rotor) -> list[RotorDrive]:
    return [drive for drive in decision.rotor_drives if drive.rotor == rotor.name and drive.gain]


def _seat(rotor: Rotor, decisions: Sequence[Decision]) -> Seat:
    # return the seat of a body; its angle is that of the largest unbalance, or None if the angle is open
    for decision in decisions:
        for drive in _drives(decision, rotor):
            if isinstance(decision.set, Sector):
                return Seat(rotor.x, rotor.shaft, None)
            upper = decision.upper * decision.set.directions[0]
            return seat_of(rotor, rotor.unbalance + drive.of(upper - decision.start))
    return seat_of(rotor, rotor.unbalance)


def _cut(decision: Decision, rotor: Rotor, low: float, high: float, where: str) -> Decision:
    """Return the decision with its set limited to unbalances of a rotor between two sizes [kg m]."""
    for drive in _drives(decision, rotor):
        gain = abs(drive.gain)
        if isinstance(decision.set, Sector):
            return replace(decision, set=decision.set.within(high / gain))
        if not isinstance(decision.set, Interval):
            continue
        along = drive.of(decision.set.directions[0]) / gain
        offset = (rotor.unbalance - drive.of(decision.start)) / along
        if abs(offset.imag) > _COLLINEAR * max(abs(offset), high):
            continue
        # sizes along the direction in which the unbalance grows, on the side of its upper end
        sign = math.copysign(1.0, offset.real + gain * decision.upper)
        ends = sorted(((sign * (low if low > 0.0 else -high) - offset.real) / gain, (sign * high - offset.real) / gain))
        bounds = max(ends[0], decision.lower), min(ends[1], decision.upper)
        if bounds[0] > bounds[1]:
            allowed = " to ".join(units.quantity_text(size, "kg m") for size in (low, high))
            raise Refused(where, None, f"has an unbalance of {allowed}, which {decision.name} does not allow",
                          "change its sizes, or those bounds")  # fmt: skip
        return replace(decision, set=replace(decision.set, lower=bounds[0], upper=bounds[1]))
    return decision


def _restarted(problem: Problem) -> Problem:
    """Return the problem whose decisions start within their sets."""
    domains = domains_of(problem.decisions)
    vector = projected_vector(domains, problem.start)
    starts = [domain.complex_value(vector) for domain in domains]
    moved = tuple(
        replace(decision, start=start) if abs(start - decision.start) > _COLLINEAR * decision.set.scale else decision
        for decision, start in zip(problem.decisions, starts, strict=True)
    )
    if moved == problem.decisions:
        return problem
    return replace(problem, engine=problem.design([decision.start for decision in moved]), decisions=moved)


KEY_OF_BODY = WeightKey("body", BodyTable, _prepare)
KEY = Key("crankcase", CrankcaseTable, _read, always=True)
