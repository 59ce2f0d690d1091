"""Indicated mean pressure from the brake: friction from a Willans line or from motoring, with its deviation (W1-W4).

The fuel burnt at one speed grows along a straight line with the load; where the line is extended to no fuel, the
load is that of the friction alone, negative (Willans). A line through measured points has a standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array

FEWEST = 3
"""Points that a line and its deviation take."""
SAME = 1e-9


@dataclass(frozen=True)
class Friction:
    """Friction mean effective pressure and its standard deviation [Pa]."""

    mean: float
    deviation: float

    def indicated(self, brake: float, deviations: float) -> tuple[float, float, float]:
        """Return least, middle and largest indicated mean pressure at a brake mean pressure [Pa] (W4)."""
        room = deviations * self.deviation
        return brake + self.mean - room, brake + self.mean, brake + self.mean + room


@dataclass(frozen=True)
class FrictionTest:
    """Measured friction, and the brake load that it turns into an indicated one.

    Attributes
    ----------
    at
        Name of the operating point.
    is_motored
        Whether drag was measured over speed [Pa, rad/s]; else fuel, in any unit, over brake mean pressure [Pa].
    x, y
        Of every reading.
    target
        Speed [rad/s], or brake mean pressure [Pa], that is requested.
    friction, deviations
        Told by the line, and how many deviations are looked at to either side.
    """

    at: str
    is_motored: bool
    x: tuple[float, ...]
    y: tuple[float, ...]
    target: float
    friction: Friction
    deviations: float

    @property
    def line(self) -> tuple[float, float]:
        """Intercept and slope of y over x."""
        return _line(self.x, self.y, "reading")[:2]


def mean_pressure(torque: float, displacement: float, turns: int) -> float:
    """Return the mean effective pressure [Pa] of a torque [N m] over a cycle of some turns (W1)."""
    return math.tau * turns * torque / displacement


def mean_torque(pressure: float, displacement: float, turns: int) -> float:
    """Return the mean torque [N m] of a mean effective pressure [Pa] over a cycle of some turns (W1)."""
    return pressure * displacement / (math.tau * turns)


def willans_friction(brake: Sequence[float], fuel: Sequence[float]) -> Friction:
    """Return the friction from fuel burnt at brake mean pressures [Pa] of one speed, fuel in any unit (W2)."""
    intercept, slope, covariance = _line(brake, fuel, "load")
    if slope <= 0.0:
        raise ModelError("the fuel does not rise with the load; check the columns")
    friction = intercept / slope
    if friction <= 0.0:
        raise ModelError(
            "the line of fuel over load gives no friction, because it has no fuel at a load above zero; check the fuel"
        )
    # d(a / b) = da / b - a db / b^2
    by = np.array([1.0, -friction]) / slope
    return Friction(friction, math.sqrt(max(float(by @ covariance @ by), 0.0)))


def motoring_friction(speeds: Sequence[float], drag: Sequence[float], speed: float) -> Friction:
    """Return the friction at a speed from motoring pressures [Pa] at several, on a straight line (W3)."""
    intercept, slope, covariance = _line(speeds, drag, "speed")
    friction, by = intercept + slope * speed, np.array([1.0, speed])
    if friction <= 0.0:
        raise ModelError(
            "the line of motoring pressure over speed gives no friction at this speed; check the pressures"
        )
    return Friction(friction, math.sqrt(max(float(by @ covariance @ by), 0.0)))


def _line(x: Sequence[float], y: Sequence[float], what: str) -> tuple[float, float, Array]:
    # intercept and slope of a line by least squares, and their covariances by its scatter
    if len(x) < FEWEST:
        raise ModelError(f"a line and its deviation take {FEWEST} points, and there are {len(x)}; measure more")
    places = sorted(x)
    size = max(abs(places[0]), abs(places[-1]))
    if any(b - a <= SAME * size for a, b in pairwise(places)):
        raise ModelError(f"one {what} is given twice; give the mean of its measured values")
    (slope, intercept), covariance = np.polyfit(x, y, 1, cov=True)
    return float(intercept), float(slope), np.asarray(covariance)[::-1, ::-1]
