"""List of a result's pictures in the order of a report; `plots.results` has a module for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from laufruhe.extension import extended


@dataclass(frozen=True)
class ResultPicture:
    """Name and caption of a result's picture.

    The functions `applies` and `figure` of the module `home` take a result. By default `home` is the module of
    `plots.results` with the name of the picture.
    """

    name: str
    caption: str
    home: str = ""

    @property
    def module(self) -> str:
        """Address of the module that draws it."""
        return self.home or f"laufruhe.plots.results.{self.name}"


_CAPTIONS = {
    "engine": "The engine to scale, from the front and from the side; open or optimised parts are marked.",
    "star": "The best crank stars, from the front and from the side.",
    "firings": "Firing orders of the best stars over one working cycle.",
    "polar": "Force on each mount over one cycle: path of the force vector, or one component over the crank angle.",
    "ellipses": "Mass ellipses: path of the free force and of the free couple of each order.",
    "cycle": "Shaking force, moments, and the force on every mount over the crank angle of one cycle.",
    "bars": "Mean and maximum of each mount's force over one cycle.",
    "willans": "Fuel over brake load with the Willans line, or drag over speed; the fitted line gives the friction.",
    "spectrum": "Amplitudes of the loads by order of crank speed.",
    "transmissibility": "Force on elastic mounts relative to rigid mounts, over speed.",
    "campbell": "Orders of crank speed against natural frequencies: where they cross, speed is critical.",
    "modes": "Share of each motion in the kinetic energy of each natural mode.",
    "trade": "Objective over the allowed deviation from even firing.",
}
PICTURES: Mapping[str, ResultPicture] = extended(
    "pictures", ResultPicture, [ResultPicture(*caption) for caption in _CAPTIONS.items()]
)


def rows_of(count: int, maximum: int) -> tuple[list[range], int]:
    """Split `count` items into rows of at most `maximum`, of similar length; return the rows and their length."""
    rows = max(-(-count // max(maximum, 1)), 1)
    side = max(-(-count // rows), 1)
    return [range(first, min(first + side, count)) for first in range(0, count, side)], side
