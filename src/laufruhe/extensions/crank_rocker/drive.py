"""Drive by a crank-rocker, whose rocker moves the piston by a rod."""

from __future__ import annotations

import cmath
import math
from typing import Any

from laufruhe.errors import KeyedError, ModelError
from laufruhe.extensions.crank_rocker.mechanism import LINKS, CrankRocker
from laufruhe.machine.drives.base import DriveKind, Sizes
from laufruhe.machine.layouts.base import LayoutKey
from laufruhe.machine.slider_crank import SliderCrank, as_kind
from laufruhe.numerics.roots import rising_root

_SIZES = (
    LayoutKey("rocker_pivot_along", "length", "From the crank axis to the rocker's pivot, along the cylinder axis."),
    LayoutKey("rocker_pivot_across", "length", "From the crank axis to the rocker's pivot, across that axis."),
    LayoutKey("coupler_length", "positive length", "From the crank pin to the coupler's pin on the rocker."),
    LayoutKey("rocker_arm", "positive length", "From the rocker's pivot to the coupler's pin."),
    LayoutKey("rocker_end", "positive length", "From the rocker's pivot to the piston rod's pin."),
    LayoutKey("piston_rod_length", "positive length", "From the rocker to the piston pin."),
)
_ROUNDING = 1e-9


class CrankRockerDrive(DriveKind):
    """Drive whose stroke and links determine the crank radius (K23)."""

    name = "crank-rocker"
    has_rod = False
    keys = (
        *_SIZES,
        LayoutKey("rocker_angle", "angle", "Of the piston rod's pin after the coupler's pin, about the pivot.", 0.0),
        LayoutKey(
            "rocker_side", "sign", "1: coupler's pin to the left of the line from crank pin to pivot; -1: right.", 1
        ),
        LayoutKey("coupler", "rod", "As a rigid body, its centre of gravity from the crank pin."),
        LayoutKey(
            "rocker", "rod", "As a rigid body, its centre of gravity from the pivot towards the piston rod's pin."
        ),
        LayoutKey("piston_rod", "rod", "As a rigid body, its centre of gravity from the rocker."),
    )

    def radius(self, sizes: Sizes) -> float:
        """Return the crank radius that makes the stroke [m]."""
        for key in _SIZES:
            if sizes.options[key.name] is None:
                raise KeyedError(key.name, "is missing; add it")
        linkage = _linkage(sizes)
        coupler, arm, distance = linkage["coupler_length"], linkage["arm"], abs(linkage["pivot"])
        largest = min(coupler + arm - distance, distance - abs(coupler - arm), coupler)
        if largest <= 0.0:
            low, high = 1e3 * abs(distance - arm), 1e3 * (distance + arm)
            rule = f"lets no crank turn; give {low:.5g} to {high:.5g} mm, for a pivot {1e3 * distance:.5g} mm away"
            raise KeyedError("coupler_length", rule, f"{1e3 * coupler:g} mm")

        def linked(radius: float) -> CrankRocker:
            return CrankRocker("the linkage", 0.0, radius, math.inf, 0.0, **linkage)

        def excess(radius: float) -> float:
            try:
                return linked(radius).stroke - sizes.stroke
            except ModelError:
                return sizes.stroke

        radius = rising_root(excess, _ROUNDING * largest, (1.0 - _ROUNDING) * largest)
        if abs((reached := linked(radius).stroke) - sizes.stroke) > _ROUNDING * sizes.stroke:
            if radius < 0.99 * largest:
                # a larger crank tells what stops it
                linked(1.001 * radius)
            rule = f"is more than this linkage makes, {1e3 * reached:.5g} mm; reduce it, or lengthen rocker_end"
            raise KeyedError("stroke", rule, f"{1e3 * sizes.stroke:g} mm")
        return radius

    def mechanism(self, plain: SliderCrank, sizes: Sizes) -> CrankRocker:
        """Return the mechanism with coupler, rocker and piston rod."""
        numbers, masses = sizes.options, dict[str, float]()
        for link, length in zip(LINKS, ("coupler_length", "rocker_end", "piston_rod_length"), strict=True):
            if (body := numbers[link]) is not None:
                share = body["centre_of_gravity"] / numbers[length]
                masses |= {f"{link}_mass": body["mass"], f"{link}_share": share, f"{link}_inertia": body["inertia"]}
        return as_kind(CrankRocker, plain, **_linkage(sizes), **masses)


def _linkage(sizes: Sizes) -> dict[str, Any]:
    numbers = sizes.options
    return {
        "pivot": complex(numbers["rocker_pivot_along"], numbers["rocker_pivot_across"]),
        "coupler_length": numbers["coupler_length"], "arm": numbers["rocker_arm"],
        "end": cmath.rect(numbers["rocker_end"], numbers["rocker_angle"]), "side": numbers["rocker_side"],
        "piston_rod_length": numbers["piston_rod_length"], "piston_offset": sizes.offset,
    }  # fmt: skip


CRANK_ROCKER = CrankRockerDrive()
