"""Rhombic drive: each slider-crank of the file is one of its two cranks."""

from __future__ import annotations

from laufruhe.errors import KeyedError
from laufruhe.extensions.rhombic.mechanism import RhombicHalf
from laufruhe.machine.drives.base import DriveKind, Sizes
from laufruhe.machine.layouts.base import LayoutKey
from laufruhe.machine.slider_crank import SliderCrank, as_kind


class RhombicDrive(DriveKind):
    """Two equal rods on each crank pin, one up to the power piston and one down to the displacer (Meijer 1959)."""

    name = "rhombic"
    keys = (
        LayoutKey("displacer_mass", "open mass", "Half the mass of the displacer of a rhombic drive, with its yoke."),
    )

    def mechanism(self, plain: SliderCrank, sizes: Sizes) -> RhombicHalf:
        """Return one crank with its halves of both pistons."""
        displacer = sizes.options["displacer_mass"]
        if displacer is None:
            raise KeyedError("displacer_mass", "is missing; add half the mass of the displacer with its yoke")
        if plain.rotating_mass:
            rule = "stands for one of two rods on a crank pin; add the shares of both to the masses, and leave it out"
            raise KeyedError("rod", rule)
        return as_kind(RhombicHalf, plain, displacer_mass=displacer)


RHOMBIC = RhombicDrive()
