"""Channels of loads inside the crankcase: pistons, rods, crank pins and main bearings (B1-B9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from laufruhe.extensions.bearing_loads import physics
from laufruhe.extensions.bearing_loads.machine import bearings_of
from laufruhe.machine import Engine
from laufruhe.present.numbers import with_unit
from laufruhe.problem.channels import (
    AT_CYLINDERS,
    IN_EACH_CYLINDER,
    OF_VECTOR,
    ON_BLOCK,
    Display,
    Need,
    Needs,
    PlaceSpec,
    crankcase_channel,
    names_of_cylinders,
)

BEARINGS = Need(bearings_of, "main bearings", "list them in [[main_bearings]]")


def _names_of_bearings(engine: Engine) -> Sequence[str]:
    return [bearing.name for bearing in bearings_of(engine)]


def _rubs(engine: Engine) -> bool:
    return physics.has_bearing_loads(engine) and all(b.friction is not None for b in bearings_of(engine))


def _pin_note(problem: Any) -> str:
    # mass whose pull the crank-pin forces include (B3)
    masses = [part.rotating_mass for part in problem.engine.slider_cranks if part.master_bank is None]
    if not any(masses):
        return (
            "Crank-pin forces have no pull of a big end, because no [engine.rod] gives its mass; rotating_mass of a "
            "throw loads the main bearings alone."
        )
    masses_text = " to ".join(dict.fromkeys(with_unit(mass, "kg") for mass in (min(masses), max(masses))))
    return f"Crank-pin forces include the pull of a rotating mass of {masses_text} at each pin."


AT_EACH_BEARING: PlaceSpec = ((*OF_VECTOR, "bearings"), BEARINGS, _names_of_bearings)
_OF_EACH_BEARING: PlaceSpec = ((*ON_BLOCK, "bearings"), BEARINGS, _names_of_bearings)
_AT_EACH_CRANK_PIN: PlaceSpec = (AT_CYLINDERS, Needs.UNCONDITIONAL, names_of_cylinders)
HAMMER_BLOW = crankcase_channel("hammer blow", "N", _OF_EACH_BEARING, physics.hammer_blows)
MAIN_BEARING_FORCE = crankcase_channel(
    "main-bearing force", "N", AT_EACH_BEARING, physics.main_bearing_forces,
    display=Display("Main-bearing forces", "bearing", "main_bearings", "force on", physics.has_bearing_loads),
)  # fmt: skip
MAIN_BEARING_PRESSURE = crankcase_channel(
    "main-bearing pressure", "Pa", AT_EACH_BEARING, physics.main_bearing_forces, physics.bearing_factors
)
CRANK_PIN_FORCE = crankcase_channel(
    "crank-pin force", "N", _AT_EACH_CRANK_PIN, physics.pin_forces,
    display=Display(
        "Crank-pin forces", "cylinder", "crank_pins", "force on pin of", physics.has_bearing_loads, _pin_note
    ),
)  # fmt: skip
CRANK_PIN_PRESSURE = crankcase_channel(
    "crank-pin pressure", "Pa", _AT_EACH_CRANK_PIN, physics.pin_forces, physics.crank_pin_factors,
    Display(applies=lambda _: False, note=_pin_note),
)  # fmt: skip
SIDE_FORCE = crankcase_channel(
    "side force", "N", IN_EACH_CYLINDER,
    lambda *at: physics.piston_pin_forces(*at).mapped(lambda values: values[..., 1:]),
)  # fmt: skip
ROD_FORCE = crankcase_channel("rod force", "N", IN_EACH_CYLINDER, physics.piston_pin_forces)
FRICTION_POWER = replace(
    crankcase_channel("friction power", "W", _OF_EACH_BEARING, physics.main_bearing_forces, physics.drag_factors),
    sums_places=True, keys=("operating_points", "orders", "bearings"),
    display=Display("Friction power of main bearings", "bearing", "friction", applies=_rubs),
)  # fmt: skip
