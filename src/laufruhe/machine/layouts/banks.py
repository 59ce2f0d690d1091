"""Banks of cylinders at equal distances: in line, vee, boxer and X."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from laufruhe.errors import KeyedError
from laufruhe.machine.layouts.base import (
    FIRST_BANK,
    FIRST_END,
    NUMBERING,
    ROW_ANGLE,
    SPACING,
    LayoutInput,
    LayoutKey,
    LayoutKind,
)
from laufruhe.machine.layouts.places import Layout, stations

STAGGER = LayoutKey("bank_stagger", "length")
X_BANKS = tuple(math.radians(angle) for angle in (45.0, -45.0, 135.0, -135.0))


def in_banks(
    name: str, cylinders: int, spacing: float | Sequence[float], banks: Sequence[float], stagger: float = 0.0
) -> Layout:
    """Return the layout of cylinder banks at these angles [rad] on shared throws, numbered bank by bank.

    The throws are `spacing` apart, one distance or each from the front [m]. The first of two banks stands forward by
    `stagger` [m].
    """
    throws, others = divmod(cylinders, len(banks))
    if others or not throws:
        rule = f"is no multiple of the {len(banks)} banks of layout '{name}'; give one that is"
        raise KeyedError("cylinders", rule, str(cylinders))
    places = stations(throws, spacing)
    return Layout(
        name,
        tuple(x + (0.5 - k) * stagger for k in range(len(banks)) for x in places),
        tuple(bank for bank in banks for _ in places),
        (*range(throws),) * len(banks),
        (0.0,) * cylinders,
        places,
    )


def inline(cylinders: int, spacing: float | Sequence[float]) -> Layout:
    """Return a single upright bank."""
    return in_banks("inline", cylinders, spacing, (0.0,))


def vee(
    cylinders: int,
    spacing: float | Sequence[float],
    bank_angle: float,
    split_pin: float = 0.0,
    bank_stagger: float = 0.0,
) -> Layout:
    """Return two banks on shared or split pins.

    The left bank, leaning to +y, has numbers 1 to n/2. Its pins are behind those of the right bank by the angle of
    split pins [rad], and it stands forward by the stagger [m].
    """
    layout = in_banks("vee", cylinders, spacing, (0.5 * bank_angle, -0.5 * bank_angle), bank_stagger)
    sides = tuple(side for side in (0.5, -0.5) for _ in layout.throw_positions)
    return replace(layout, sides=sides, pin_offsets=tuple(-side * split_pin for side in sides))


def boxer(cylinders: int, spacing: float | Sequence[float], bank_stagger: float) -> Layout:
    """Return two opposed banks, with every cylinder on a throw of its own and opposed pistons in step."""
    layout = in_banks("boxer", cylinders, spacing, (0.5 * math.pi, -0.5 * math.pi), bank_stagger)
    return replace(layout, pins=tuple(range(cylinders)), throw_positions=layout.positions)


def in_rows(layout: Layout, inputs: LayoutInput) -> Layout:
    """Return the layout with the cylinders of every bank alternately in two rows.

    A row leans by half of the angle between rows. An offset lies on the outer side of every row, so that pistons reach
    their dead centre later than the axis says.
    """
    angle = inputs.options["row_angle"]
    if not angle:
        return layout
    # throws are still counted from the front
    leans = [0.5 * angle * (-1.0) ** pin for pin in layout.pins]
    layout = replace(layout, banks=tuple(bank + lean for bank, lean in zip(layout.banks, leans, strict=True)))
    offsets = [inputs.at_place(place).mechanism.part.offset for place in range(inputs.cylinders)]
    if not any(offsets):
        return layout
    signed = (math.copysign(offset, lean * offset) for offset, lean in zip(offsets, leans, strict=True))
    return replace(layout, offsets=tuple(signed))


class Inline(LayoutKind):
    """Single bank with a throw for every cylinder."""

    name = "inline"
    keys: ClassVar[tuple[LayoutKey, ...]] = (SPACING, ROW_ANGLE, *NUMBERING, FIRST_END)
    openable: ClassVar[tuple[str, ...]] = ("throws", "firing_order")

    def place(self, inputs: LayoutInput) -> Layout:
        """Return a single upright bank."""
        return in_rows(inline(inputs.cylinders, inputs.spacing(inputs.cylinders)), inputs)


class Vee(LayoutKind):
    """Two banks with a throw for each pair of cylinders."""

    name = "vee"
    keys = (
        SPACING,
        LayoutKey("bank_angle", "open angle", "Angle between the banks of a vee."),
        LayoutKey("split_pin_angle", "open angle", "Angle by which the right bank's crank pin leads; 0 by default."),
        STAGGER,
        ROW_ANGLE,
        *NUMBERING,
        FIRST_BANK,
        FIRST_END,
    )  # fmt: skip
    openable = ("throws", "firing_order", "bank_angle", "split_pin_angle")
    cylinders_per_throw = 2
    banks = 2

    def place(self, inputs: LayoutInput) -> Layout:
        """Return two banks on shared or split pins."""
        count, options = inputs.cylinders, inputs.options
        if options["bank_angle"] is None:
            raise KeyedError("bank_angle", "is missing; add the angle between the banks, or its bounds")
        split, stagger = options["split_pin_angle"] or 0.0, options["bank_stagger"] or 0.0
        layout = vee(count, inputs.spacing(count // self.banks), options["bank_angle"], split, stagger)
        return in_rows(layout, inputs)


class Boxer(LayoutKind):
    """Opposed banks with a throw for every cylinder."""

    name = "boxer"
    keys = (SPACING, STAGGER, *NUMBERING, FIRST_BANK, FIRST_END)
    banks = 2

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the layout of a boxer engine: two banks at 180 degrees, each cylinder on its own throw."""
        count, stagger = inputs.cylinders, inputs.options["bank_stagger"]
        if stagger is None:
            raise KeyedError("bank_stagger", "is missing; add the distance between opposed cylinders")
        return boxer(count, inputs.spacing(count // self.banks), stagger)


class XEngine(LayoutKind):
    """Four banks at right angles, a throw for four cylinders: upper left, upper right, lower left, lower right."""

    name = "x-engine"
    keys = (SPACING, *NUMBERING, FIRST_BANK, FIRST_END)
    cylinders_per_throw = 4
    banks = 4

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the layout with cylinders numbered bank by bank."""
        return in_banks(self.name, inputs.cylinders, inputs.spacing(inputs.cylinders // 4), X_BANKS)
