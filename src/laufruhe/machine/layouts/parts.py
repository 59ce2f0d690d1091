"""A free list of slider-cranks and shafts."""

from __future__ import annotations

from laufruhe.errors import ModelError, counted
from laufruhe.machine.layouts.base import Asked, LayoutKind
from laufruhe.machine.layouts.places import Layout


class Parts(LayoutKind):
    """Every slider-crank listed with its place."""

    name = "parts"
    keys = ()
    lists = ("slider_cranks", "shafts")
    is_free = True

    def place(self, asked: Asked) -> Layout:
        """Nothing is placed: the list says where everything is."""
        raise ModelError(f"a list of {counted(asked.cylinders, 'slider-crank')} has no layout; fix the throws")
