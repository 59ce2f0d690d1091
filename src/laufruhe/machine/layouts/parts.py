"""A free list of slider-cranks and shafts."""

from __future__ import annotations

from laufruhe.errors import ModelError, counted
from laufruhe.machine.layouts.base import LayoutInput, LayoutKind
from laufruhe.machine.layouts.places import Layout


class Parts(LayoutKind):
    """List of slider-cranks with their places."""

    name = "parts"
    keys = ()
    lists = ("slider_cranks", "shafts")
    is_free = True

    def place(self, inputs: LayoutInput) -> Layout:
        """Refuse: the list gives every place."""
        raise ModelError(f"a list of {counted(inputs.cylinders, 'slider-crank')} has no layout; fix the throws")
