"""Four banks that share the throws, in the shape of an X."""

from __future__ import annotations

import math

from laufruhe.errors import ModelError
from laufruhe.machine.layouts.base import LayoutInput, LayoutKind
from laufruhe.machine.layouts.places import Layout, stations

BANKS = tuple(math.radians(angle) for angle in (45.0, -45.0, 135.0, -135.0))


class XEngine(LayoutKind):
    """Four banks at right angles, a throw for four cylinders."""

    name = "x-engine"
    cylinders_per_throw = 4
    banks = 4

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the places: bank by bank, upper left, upper right, lower left, lower right."""
        if inputs.cylinders % 4:
            raise ModelError(f"an x needs four cylinders a throw, got {inputs.cylinders}")
        throws = inputs.cylinders // 4
        places = stations(throws, inputs.spacing(throws))
        banks = tuple(bank for bank in BANKS for _ in range(throws))
        return Layout("x-engine", places * 4, banks, (*range(throws),) * 4, (0.0,) * inputs.cylinders, places)
