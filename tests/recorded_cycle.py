"""A closed form of a cylinder pressure, and its torque by the textbook's slider-crank: no code of the package."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BORE, STROKE, ROD = 0.080, 0.090, 0.150
AREA, CRANK = np.pi * BORE**2 / 4, STROKE / 2
DEGREES = np.arange(-360.0, 360.0)


def cycle_pressure(degrees: ArrayLike) -> NDArray[np.float64]:
    """Return the pressure of compression, burn from -8 deg, expansion, blow-down, gas exchange at 1 bar [bar]."""
    angle = np.radians((np.asarray(degrees, dtype=float) + 360.0) % 720.0 - 360.0)
    ratio = CRANK / ROD
    travel = (1.0 + 1.0 / ratio - np.cos(angle) - np.sqrt(1.0 / ratio**2 - np.sin(angle) ** 2)) / 2.0
    volume, largest = 1.0 / 9.0 + travel, 10.0 / 9.0
    burnt = 1.0 - np.exp(-6.9 * np.clip((np.degrees(angle) + 8.0) / 50.0, 0.0, 1.0) ** 3)
    closed = (largest / volume) ** 1.33 + 35.0 * burnt * (1.0 / 9.0 / volume) ** 1.3
    released = 1.0 + 35.0 * (1.0 / 9.0 / largest) ** 1.3 * np.exp(-4.0 * np.maximum(angle - np.pi, 0.0))
    return np.where(np.abs(angle) < np.pi, closed, np.where(angle >= np.pi, released, 1.0))


def lever(degrees: ArrayLike, crank: float = CRANK, rod: float = ROD) -> NDArray[np.float64]:
    """Return the torque over the gas force [m]."""
    angle, ratio = np.radians(np.asarray(degrees, dtype=float)), crank / rod
    return crank * np.sin(angle) * (1.0 + ratio * np.cos(angle) / np.sqrt(1.0 - (ratio * np.sin(angle)) ** 2))


def mean_torque() -> float:
    """Return the mean torque of one cylinder over 1 bar on its underside [N m]."""
    angles = np.arange(0.0, 720.0, 0.01)
    return float(np.mean((cycle_pressure(angles) - 1.0) * 1e5 * AREA * lever(angles)))
