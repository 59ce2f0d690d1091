"""Report section of bodies: sizes, masses, clearances and shafts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from laufruhe.extensions.workshop.crankcase import Crankcase, is_checked
from laufruhe.extensions.workshop.part import Weight, Workshop, clearances_of, weights_of
from laufruhe.present.numbers import DASH, fixed, number, trimmed
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.report.sections.weights import sense_of
from laufruhe.solvers.result import Result
from laufruhe.units import readable, readable_unbalance

_SIZES = ("inner_radius", "outer_radius", "angle", "width", "tail", "fillet")
_SIZE_NOTE = "Open sizes are those of the least mass with this unbalance."
_MASS_NOTE = "Mass, unbalance and inertia are those of all bodies of a weight; the inertia is about its shaft."
_CLEARANCE_NOTE = (
    "Least distance over a working cycle, and the crank angle at which it occurs. Webs, bearings and block are not "
    "checked{}."
)


def applies(result: Result) -> bool:
    """Return True if a weight of the final design has a body."""
    return bool(weights_of(result.final.engine))


def _tables(result: Result) -> list[Table]:
    engine = result.final.engine
    weights = weights_of(engine)
    return [*_bodies(weights), _clearances(result)]


def _bodies(weights: Sequence[Weight]) -> list[Table]:
    (length, millimetres), (mass, grams) = readable("m"), readable("kg", "g")
    unbalance, factor = readable_unbalance(max(weight.body.unbalance for weight in weights))
    keys = [key for key in _SIZES if any(weight.body.shape.sizes.get(key) for weight in weights)]
    sizes, masses = list[Sequence[str]](), list[Sequence[str]]()
    for weight in weights:
        body, name = weight.body, weight.rotor.name
        of_shape = [_size_text(body.shape.sizes.get(key), key in body.shape.angles) for key in keys]
        count = "2" if body.spacing else "1"
        sizes.append((name, body.shape.name, count, *of_shape, trimmed(millimetres * body.thickness)))
        masses.append(
            (name, number(grams * body.mass), number(factor * body.unbalance), trimmed(millimetres * body.shape.lever),
             number(1e6 * body.inertia), weight.fault or DASH)
        )  # fmt: skip
    units = [f"{key.replace('_', ' ')} [{'deg' if key == 'angle' else length}]" for key in keys]
    head = ("weight", "kind", "bodies", *units, f"thickness [{length}]")
    of_masses = ("weight", f"mass [{mass}]", f"unbalance [{unbalance}]", f"centre of mass at [{length}]",
                 "inertia [kg mm^2]", "remark")  # fmt: skip
    return [
        Table(head, sizes, title="Bodies of the weights", left=2, note=_SIZE_NOTE, file="bodies"),
        Table(of_masses, masses, title="Masses of the bodies", left=(0, 5), note=_MASS_NOTE, file="body-masses"),
    ]


def _size_text(size: float | None, is_angle: bool) -> str:
    if not size:
        return DASH
    return trimmed(math.degrees(size) if is_angle else readable("m")[1] * size)


def _clearances(result: Result) -> Table:
    engine = result.final.engine
    workshop, rows = engine.extra(Workshop), []
    length, millimetres = readable("m")
    for weight, distances in clearances_of(engine, weights_of(engine)):
        for clearance in distances:
            angle = clearance.minimum.angle
            at = "all" if math.isnan(angle) else fixed(math.degrees(angle), 1)
            distance = clearance.minimum.distance
            size = "collides" if distance < 0.0 else number(millimetres * distance)
            rows.append((weight.rotor.name, clearance.part, size, at))
    case = workshop.crankcase if workshop else Crankcase()
    unknown = [f"{thing} without {key}" for thing, key, size in
               (("pistons", "skirt", case.skirt), ("rods", "rod", case.rod)) if size is None]  # fmt: skip
    lacking = f", nor {' and '.join(unknown)} of [crankcase]" if unknown else ""
    omitted = [part.name for part in engine.slider_cranks if not is_checked(part)]
    more = f" Not checked, because they are no plain slider-cranks: {', '.join(omitted)}." if omitted else ""
    demand = f"The file demands {trimmed(millimetres * case.clearance)} {length}."
    note = f"{_CLEARANCE_NOTE.format(lacking)} {demand}{more}"
    head = ("weight", "part", f"clearance [{length}]", "at crank angle [deg]")
    return Table(head, rows, title="Clearances of the bodies", left=2, note=note, file="clearances")


def _record(result: Result) -> Mapping[str, Any]:
    """Return sizes, masses and clearances of the bodies of the final design [SI]."""
    engine = result.final.engine
    entries = []
    for weight, distances in clearances_of(engine, weights_of(engine)):
        body, shaft = weight.body, weight.rotor.shaft
        entries.append({
            "name": weight.rotor.name, "kind": body.shape.name, **body.shape.sizes, "thickness": body.thickness,
            "density": body.density, "spacing": body.spacing, "mass": body.mass, "unbalance": body.unbalance,
            "lever": body.shape.lever, "inertia": body.inertia, "x": weight.rotor.x, "fault": weight.fault,
            "shaft": {"name": shaft.name, "y": shaft.y, "z": shaft.z, "ratio": shaft.ratio, "sense": sense_of(shaft)},
            "clearances": [
                {"part": one.part, "distance": _finite(one.minimum.distance), "lower_bound": _finite(one.minimum.bound),
                 "angle": _finite(one.minimum.angle)}
                for one in distances
            ],
        })  # fmt: skip
    return {"bodies": entries}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


SECTION = Section("workshop", applies, _tables, _record, ("bodies", "body-masses", "clearances"))
PICTURE = ResultPicture(
    "bodies", "Drawings of the weights to scale: sizes, centre of mass and title block.",
    home="laufruhe.extensions.workshop.picture",
)  # fmt: skip
