"""Crank radius from the stroke."""

from __future__ import annotations

import math

from laufruhe.errors import ModelError


def radius_for_stroke(
    stroke: float, offset: float, *, rod_length: float | None = None, rod_ratio: float = 0.0
) -> float:
    """Return the crank radius of a stroke [m], at a given rod length or rod ratio.

    Squaring stroke = sqrt((l + r)^2 - e^2) - sqrt((l - r)^2 - e^2) twice leaves an
    equation linear in r^2 for a given l, and quadratic for a given r / l.

    Raises
    ------
    ModelError
        If no crank with this rod turns through this stroke.
    """
    s2, e2 = stroke * stroke, offset * offset
    if offset == 0.0:
        return 0.5 * stroke
    if rod_length is not None and math.isfinite(rod_length):
        l2 = rod_length * rod_length
        square = s2 * (4.0 * (l2 - e2) - s2) / (4.0 * (4.0 * l2 - s2)) if 4.0 * l2 > s2 else -1.0
    else:
        k2 = rod_ratio * rod_ratio
        root = (s2 * (1.0 + k2)) ** 2 - 4.0 * k2 * s2 * (4.0 * e2 + s2)
        square = (s2 * (1.0 + k2) + math.sqrt(root)) / 8.0 if root >= 0.0 else -1.0
    if square <= 0.0:
        raise ModelError(
            f"no crank makes a stroke of {stroke * 1e3:.6g} mm with an offset of {offset * 1e3:.6g} mm on this rod; "
            "lengthen the rod or lessen the offset"
        )
    return math.sqrt(square)
