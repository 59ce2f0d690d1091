"""The crank radius, which the stroke follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from laufruhe.files.nested import Place
from laufruhe.files.quantities import Quantity


class CrankRadius(Quantity):
    """Half the stroke of a crank without offset."""

    name = "crank_radius"
    unit = "m"
    words = "Crank radius; engine.stroke follows as twice as much."
    follow: ClassVar[Mapping[Place, str]] = {("engine", "stroke"): "m"}

    def values(self, value: float, given: Mapping[Place, float]) -> Mapping[Place, float]:
        """Return the stroke."""
        return {("engine", "stroke"): 2.0 * value}


CRANK_RADIUS = CrankRadius()
