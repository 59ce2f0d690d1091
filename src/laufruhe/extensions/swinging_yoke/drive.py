"""Drive by a slotted lever with a slow stroke and a quick return (Roetscher, Figs. 1071 to 1073)."""

from __future__ import annotations

import math
from typing import Any

from laufruhe.errors import KeyedError
from laufruhe.extensions.swinging_yoke.mechanism import SwingingYoke
from laufruhe.machine.drives.base import DriveKind, Sizes
from laufruhe.machine.layouts.base import LayoutKey
from laufruhe.machine.slider_crank import SliderCrank, as_kind


class SwingingYokeDrive(DriveKind):
    """Drive whose stroke and return ratio determine crank radius and lever length over pivot distance (K15)."""

    name = "swinging-yoke"
    has_rod = False
    keys = (
        LayoutKey("pivot_distance", "positive length", "From the crank axis to the pivot of a swinging yoke."),
        LayoutKey("return_ratio", "ratio", "Time of the slow stroke over that of the quick one, of a swinging yoke."),
        LayoutKey(
            "lever_length", "positive length", "From pivot to ram, of a swinging yoke, in place of return_ratio."
        ),
        LayoutKey("lever", "rod", "Of a swinging yoke, as a rigid body, its centre of gravity from the pivot."),
        LayoutKey("lever_weight", "open mass", "Behind the pivot of a swinging yoke."),
        LayoutKey("lever_weight_radius", "positive length", "Of lever_weight, from the pivot."),
    )

    def radius(self, sizes: Sizes) -> float:
        """Return the crank radius [m]: pivot distance times the sine of half the excess angle of the slow stroke."""
        numbers = sizes.options
        pivot, ratio, length = numbers["pivot_distance"], numbers["return_ratio"], numbers["lever_length"]
        if pivot is None:
            raise KeyedError("pivot_distance", "is missing; add the distance between crank and pivot")
        if (ratio is None) == (length is None):
            state = "is missing" if ratio is None else "is given beside lever_length"
            raise KeyedError(
                "return_ratio", f"{state}; give either return_ratio (slow by quick stroke) or lever_length"
            )
        if ratio is not None and not ratio > 1.0:
            rule = "makes no quick return; give more than 1, 1.2 to 2 is usual"
            raise KeyedError("return_ratio", rule, f"{ratio:g}")
        share = math.cos(math.pi / (1.0 + ratio)) if ratio is not None else 0.5 * sizes.stroke / length
        if share >= 1.0:
            if ratio is not None:
                raise KeyedError(
                    "return_ratio", "puts the pivot on the crank circle; give a smaller ratio", f"{ratio:g}"
                )
            rule = "is too short, no crank inside its swing makes this stroke; make it longer"
            raise KeyedError("lever_length", rule, f"{1e3 * length:g} mm")
        return float(pivot * share)

    def mechanism(self, plain: SliderCrank, sizes: Sizes) -> SwingingYoke:
        """Return the mechanism with lever, lever weight and ram path."""
        numbers, pivot = sizes.options, sizes.options["pivot_distance"]
        length = 0.5 * sizes.stroke * pivot / plain.crank_radius
        if numbers["lever_weight"] and numbers["lever_weight_radius"] is None:
            raise KeyedError(
                "lever_weight_radius",
                "is missing, but lever_weight is given; add the distance of the weight from the pivot",
            )
        lever_numbers: dict[str, Any] = {
            "pivot": pivot, "lever_length": length, "ram_height": sizes.offset,
            "lever_weight": numbers["lever_weight"] or 0.0,
            "lever_weight_radius": numbers["lever_weight_radius"] or 0.0,
        }  # fmt: skip
        if numbers["lever"] is not None:
            names = {"mass": "lever_mass", "centre_of_gravity": "lever_centre", "inertia": "lever_inertia"}
            lever_numbers |= {name: numbers["lever"][key] for key, name in names.items()}
        return as_kind(SwingingYoke, plain, **lever_numbers)


SWINGING_YOKE = SwingingYokeDrive()
