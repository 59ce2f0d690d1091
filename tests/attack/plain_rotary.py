"""Chambers of a rotor from its outline alone: area between housing and flank, what it does, and what it presses.

Apexes run on the housing; between two of them it and a flank enclose a chamber. A flank keeps its shape, so a chamber
grows by the area between the housing and the chord of two apexes, which Green's theorem counts along both.
"""

from __future__ import annotations

import json
import math
from functools import lru_cache
from typing import Any

import numpy as np

from attack.plain_loads import ATMOSPHERE, FINE, SAMPLES, Mechanism, Shape, angles, mixed_cycle, number

CHAMBERS = 3
ALL = CHAMBERS * FINE
"""Steps of the three turns of the shaft in which a chamber does all it does."""


def _mean_and_rest(f: np.ndarray) -> tuple[float, np.ndarray]:
    """Return an integral over a turn as a mean slope, and a periodic part."""
    c = np.fft.rfft(f)
    k = np.arange(len(c))
    rest = np.fft.irfft(np.where(k > 0, c / (1j * np.where(k > 0, k, 1)), 0.0), len(f))
    return float(c[0].real) / len(f), rest


@lru_cache(maxsize=32)
def volume(shape: Shape, eccentricity: float) -> np.ndarray:
    """Return the volume of one chamber from its firing on, without a constant."""
    turn = 2.0 * np.pi * np.arange(ALL) / ALL
    out = np.exp(3j * (turn - np.pi / 3.0))
    place = eccentricity * out + shape.radius * np.exp(1j * turn)
    along = 3j * eccentricity * out + 1j * shape.radius * np.exp(1j * turn)
    mean, rest = _mean_and_rest(0.5 * (place.conj() * along).imag)
    sixth = ALL // 6
    ahead, behind = np.roll(place, -sixth), np.roll(place, sixth)
    arc = np.roll(rest, -sixth) - np.roll(rest, sixth) + mean * 2.0 * np.pi / 3.0
    return shape.width * (arc + 0.5 * (ahead.conj() * behind).imag)


@lru_cache(maxsize=64)
def _over(gas: str, shape: Shape, eccentricity: float) -> np.ndarray:
    keys = json.loads(gas)
    v = volume(shape, eccentricity)
    strokes = 4.0 * np.arange(ALL) / ALL
    over = mixed_cycle(keys, (v - v.min()) / np.ptp(v), strokes, 4)
    return over - number(keys.get("crankcase_pressure", ATMOSPHERE))


def over(gas: dict[str, Any], m: Mechanism) -> np.ndarray:
    """Return the pressure in one chamber over that behind it, from its firing on over three turns."""
    assert m.shape is not None
    return _over(json.dumps(gas, sort_keys=True), m.shape, m.radius)


def _of_all(one: np.ndarray) -> np.ndarray:
    """Return the sum of three chambers, a turn of the shaft apart, over a turn from the firing of one."""
    return one.reshape(CHAMBERS, FINE).sum(axis=0)


def torque(gas: dict[str, Any], m: Mechanism) -> np.ndarray:
    """Return the torque on the shaft from a firing on, as work per angle."""
    assert m.shape is not None
    v = volume(m.shape, m.radius)
    # a chamber's volume is a cosine and its double at the most
    c, k = np.fft.fft(v), np.fft.fftfreq(ALL, 1.0 / ALL)
    c[np.abs(k) > 60] = 0.0
    rise = np.fft.ifft(1j * k / CHAMBERS * c).real
    return _of_all(over(gas, m) * rise)


def on_eccentric(gas: dict[str, Any] | None, m: Mechanism, speed: float) -> np.ndarray:
    """Return the force of the rotor on its eccentric at each step, its flanks pressed along their normals."""
    assert m.shape is not None
    assert m.fires is not None
    phi = angles(1)
    total = m.piston_mass * m.radius * speed**2 * np.exp(1j * (phi + m.throw))
    if gas is None:
        return total
    chord = 2.0 * m.shape.radius * math.sin(math.pi / 3.0) * m.shape.width
    pressed = -over(gas, m) * chord * np.exp(2j * np.pi * np.arange(ALL) / ALL)
    since = np.mod(phi - m.fires, 2.0 * np.pi)
    return total + np.interp(since, angles(1, FINE), _of_all(pressed), period=2.0 * np.pi)


def spectrum(gas: dict[str, Any], m: Mechanism) -> np.ndarray:
    """Return the coefficients of the roll moment of the gas of one rotor that fires at angle 0."""
    return np.fft.rfft(torque(gas, m))[: SAMPLES // 2 + 1] / FINE


def apex(engine: dict[str, Any], speed: float, derivative: int) -> float:
    """Return the largest speed or acceleration of an apex, by differences of its places."""
    e, radius = number(engine["eccentricity"]), number(engine["rotor_radius"])
    steps = 720
    turn = 2.0 * np.pi * np.arange(steps) / steps
    place = e * np.exp(3j * turn) + radius * np.exp(1j * turn)
    c, k = np.fft.fft(place), np.fft.fftfreq(steps, 1.0 / steps)
    return float(np.abs(np.fft.ifft((1j * k * speed / CHAMBERS) ** derivative * c)).max())
