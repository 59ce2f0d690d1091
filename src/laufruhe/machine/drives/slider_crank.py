"""Crank and connecting rod; the pin in a crosshead, in the piston, or in a frame about the crank (Klein's drive)."""

from __future__ import annotations

from laufruhe.machine.drives.base import DriveKind, Sizes
from laufruhe.machine.layouts.build import Mechanism


class RodDrive(DriveKind):
    """A connecting rod between crank pin and piston or crosshead."""

    name = "slider-crank"

    def mechanism(self, plain: Mechanism, _: Sizes) -> Mechanism:
        """Return the mechanism unchanged."""
        return plain


class Klein(RodDrive):
    """A slider-crank without a crosshead: its rod swings in a frame that joins two piston rods (Roetscher, Fig. 1068).

    It moves and loads the block as a slider-crank; the side force bends the piston rods.
    """

    name = "klein"
