"""Crank pin in a slot across the piston rod: the slider-crank of an infinite rod (Roetscher, Fig. 1069)."""

from __future__ import annotations

from laufruhe.errors import KeyedError
from laufruhe.machine.drives.base import Sizes
from laufruhe.machine.drives.slider_crank import RodDrive


class ScotchYoke(RodDrive):
    """Drive with x = r (1 - cos alpha), eqs. 287, 289 and 295."""

    name = "scotch-yoke"
    has_rod = False

    def radius(self, sizes: Sizes) -> float:
        """Return half the stroke."""
        if sizes.offset:
            raise KeyedError("offset", "means nothing in a Scotch yoke; leave it out")
        return super().radius(sizes)
