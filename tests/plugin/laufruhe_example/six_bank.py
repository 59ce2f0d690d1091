"""Six banks that share the throws."""

from __future__ import annotations

import math

from laufruhe.errors import ModelError
from laufruhe.machine.layouts.base import LayoutInput, LayoutKind
from laufruhe.machine.layouts.places import Layout, stations

BANKS = tuple(math.radians(angle) for angle in (0.0, 60.0, 120.0, 180.0, 240.0, 300.0))


class SixBank(LayoutKind):
    """Six banks at 60 degrees, a throw for six cylinders."""

    name = "six-bank"
    cylinders_per_throw = 6
    banks = 6

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the places bank by bank."""
        if inputs.cylinders % 6:
            raise ModelError(f"six banks need six cylinders a throw, got {inputs.cylinders}")
        throws = inputs.cylinders // 6
        places = stations(throws, inputs.spacing(throws))
        banks = tuple(bank for bank in BANKS for _ in range(throws))
        return Layout("six-bank", places * 6, banks, (*range(throws),) * 6, (0.0,) * inputs.cylinders, places)


SIX_BANK = SixBank()
