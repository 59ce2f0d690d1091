"""Extremes of the motion of a piston, and reversals of its side force (K19-K21)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np

from laufruhe.machine import Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum

STEPS = 2880
_NEWTON_STEPS = 24
_ROUNDING = 1e-9
_SIDE = 1e-8
"""Angle beside a reversal at which its rate is taken [rad]."""


@dataclass(frozen=True)
class Extreme:
    """Largest value of a quantity in SI units.

    Attributes
    ----------
    angle
        Own crank angle after the top dead centre of the piston [rad].
    """

    value: float
    angle: float


@dataclass(frozen=True)
class PistonMotion:
    """Motion of one piston or ram at a constant speed of its crank.

    Attributes
    ----------
    stroke
        Distance between the dead centres [m].
    mean_speed
        Twice the stroke over the time of one turn [m/s].
    speed
        Largest speed [m/s].
    towards_crank, from_crank
        Largest acceleration towards the crank and away from it [m/s2].
    rod_angle
        Largest angle between rod and cylinder axis [rad]; None without a rod.
    """

    stroke: float
    mean_speed: float
    speed: Extreme
    towards_crank: Extreme
    from_crank: Extreme
    rod_angle: Extreme | None

    @property
    def acceleration(self) -> float:
        """Largest acceleration in either direction [m/s2]."""
        return max(self.towards_crank.value, self.from_crank.value)


def pistons_of(engine: Engine) -> list[SliderCrank]:
    """Return the mechanisms of an engine that move a piston or ram; a rotor with its chambers has none."""
    return [part for part in engine.slider_cranks if len(part.swept.lags) == 1]


def piston_motion(part: SliderCrank, speed: float) -> PistonMotion:
    """Return the extremes of the motion of a piston at a speed of the engine's crank [rad/s] (K19, K20)."""
    fast = abs(part.shaft.ratio) * speed
    unit = _unit_motion(part.only({}))

    def scaled(extreme: Extreme, power: int) -> Extreme:
        return Extreme(extreme.value * fast**power, extreme.angle)

    return PistonMotion(
        unit.stroke, unit.mean_speed * fast, scaled(unit.speed, 1), scaled(unit.towards_crank, 2),
        scaled(unit.from_crank, 2), unit.rod_angle,
    )  # fmt: skip


@lru_cache(maxsize=1024)
def _unit_motion(part: SliderCrank) -> PistonMotion:
    alpha = part.dead_centres[0] + math.tau / STEPS * np.arange(STEPS)
    _, velocity, acceleration = (np.real(row) + 0.0 * alpha for row in part.motion(np, alpha).points[0][1])
    sine, cosine = part.rod_lean(np, alpha)
    rod_angle = _largest(np.abs(np.arctan2(sine, cosine)))
    return PistonMotion(
        part.stroke, part.stroke / math.pi, _largest(np.abs(velocity)), _largest(-acceleration),
        _largest(acceleration), rod_angle if part.has_rod and rod_angle.value > 0.0 else None,
    )  # fmt: skip


def _largest(values: Array) -> Extreme:
    # peak of a periodic function at equal steps, by a parabola through the largest sample and its neighbours
    k = int(np.argmax(values))
    before, top, after = (float(values[(k + j) % len(values)]) for j in (-1, 0, 1))
    curvature = before - 2.0 * top + after
    shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
    return Extreme(top - 0.25 * (before - after) * shift, _since((k + shift) * math.tau / len(values), math.tau))


def reversals(side_force: Spectrum, parts: Sequence[SliderCrank], point: OperatingPoint) -> list[list[Extreme]]:
    """Return the reversals of the side force of each piston: its rate [N/s], and the angle (K21).

    Where the rate jumps, as at a jump of pressure, the larger one counts.

    Parameters
    ----------
    side_force
        Side force of each piston over the cycle [N], shape (n, pistons, 1).
    """
    samples = max(STEPS, 2 * len(side_force.coefficients))
    step = side_force.period / samples
    # a reversal at a dead centre lies between steps
    values = side_force.shift(Fraction(-1, 2 * samples), -0.5 * step).sample(samples)[..., 0]
    follows = np.roll(values, -1, axis=0)
    # rounding is no side force
    places, pistons = np.nonzero(values * follows < -((_ROUNDING * np.abs(values).max()) ** 2))
    if not len(places):
        return [[] for _ in parts]
    rows, low = np.arange(len(places)), step * (places + 0.5)
    first, last, high = values[places, pistons], follows[places, pistons], low + step
    angles = low + step * first / (first - last)
    for _ in range(_NEWTON_STEPS):
        value, slope = side_force.values(angles)[rows, pistons, 0], _slopes(side_force, angles)[rows, pistons, 0]
        # the bracket closes on a jump, where Newton's step leaves it
        is_before = value * last < 0.0
        low, high = np.where(is_before, angles, low), np.where(is_before, high, angles)
        moved = angles - np.divide(value, slope, out=np.zeros_like(value), where=slope != 0.0)
        moved = np.where((moved >= low) & (moved <= high), moved, 0.5 * (low + high))
        if np.abs(moved - angles).max() <= _SIDE:
            break
        angles = moved
    slopes = [_slopes(side_force, angles + side)[rows, pistons, 0] for side in (-_SIDE, _SIDE)]
    rates = point.speed * np.abs(slopes).max(axis=0)
    by_piston: list[list[Extreme]] = [[] for _ in parts]
    for angle, piston, rate in zip(angles.tolist(), pistons.tolist(), rates.tolist(), strict=True):
        part = parts[piston]
        since = _since(angle - _top(part), side_force.period)
        by_piston[piston].append(Extreme(rate, abs(part.shaft.ratio) * since))
    return [sorted(events, key=lambda event: event.angle) for events in by_piston]


def _since(angle: float, period: float) -> float:
    # rounding puts no angle just below the period
    return max((angle + _SIDE) % period - _SIDE, 0.0)


def _slopes(signal: Spectrum, angles: Array) -> Array:
    # derivative by the crank angle beside jumps of value
    smooth = signal.smooth.derivative.values(angles)
    return smooth if signal.kinks is None else smooth + signal.kinks.values(angles, signal.period, 1)


def _top(part: SliderCrank) -> float:
    # crank angle of the engine at the top dead centre nearest to firing
    ratio = part.shaft.ratio
    top = (part.dead_centres[0] - part.throw + part.bank) / ratio
    turn = math.tau / abs(ratio)
    return top + turn * round((part.firing_angle - top) / turn)
