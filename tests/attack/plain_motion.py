"""Motion of pistons from their places: strokes, speeds, accelerations, rod angles, reversals of the side force."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from attack import plain_crankcase
from attack.plain_loads import Machine, Mechanism, angles, slope, travel

QUANTITIES = {
    "piston travel": "m", "mean piston speed": "m/s", "piston speed": "m/s", "piston acceleration": "m/s^2",
    "rod angle": "rad", "rod length": "m", "side-force reversal rate": "N/s",
}  # fmt: skip


def peak(values: np.ndarray) -> float:
    """Return the largest value of a periodic signal, by a parabola through three samples."""
    k = int(np.argmax(values))
    a, b, c = (float(values[(k + j) % len(values)]) for j in (-1, 0, 1))
    return b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c)) if 2.0 * b > a + c else b


def of_piston(m: Mechanism, channel: str, speed: float, turns: int) -> float:
    """Return a number of one piston."""
    if m.lever is not None:
        turned = m.radius * np.exp(1j * angles(1))
        along = np.unwrap(np.angle(turned + 1j * m.lever.pivot))
        s = m.lever.length * np.cos(along)
    else:
        s = travel(m, angles(1))
    fast = abs(m.ratio) * speed
    velocity = slope(s.astype(complex), 1)
    if channel in ("piston travel", "mean piston speed"):
        stroke = peak(s) + peak(-s)
        return stroke if channel == "piston travel" else stroke * fast / math.pi
    if channel == "piston speed":
        return fast * max(peak(velocity.real), peak(-velocity.real))
    if channel == "piston acceleration":
        acceleration = slope(velocity, 1).real
        return fast**2 * max(peak(acceleration), peak(-acceleration))
    if channel == "rod length":
        return m.rod
    if channel == "rod angle":
        lean = np.arcsin((m.radius * np.sin(angles(1)) - m.offset) / m.rod)
        return max(peak(lean), peak(-lean))
    return _reversal(m, speed, turns)


def _reversal(m: Mechanism, speed: float, turns: int) -> float:
    """Return the largest rate of the side force where it changes its sign, of a rod without gas."""
    wall = plain_crankcase.side_force(m, turns, speed)
    rate = speed * slope(wall.astype(complex), turns).real
    follows, after = np.roll(wall, -1), np.roll(rate, -1)
    at = np.flatnonzero(wall * follows < -((1e-9 * np.abs(wall).max()) ** 2))
    # a reversal may lie on a sample
    on = np.flatnonzero(np.abs(wall) <= 1e-9 * np.abs(wall).max())
    share = wall[at] / (wall[at] - follows[at])
    rates = [*np.abs(rate[at] + share * (after[at] - rate[at])), *np.abs(rate[on])]
    return float(max(rates, default=0.0))


def numbers(scene: Any, machine: Machine, term: dict[str, Any], channel: str) -> list[float]:
    """Return those of all pistons that count at all points that count."""
    pistons = [m for m in machine.mechanisms if m.piston_mass]
    counted = term.get("cylinders", range(1, len(pistons) + 1))
    speeds = [s for s, w in zip(scene.speeds, scene.weights(term), strict=True) if w > 0.0]
    return [of_piston(pistons[k - 1], channel, speed, machine.turns) for k in counted for speed in speeds]


def largest(scene: Any, machine: Machine, term: dict[str, Any], channel: str) -> float:
    return max(numbers(scene, machine, term, channel))


def smallest(scene: Any, machine: Machine, term: dict[str, Any], channel: str) -> float:
    return min(numbers(scene, machine, term, channel))
