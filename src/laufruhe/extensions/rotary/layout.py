"""Rotors on the eccentrics of one shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from laufruhe import units
from laufruhe.errors import KeyedError
from laufruhe.extensions.rotary.unit import FLANKS, RotaryUnit
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts.banks import Inline
from laufruhe.machine.layouts.base import LayoutKey
from laufruhe.machine.layouts.build import Mechanism


class Rotary(Inline):
    """Rotors in a row on one shaft, each firing once a turn."""

    name = "rotary"
    has_pistons = False
    single = ("rotor_mass", "rotor_inertia", "rotating_mass")
    keys = (
        *Inline.keys,
        LayoutKey("eccentricity", "positive length", "Eccentricity of the shaft under every rotor."),
        LayoutKey("rotor_radius", "positive length", "Distance from a rotor's centre to its apexes."),
        LayoutKey("rotor_width", "positive length", "Width along the shaft."),
        LayoutKey("rotor_mass", "mass", "Mass of a rotor with its seals; rotating_mass is that of the eccentric."),
        LayoutKey("rotor_inertia", "inertia", "Moment of inertia of a rotor about its centre.", 0.0),
    )

    def cycle(self, cycle: Cycle) -> Cycle:
        """Return the cycle of a rotor, one turn of the shaft; each chamber takes three turns for four strokes."""
        if cycle is not Cycle.FOUR_STROKE:
            raise KeyedError("cycle", "does not fit a rotary engine, whose chambers make four strokes", str(cycle))
        return Cycle.TWO_STROKE

    def mechanism(self, options: Mapping[str, Any], **shared: Any) -> Mechanism:
        """Return the mechanism of a rotary (Wankel) engine's rotor and eccentric."""
        for key in ("eccentricity", "rotor_radius", "rotor_width", "rotor_mass"):
            if options[key] is None:
                raise KeyedError(key, "is missing; add it")
        shortest, radius = FLANKS * options["eccentricity"], options["rotor_radius"]
        if radius <= shortest:
            limit = units.quantity_text(shortest, "m")
            rule = f"does not let the rotor turn, it must be over three eccentricities, {limit}"
            raise KeyedError("rotor_radius", f"{rule}; enlarge it", units.quantity_text(radius, "m"))
        rotor_numbers = {key: options[key] for key in ("rotor_radius", "rotor_width", "rotor_inertia")}
        mass = options["rotor_mass"]
        unit = RotaryUnit(
            f"{RotaryUnit.noun} 1", 0.0, options["eccentricity"], math.inf, 0.0, rotating_mass=mass,
            big_end=shared["big_end"], **rotor_numbers,
        )  # fmt: skip
        return Mechanism(unit, shared["rotating_mass"])


ROTARY = Rotary()
