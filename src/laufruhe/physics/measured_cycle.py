"""Measured cycle, made periodic without ringing, and the noise on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle
from laufruhe.numerics.arrays import Array

MAX_TRACE_GAP = math.radians(30.0)
"""Largest gap between points of a measured trace."""
MAX_NOISY_STEP = math.radians(2.0)
"""Largest mean step of a trace whose noise differs from its shape."""
QUIET = 1e-4
"""Noise over the range of the pressure up to which a trace is kept as it is."""
EXPLAINED = 1.5
"""Largest part that smoothing may remove, over the noise."""
_DIFFERENCES = 4
_POWER = 6
"""Exponent of the order in the penalty: that of the third derivative."""


def periodic_cubics(points: Array, heights: Array, cycle: Cycle, angles: Array, pace: float = 1.0) -> Array:
    """Return values at crank angles [rad] from the heights at points of one cycle over `pace`, repeated (G12).

    Monotone cubics between the points (Fritsch and Carlson 1980) stay within their
    neighbours: a jump does not ring.
    """
    # imported late, as it takes longer than all the rest of a small problem
    from scipy.interpolate import PchipInterpolator

    period = cycle.angle / pace
    points, heights = _one_period(points, heights, cycle, period)
    # a slope needs two neighbours on either side
    around = np.concatenate([points[-3:] - period, points, points[:3] + period])
    values = np.concatenate([heights[-3:], heights, heights[:3]])
    local = points[0] + np.mod(angles - points[0], period)
    return np.asarray(PchipInterpolator(around, values)(local))


@dataclass(frozen=True, eq=False)
class SmoothCycle:
    """Measured cycle without its noise.

    Attributes
    ----------
    angles, pressures
        Points [rad], [Pa]: as they were if the noise is small, or if a low-pass would remove more than noise.
    noise
        Root mean square of the noise [Pa]; zero for steps too wide to tell.
    cut_off
        Order of crank speed at which half of the amplitude remains; None if the points are as they were.
    """

    angles: Array
    pressures: Array
    noise: float = 0.0
    cut_off: float | None = None


def smooth_cycle(angles: Array, pressures: Array, cycle: Cycle, pace: float = 1.0) -> SmoothCycle:
    """Return a measured cycle without noise, by the smoothing spline of least generalised cross-validation (G19, G20).

    The periodic spline of equal steps is a low-pass (Craven and Wahba 1979). Other steps are resampled first. The trace
    repeats after the angle of the cycle over `pace`, the crank angle of the piston over that of the engine.
    """
    period = cycle.angle / pace
    points, values = _one_period(angles, pressures, cycle, period)
    count = len(points)
    if period / count > (1.0 + 1e-6) * MAX_NOISY_STEP:
        return SmoothCycle(angles, pressures)
    even = points[0] + period * np.arange(count) / count
    if np.abs(points - even).max() > 1e-3 * period / count:
        values = np.interp(even, points, values, period=period)
    noise = _noise(values)
    if noise <= QUIET * np.ptp(values):
        return SmoothCycle(angles, pressures, noise)
    smooth, harmonic = _low_pass(values)
    if np.sqrt(np.mean((smooth - values) ** 2)) > EXPLAINED * noise:
        return SmoothCycle(angles, pressures, noise)
    return SmoothCycle(even, smooth, noise, harmonic * math.tau / period)


def _noise(pressures: Array) -> float:
    # root mean square from the median of fourth differences, which jumps do not move (G19)
    differences = pressures
    for _ in range(_DIFFERENCES):
        differences = np.roll(differences, -1) - differences
    # the median of the absolute value of normal noise is 0.6745 of its deviation
    return float(np.median(np.abs(differences))) / 0.6745 / math.sqrt(math.comb(2 * _DIFFERENCES, _DIFFERENCES))


def _low_pass(pressures: Array) -> tuple[Array, float]:
    """Return the smooth pressures, and the harmonic of the period that loses half of its amplitude (G20)."""
    count = len(pressures)
    series = np.fft.rfft(pressures)
    harmonics = np.arange(len(series))
    # a harmonic between zero and the last has a sine and a cosine
    multiplicity = np.where((harmonics == 0) | (2 * harmonics == count), 1.0, 2.0)
    cut_offs = np.geomspace(2.0, 2.0 * count, 400)
    gains = 1.0 / (1.0 + (harmonics / cut_offs[:, None]) ** _POWER)
    residuals = ((1.0 - gains) ** 2 * np.abs(series) ** 2) @ multiplicity
    best = int(np.argmin(residuals / (1.0 - gains @ multiplicity / count) ** 2))
    return np.fft.irfft(gains[best] * series, count), float(cut_offs[best])


def _one_period(points: Array, pressures: Array, cycle: Cycle, cycle_angle: float) -> tuple[Array, Array]:
    """Return angles and pressures of one period; an end that repeats the beginning is merged into it."""
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
    k = int(np.argmax(inner))
    if outer > min(2.0 * inner[k], max(inner[k], MAX_TRACE_GAP)):
        raise ModelError(f"{ends}, so {math.degrees(outer):.6g} of the {period} are missing; give the whole cycle")
    if inner[k] > MAX_TRACE_GAP:
        raise ModelError(
            f"the trace has no point between {math.degrees(points[k]):.6g} and {math.degrees(points[k + 1]):.6g} deg, "
            f"gaps must not exceed {math.degrees(MAX_TRACE_GAP):.6g} deg; add points"
        )
    return points, pressures
