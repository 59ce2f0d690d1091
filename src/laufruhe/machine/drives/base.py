"""Drives: a connecting rod to a crosshead, a piston or a frame about the crank (Klein's drive), and Scotch yoke."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from laufruhe.errors import KeyedError, ModelError
from laufruhe.machine.layouts.base import LayoutKey
from laufruhe.machine.slider_crank import SliderCrank


@dataclass(frozen=True)
class Sizes:
    """Lengths from the table [engine] of a problem file, in SI.

    Attributes
    ----------
    rod_length, rod_ratio
        Length or rod ratio of a drive that has a rod; one of them is None.
    options
        Values of the keys of this drive alone; None if the file leaves a key out.
    """

    stroke: float
    offset: float
    rod_length: float | None
    rod_ratio: float | None
    options: Mapping[str, Any]


class DriveKind:
    """Way in which a crank drives a piston rod or a ram; a new one is a file and a line in `DRIVES`.

    Attributes
    ----------
    keys
        Keys of [engine] in addition to those of every drive.
    has_rod
        True if a connecting rod swings between crank pin and piston.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[LayoutKey, ...]] = ()
    has_rod: ClassVar[bool] = True

    def radius(self, sizes: Sizes) -> float:
        """Return the crank radius that makes the stroke [m]."""
        stroke, offset, length = sizes.stroke, sizes.offset, sizes.rod_length
        s2, e2 = stroke * stroke, offset * offset
        if offset == 0.0:
            return 0.5 * stroke
        # stroke = sqrt((l + r)^2 - e^2) - sqrt((l - r)^2 - e^2), squared twice, is linear in r^2 for a given l, and
        # quadratic for a given r / l
        if length is not None and math.isfinite(length):
            l2 = length * length
            square = s2 * (4.0 * (l2 - e2) - s2) / (4.0 * (4.0 * l2 - s2)) if 4.0 * l2 > s2 else -1.0
        else:
            ratio = sizes.rod_ratio or 0.0
            k2 = ratio * ratio
            root = (s2 * (1.0 + k2)) ** 2 - 4.0 * k2 * s2 * (4.0 * e2 + s2)
            square = (s2 * (1.0 + k2) + math.sqrt(root)) / 8.0 if root >= 0.0 else -1.0
        if square <= 0.0:
            raise ModelError(
                f"no crank makes a stroke of {stroke * 1e3:.6g} mm with an offset of {offset * 1e3:.6g} mm on this "
                "rod; lengthen the rod, or reduce the offset"
            )
        return math.sqrt(square)

    def mechanism(self, plain: SliderCrank, sizes: Sizes) -> SliderCrank:  # noqa: ARG002
        """Return the mechanism of every cylinder from the numbers that all drives share; these alone by default."""
        return plain


class RodDrive(DriveKind):
    """A connecting rod between crank pin and piston or crosshead."""

    name = "slider-crank"


class Klein(DriveKind):
    """A slider-crank without a crosshead: its rod swings in a frame that joins two piston rods (Roetscher, Fig. 1068).

    It moves and loads the block as a slider-crank; the side force bends the piston rods.
    """

    name = "klein"


class ScotchYoke(DriveKind):
    """Crank pin in a slot across the piston rod, x = r (1 - cos alpha) (Roetscher, Fig. 1069, eqs. 287, 289 and 295).

    It is the slider-crank of an infinite rod.
    """

    name = "scotch-yoke"
    has_rod = False

    def radius(self, sizes: Sizes) -> float:
        """Return half the stroke."""
        if sizes.offset:
            raise KeyedError("offset", "has no effect in a Scotch yoke; remove this key")
        return super().radius(sizes)
