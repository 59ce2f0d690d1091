"""Common names of crank stars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

CRANKS: Mapping[str, tuple[float, ...]] = {
    "parallel-360": (0.0, 0.0),
    "parallel-180": (0.0, 180.0),
    "parallel-270": (0.0, 90.0),
    "even-three": (0.0, 240.0, 120.0),
    "t-plane": (0.0, 270.0, 180.0),
    "flat-plane": (0.0, 180.0, 180.0, 0.0),
    "cross-plane": (0.0, 90.0, 270.0, 180.0),
    "even-six": (0.0, 240.0, 120.0, 120.0, 240.0, 0.0),
}
"""Angles of the throws [deg], from the front; such that a 270 degree twin fires 270 degrees after cylinder 1."""
_SAME = math.radians(1e-6)


def name_of_crank(throws: Sequence[float]) -> str:
    """Return the name of a crank with these throws [rad], however turned or mirrored; empty if it has none."""

    def is_turned(image: Sequence[float]) -> bool:
        ahead = throws[0] - image[0]
        return all(abs(math.remainder(a - b - ahead, math.tau)) < _SAME for a, b in zip(throws, image, strict=True))

    for name, degrees in CRANKS.items():
        named = [math.radians(angle) for angle in degrees]
        images = [[sign * angle for angle in angles] for sign in (1.0, -1.0) for angles in (named, named[::-1])]
        if len(named) == len(throws) and any(map(is_turned, images)):
            return name
    return ""
