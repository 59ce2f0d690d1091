"""Engine layouts: lists of slider-cranks built from what engineers say of them.

Cylinders are counted from the front (C3).
"""

from collections.abc import Mapping

from laufruhe.extension import extended
from laufruhe.machine.layouts.banks import Boxer, Inline, Vee, XEngine, boxer, inline, vee
from laufruhe.machine.layouts.base import LayoutInput, LayoutKey, LayoutKind, Parts, rod_of
from laufruhe.machine.layouts.build import (
    Mechanism,
    Throw,
    angles_in_order,
    build,
    even_throws,
    throw_rotors,
)
from laufruhe.machine.layouts.opposed_piston import OpposedPiston, facing_pistons
from laufruhe.machine.layouts.places import Layout, stations

LAYOUTS: Mapping[str, LayoutKind] = extended(
    "layouts", LayoutKind, (Inline(), Vee(), Boxer(), OpposedPiston(), XEngine(), Parts())
)

__all__ = [
    "LAYOUTS",
    "Layout",
    "LayoutInput",
    "LayoutKey",
    "LayoutKind",
    "Mechanism",
    "Throw",
    "angles_in_order",
    "boxer",
    "build",
    "even_throws",
    "facing_pistons",
    "inline",
    "rod_of",
    "stations",
    "throw_rotors",
    "vee",
]
