"""Tables of counterweights and balancer weights in g, g mm and degrees, and of balance factors."""

from __future__ import annotations

import cmath
import math

from laufruhe.machine import Role, Rotor
from laufruhe.physics.balance_factor import balance_factors
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import DASH, fixed, number, trimmed
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result

GRAMS = 1e3
GRAM_MILLIMETRES = 1e6
NEXT_TO_NOTHING = 1e-9
_ANGLES = "Angles at a crank angle of 0, clockwise from the top, seen from the front (C4)."
_FACTOR = (
    "Share of the reciprocating mass of a throw that its counterweights balance, beyond the rotating mass; "
    "a counterweight counts for the nearest throw."
)


def weights(result: Result) -> list[Table]:
    """Return a table of the counterweights and balancers of the final design, a row for each."""
    before = {rotor.name: rotor for rotor in result.initial.engine.rotors}
    rotors = [r for r in result.final.engine.rotors if r.role in (Role.COUNTERWEIGHT, Role.BALANCER)]
    scale, two, rows = max((abs(rotor.unbalance) for rotor in rotors), default=0.0), is_changed(result), []
    for rotor in rotors:
        initial = before.get(rotor.name, rotor)
        if max(abs(rotor.unbalance), abs(initial.unbalance)) <= NEXT_TO_NOTHING * scale:
            continue
        mass, radius = DASH, DASH
        if rotor.radius is not None:
            mass, radius = number(GRAMS * rotor.mass, scale=GRAMS * scale / rotor.radius), trimmed(1e3 * rotor.radius)
        lead = _in_grams(initial, scale) if two else ()
        rows.append((rotor.name, trimmed(1e3 * rotor.x), *lead, *_in_grams(rotor, scale),
                     number(abs(rotor.unbalance), scale=scale), mass, radius))  # fmt: skip
    sides = ("initial ", "final ") if two else ("",)
    sizes = [f"{side}{what} [{unit}]" for side in sides for what, unit in (("unbalance", "g mm"), ("angle", "deg"))]
    head = ("weight", "x [mm]", *sizes, f"{sides[-1]}unbalance [kg m]", "mass [g]", "at radius [mm]")
    title = "Weights" + (" of the final design" if two else "")
    return [Table(head, rows, title=title, note=_ANGLES, file="weights")]


def _in_grams(rotor: Rotor, scale: float) -> tuple[str, str]:
    size = abs(rotor.unbalance)
    if size <= NEXT_TO_NOTHING * scale:
        return "0", DASH
    angle = round(math.degrees(cmath.phase(rotor.unbalance)) % 360.0, 4) % 360.0
    return number(GRAM_MILLIMETRES * size), trimmed(angle, 5)


def factors(result: Result) -> list[Table]:
    """Return a table of balance factors, a row for each throw with counterweights."""
    designs = [result.initial, result.final] if is_changed(result) else [result.final]
    names = dict.fromkeys(balance.cylinders for design in designs for balance in balance_factors(design.engine))
    # a weight that a design lacks counts as zero there
    columns = [
        {balance.cylinders: f"{fixed(100.0 * balance.factor, 1)} %" for balance in balance_factors(design.engine, True)}
        for design in designs
    ]
    rows = [(", ".join(cylinders), *(column.get(cylinders, DASH) for column in columns)) for cylinders in names]
    head = ("throw of", *(("initial", "final") if len(designs) > 1 else ("balance factor",)))
    return [Table(head, rows, title="Balance factors", note=_FACTOR, file="balance-factors")]
