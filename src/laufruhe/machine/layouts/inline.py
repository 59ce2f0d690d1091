"""Cylinders in line."""

from __future__ import annotations

from typing import ClassVar

from laufruhe.machine.layouts.base import LayoutInput, LayoutKind
from laufruhe.machine.layouts.places import Layout, stations


def inline(cylinders: int, spacing: float) -> Layout:
    """Return a single upright bank."""
    places = stations(cylinders, spacing)
    none = (0.0,) * cylinders
    return Layout("inline", places, none, tuple(range(cylinders)), none, places)


class Inline(LayoutKind):
    """Single bank with a throw for every cylinder."""

    name = "inline"
    openable: ClassVar[tuple[str, ...]] = ("throws", "firing_order")

    def place(self, inputs: LayoutInput) -> Layout:
        """Return a single upright bank."""
        return inline(inputs.cylinders, inputs.spacing(inputs.cylinders))
