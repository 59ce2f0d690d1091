"""A measured trace, made periodic without ringing."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, PressureTrace
from laufruhe.numerics.arrays import Array

MAX_TRACE_GAP = math.radians(30.0)
"""Largest gap between points of a measured trace."""


def trace_pressure(gas: PressureTrace, cycle: Cycle, angles: Array, pace: float = 1.0) -> Array:
    """Measured pressure [Pa] at crank angles gamma [rad], shape of `angles`, the cycle repeated at a pace (G12).

    Monotone cubics between the points (Fritsch and Carlson 1980) stay within their
    neighbours: a jump does not ring.

    Raises
    ------
    ModelError
        If the trace covers less or more than the cycle, or has a gap of over 30 degrees.
    """
    # late, for it takes longer than all the rest of a small problem
    from scipy.interpolate import PchipInterpolator

    whole = cycle.angle / pace
    points, pressures = _one_period(gas, cycle, whole)
    _check_gaps(points, cycle, whole)
    # a slope looks at two neighbours on either side
    around = np.concatenate([points[-3:] - whole, points, points[:3] + whole])
    values = np.concatenate([pressures[-3:], pressures, pressures[:3]])
    local = points[0] + np.mod(angles - points[0], whole)
    return np.asarray(PchipInterpolator(around, values)(local))


def _one_period(gas: PressureTrace, cycle: Cycle, whole: float) -> tuple[Array, Array]:
    """Points of a trace, an end that repeats the beginning merged into it."""
    points, pressures = np.array(gas.angles), np.array(gas.pressures)
    missing = whole - (points[-1] - points[0])
    step = float(np.min(np.diff(points)))
    if missing < -1e-3 * step:
        raise ModelError(
            f"the trace runs from {_degrees(points[0])} to {_degrees(points[-1])} deg, more than the "
            f"{_degrees(whole)} deg of a {cycle} cycle; cut it to one cycle"
        )
    if missing > 1e-3 * step:
        return points, pressures
    merged = pressures[:-1].copy()
    merged[0] = 0.5 * (pressures[0] + pressures[-1])
    return points[:-1], merged


def _check_gaps(points: Array, cycle: Cycle, whole: float) -> None:
    inner = np.diff(points)
    outer = float(points[0] + whole - points[-1])
    if outer > min(2.0 * float(inner.max()), MAX_TRACE_GAP):
        raise ModelError(
            f"the trace runs from {_degrees(points[0])} to {_degrees(points[-1])} deg, so {_degrees(outer)} of the "
            f"{_degrees(whole)} deg of a {cycle} cycle are missing; "
            "give the whole cycle"
        )
    k = int(np.argmax(inner))
    if inner[k] > MAX_TRACE_GAP:
        raise ModelError(
            f"the trace has no point between {_degrees(points[k])} and {_degrees(points[k + 1])} deg, gaps must not "
            f"exceed {_degrees(MAX_TRACE_GAP)} deg; add points"
        )


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g}"
