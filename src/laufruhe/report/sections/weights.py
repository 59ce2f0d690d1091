"""Tables of counterweights and balancer weights, of their shafts, and of balance factors."""

from __future__ import annotations

import cmath
import math

from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.physics.balance_factor import balance_factors
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import DASH, fixed, number, trimmed
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.units import readable, readable_unbalance

NEXT_TO_NOTHING = 1e-9
_ANGLES = "Angles at a crank angle of 0, clockwise from the top, seen from the front (C4)."
_SHAFTS = "y to the left, z up from the crank axis (C2). Seen from the front the crank turns clockwise (C3)."
_FACTOR = (
    "Share of the reciprocating mass of a throw that its counterweights balance, beyond the rotating mass; "
    "a counterweight counts for the nearest throw."
)


def weights(result: Result) -> list[Table]:
    """Return a table of the counterweights and balancers of the final design, a row for each."""
    (length, millimetres), (mass_unit, grams) = readable("m"), readable("kg", "g")
    before = {rotor.name: rotor for rotor in result.initial.engine.rotors}
    rotors = [r for r in result.final.engine.rotors if r.role in (Role.COUNTERWEIGHT, Role.BALANCER)]
    scale, two, rows = max((abs(rotor.unbalance) for rotor in rotors), default=0.0), is_changed(result), []
    pairs = [(before.get(rotor.name, rotor), rotor) for rotor in rotors]
    unbalance, size = readable_unbalance(max((abs(rotor.unbalance) for pair in pairs for rotor in pair), default=0.0))
    has_si = unbalance != "kg m"
    for initial, rotor in pairs:
        if max(abs(rotor.unbalance), abs(initial.unbalance)) <= NEXT_TO_NOTHING * scale:
            continue
        mass, radius = DASH, DASH
        if rotor.radius is not None:
            mass = number(grams * rotor.mass, scale=grams * scale / rotor.radius)
            radius = trimmed(millimetres * rotor.radius)
        lead = _size_and_angle(initial, scale, size) if two else ()
        rows.append((rotor.name, trimmed(millimetres * rotor.x), *lead, *_size_and_angle(rotor, scale, size),
                     *[number(abs(rotor.unbalance), scale=scale)] * has_si, mass, radius))  # fmt: skip
    sides = ("initial ", "final ") if two else ("",)
    sizes = [f"{side}{what} [{unit}]" for side in sides for what, unit in (("unbalance", unbalance), ("angle", "deg"))]
    head = ("weight", f"x [{length}]", *sizes, *[f"{sides[-1]}unbalance [kg m]"] * has_si, f"mass [{mass_unit}]",
            f"at radius [{length}]")  # fmt: skip
    title = "Weights" + (" of the final design" if two else "")
    return [Table(head, rows, title=title, note=_ANGLES, file="weights")]


def _size_and_angle(rotor: Rotor, scale: float, factor: float) -> tuple[str, str]:
    size = abs(rotor.unbalance)
    if size <= NEXT_TO_NOTHING * scale:
        return "0", DASH
    angle = round(math.degrees(cmath.phase(rotor.unbalance)) % 360.0, 4) % 360.0
    return number(factor * size), trimmed(angle, 5)


def sense_of(shaft: Shaft) -> str:
    """Return the sense of rotation of a shaft in words."""
    return "with the crank" if shaft.ratio > 0.0 else "against the crank"


def shafts(result: Result) -> list[Table]:
    """Return a table of the place, ratio and sense of the shafts of the final design, if there are several."""
    (length, millimetres), engine = readable("m"), result.final.engine
    all_shafts = dict.fromkeys(
        [*(part.shaft for part in engine.slider_cranks), *(rotor.shaft for rotor in engine.rotors)]
    )
    rows = [
        (
            shaft.name,
            trimmed(millimetres * shaft.y),
            trimmed(millimetres * shaft.z),
            f"{shaft.ratio:+g}",
            sense_of(shaft),
        )
        for shaft in all_shafts
    ]
    head = ("shaft", f"y [{length}]", f"z [{length}]", "ratio", "turns")
    is_shown = set(all_shafts) != {CRANKSHAFT}
    return [Table(head, rows, title="Shafts", left=(0, 4), note=_SHAFTS, file="shafts")] if is_shown else []


def factors(result: Result) -> list[Table]:
    """Return a table of balance factors, a row for each throw with counterweights."""
    designs = [result.initial, result.final] if is_changed(result) else [result.final]
    columns = [
        {balance.cylinders: f"{fixed(100.0 * balance.factor, 1)} %" for balance in balance_factors(design.engine)}
        for design in designs
    ]
    names = dict.fromkeys(cylinders for column in columns for cylinders in column)
    rows = [(", ".join(cylinders), *(column.get(cylinders, "no weight") for column in columns)) for cylinders in names]
    head = ("throw of", *(("initial", "final") if len(designs) > 1 else ("balance factor",)))
    return [Table(head, rows, title="Balance factors", note=_FACTOR, file="balance-factors")]
