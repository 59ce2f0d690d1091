"""Connecting rod to a crosshead, a piston or a frame about the crank (Klein's drive), and Scotch yoke."""

from __future__ import annotations

from laufruhe.errors import KeyedError
from laufruhe.machine.drives.base import DriveKind, Sizes


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
            raise KeyedError("offset", "means nothing in a Scotch yoke; leave it out")
        return super().radius(sizes)
