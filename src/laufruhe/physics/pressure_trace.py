"""Measured pressure trace, made periodic without ringing."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, PressureTrace
from laufruhe.numerics.arrays import Array

MAX_TRACE_GAP = math.radians(30.0)
"""Largest gap between points of a measured trace."""


def trace_pressure(gas: PressureTrace, cycle: Cycle, angles: Array, pace: float = 1.0) -> Array:
    """Return the measured pressure [Pa] at crank angles gamma [rad], repeated every cycle over pace (G12).

    Monotone cubics between the points (Fritsch and Carlson 1980) stay within their
    neighbours: a jump does not ring.
    """
    # imported late, as it takes longer than all the rest of a small problem
    from scipy.interpolate import PchipInterpolator

    period = cycle.angle / pace
    points, pressures = _one_period(gas, cycle, period)
    # a slope needs two neighbours on either side
    around = np.concatenate([points[-3:] - period, points, points[:3] + period])
    values = np.concatenate([pressures[-3:], pressures, pressures[:3]])
    local = points[0] + np.mod(angles - points[0], period)
    return np.asarray(PchipInterpolator(around, values)(local))


def _one_period(gas: PressureTrace, cycle: Cycle, cycle_angle: float) -> tuple[Array, Array]:
    """Return angles and pressures of one period; an end that repeats the beginning is merged into it."""
    points, pressures = np.array(gas.angles), np.array(gas.pressures)
    missing = cycle_angle - (points[-1] - points[0])
    step = float(np.min(np.diff(points)))
    ends = f"the trace runs from {math.degrees(points[0]):.6g} to {math.degrees(points[-1]):.6g} deg"
    period = f"{math.degrees(cycle_angle):.6g} deg of a {cycle} cycle"
    if missing < -1e-3 * step:
        raise ModelError(f"{ends}, more than the {period}; cut it to one cycle")
    if missing <= 1e-3 * step:
        first = 0.5 * (pressures[0] + pressures[-1])
        points, pressures = points[:-1], np.concatenate([[first], pressures[1:-1]])
    inner, outer = np.diff(points), float(points[0] + cycle_angle - points[-1])
    if outer > min(2.0 * float(inner.max()), MAX_TRACE_GAP):
        raise ModelError(f"{ends}, so {math.degrees(outer):.6g} of the {period} are missing; give the whole cycle")
    k = int(np.argmax(inner))
    if inner[k] > MAX_TRACE_GAP:
        raise ModelError(
            f"the trace has no point between {math.degrees(points[k]):.6g} and {math.degrees(points[k + 1]):.6g} deg, "
            f"gaps must not exceed {math.degrees(MAX_TRACE_GAP):.6g} deg; add points"
        )
    return points, pressures
