"""Opposed banks with a throw for every cylinder."""

from __future__ import annotations

import math

from laufruhe.errors import KeyedError
from laufruhe.machine.layouts.base import SPACING, LayoutInput, LayoutKind
from laufruhe.machine.layouts.places import Layout, check_even, stations
from laufruhe.machine.layouts.vee import STAGGER


def boxer(cylinders: int, spacing: float, bank_stagger: float) -> Layout:
    """Banks at 180 degrees, every cylinder on a throw of its own, opposed pistons in step.

    Parameters
    ----------
    cylinders
        Even number: the left bank has numbers 1 to n/2, the right bank the rest.
    spacing
        Between neighbours of one bank [m].
    bank_stagger
        Distance by which a left cylinder stands forward of its opposite [m].
    """
    check_even(cylinders, "a boxer")
    count, half, quarter = cylinders // 2, 0.5 * bank_stagger, 0.5 * math.pi
    centres = stations(count, spacing)
    places = tuple(x + half for x in centres) + tuple(x - half for x in centres)
    banks = (quarter,) * count + (-quarter,) * count
    return Layout("boxer", places, banks, tuple(range(cylinders)), (0.0,) * cylinders, places)


class Boxer(LayoutKind):
    """Opposed banks."""

    name = "boxer"
    keys = (SPACING, STAGGER)
    banks = 2

    def place(self, inputs: LayoutInput) -> Layout:
        """Banks at 180 degrees."""
        if inputs.options["bank_stagger"] is None:
            raise KeyedError("bank_stagger", "is missing; add the distance between opposed cylinders")
        return boxer(
            inputs.cylinders,
            inputs.spacing(inputs.cylinders // self.banks),
            inputs.options["bank_stagger"],
        )
