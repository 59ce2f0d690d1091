"""Two banks that share the throws."""

from __future__ import annotations

from laufruhe.errors import KeyedError
from laufruhe.machine.layouts.base import SPACING, LayoutInput, LayoutKey, LayoutKind
from laufruhe.machine.layouts.places import Layout, check_even, stations

STAGGER = LayoutKey("bank_stagger", "length")


def vee(cylinders: int, spacing: float, bank_angle: float, split_pin: float = 0.0, bank_stagger: float = 0.0) -> Layout:
    """Return two banks on shared or split pins.

    Parameters
    ----------
    cylinders
        Even number: the left bank, leaning to +y, has numbers 1 to n/2, the right bank the rest.
    spacing
        Between throws [m].
    bank_angle
        Between the banks [rad].
    split_pin
        Angle by which the right bank's pin leads the left bank's on one throw [rad].
    bank_stagger
        Distance by which the left bank stands forward of the right one [m].
    """
    check_even(cylinders, "a vee")
    throws = cylinders // 2
    places = stations(throws, spacing)
    half = 0.5 * bank_stagger
    sides = (0.5,) * throws + (-0.5,) * throws
    return Layout(
        "vee",
        tuple(x + half for x in places) + tuple(x - half for x in places),
        tuple(side * bank_angle for side in sides),
        (*range(throws), *range(throws)),
        tuple(-side * split_pin for side in sides),
        places,
        sides,
    )


class Vee(LayoutKind):
    """Two banks with a throw for each pair of cylinders."""

    name = "vee"
    keys = (
        SPACING,
        LayoutKey("bank_angle", "open angle", "Angle between the banks of a vee."),
        LayoutKey("split_pin_angle", "open angle", "Angle by which the right bank's crank pin leads."),
        STAGGER,
    )  # fmt: skip
    openable = ("throws", "firing_order", "bank_angle", "split_pin_angle")
    cylinders_per_throw = 2
    banks = 2

    def place(self, inputs: LayoutInput) -> Layout:
        """Return two banks on shared or split pins."""
        options = inputs.options
        if options["bank_angle"] is None:
            raise KeyedError("bank_angle", "is missing; add the angle between the banks, or its bounds")
        split, stagger = options["split_pin_angle"] or 0.0, options["bank_stagger"] or 0.0
        return vee(
            inputs.cylinders,
            inputs.spacing(inputs.cylinders // self.banks),
            options["bank_angle"],
            split,
            stagger,
        )
