"""Recorded cylinder pressure as a model of the gas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, SliderCrank
from laufruhe.machine.gas.base import AMBIENT_PRESSURE, OneChamber, check_pressures
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.kinks import SAME_ANGLE
from laufruhe.physics.measured_cycle import periodic_cubics

STRAIGHT, FEWEST = 8, 16
"""Number of linear pieces between two points of a pressure trace, and smallest number of points of a trace from which
every second one may be dropped."""


@dataclass(frozen=True)
class PressureTrace(OneChamber):
    """Measured cylinder pressure over one cycle.

    Attributes
    ----------
    angles
        Ascending crank angles of one cycle after the firing dead centre [rad]; the end may repeat the beginning.
    pressures, crankcase_pressure
        Absolute pressures in the cylinder, and on the underside of the piston [Pa].
    recording
        Sentences about how the trace was read from its file.
    without_combustion
        Trace of the same cylinder without combustion; None if it was not recorded.
    is_motored
        True for such a trace.
    """

    angles: tuple[float, ...]
    pressures: tuple[float, ...]
    crankcase_pressure: float = AMBIENT_PRESSURE
    recording: tuple[str, ...] = field(default=(), compare=False)
    without_combustion: PressureTrace | None = None
    is_motored: bool = False

    is_measured: ClassVar = True
    motored_remedy: ClassVar = "record it too and name its motored_column of [gas]"

    def __post_init__(self) -> None:
        check_pressures(self, "crankcase_pressure")
        angles, pressures = np.asarray(self.angles, dtype=float), np.asarray(self.pressures, dtype=float)
        if len(angles) != len(pressures) or len(angles) < 4:
            rule = f"the trace has {len(angles)} angles and {len(pressures)} pressures"
            raise ModelError(f"{rule}; give four points at least, each with an angle and a pressure")
        if not (np.isfinite(angles).all() and (np.diff(angles) > 0.0).all()):
            raise ModelError("the angles of the trace must be finite and rise; sort it and keep one point an angle")
        if not (pressures.min() > 0.0 and np.isfinite(pressures).all()):
            raise ModelError("the pressures of the trace must be positive and finite; give absolute pressures")

    def cycle_pressure(self, _piston: SliderCrank, cycle: Cycle, angles: Array, pace: float, /) -> Array:
        """Return the measured pressure [Pa] (G12)."""
        return periodic_cubics(np.array(self.angles), np.array(self.pressures), cycle, angles, pace)

    def cycle_breaks(self, _piston: SliderCrank, _cycle: Cycle, _pace: float, /) -> Array:
        """Return the angles of the points [rad]."""
        return np.array(self.angles)

    def extremes(self, _part: SliderCrank, _cycle: Cycle, /) -> tuple[float, float, float]:
        """Return the largest measured pressure [Pa], the angle of the peak [rad], and the least pressure [Pa]."""
        peak = peak_angle(np.array(self.angles), np.array(self.pressures))
        return max(self.pressures), peak, min(self.pressures)

    def motored(self, _cycle: Cycle, /) -> PressureTrace | None:
        """Return the recorded pressure without combustion."""
        return self if self.is_motored else self.without_combustion

    def approximations(self, cycle: Cycle, /) -> tuple[PressureTrace, PressureTrace]:
        """Return the trace with straight lines between its points, and with every second point (F9a)."""
        angles, pressures = list(self.angles), list(self.pressures)
        keeps = [*range(0, len(angles) - 1, 2), len(angles) - 1] if len(angles) >= FEWEST else range(len(angles))
        thinned = self._with([angles[k] for k in keeps], [pressures[k] for k in keeps])
        if angles[-1] < angles[0] + cycle.angle - SAME_ANGLE:
            angles, pressures = [*angles, angles[0] + cycle.angle], [*pressures, pressures[0]]
        places = np.arange(STRAIGHT * (len(angles) - 1) + 1) / STRAIGHT
        straight = (np.interp(places, range(len(angles)), column).tolist() for column in (angles, pressures))
        return self._with(*straight), thinned

    def _with(self, angles: Sequence[float], pressures: Sequence[float]) -> PressureTrace:
        return replace(self, angles=tuple(angles), pressures=tuple(pressures))


def peak_angle(angles: Array, pressures: Array) -> float:
    """Return the angle of the largest pressure [rad]: the top of a parabola through three points."""
    k = int(np.argmax(pressures))
    if 0 < k < len(angles) - 1 and pressures[k] > max(pressures[k - 1], pressures[k + 1]):
        steps = angles[k - 1 : k + 2] - angles[k]
        second, first, _ = np.polyfit(steps, pressures[k - 1 : k + 2] - pressures[k], 2)
        return float(angles[k] - 0.5 * first / second)
    return float(angles[k])


def bottom_pressure(angles: Array, pressures: Array, period: float) -> float:
    """Return the pressure half a turn before firing [Pa]."""
    return float(np.interp(-math.pi, angles, pressures, period=period))
