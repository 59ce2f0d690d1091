"""Wrenches (Fx, Fy, Fz, Mx, My, Mz) about the origin of C2."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Shaft

WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
ROLL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])


def plane_wrench(lateral: Any, vertical: Any, x: float, shaft: Shaft) -> NDArray[Any]:
    """Return the wrench of a force in the plane at x through a shaft's axis, shape (6, ...) of forces (...) (C2)."""
    return np.array(plane_parts(lateral, vertical, x, shaft))


def plane_parts(lateral: Any, vertical: Any, x: float, shaft: Shaft) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Return the six parts of that wrench."""
    roll = shaft.y * vertical - shaft.z * lateral
    return lateral - lateral, lateral, vertical, roll, -x * vertical, x * lateral


def turning_parts(lateral: Any, vertical: Any) -> tuple[Any, Any]:
    """Return the parts F e^{i h phi} and B e^{-i h phi} of z + i y, with the crank and against it (C4).

    Parameters
    ----------
    lateral, vertical
        Coefficients of one order (C8).
    """
    return 0.5 * (vertical + 1j * lateral), 0.5 * np.conj(vertical - 1j * lateral)
