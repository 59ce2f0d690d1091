"""Crank-rocker and rhombic drive from circles and straight rods alone, in the plane turned to the cylinder axis.

A rocker's pin is where two circles meet (textbook four-bar linkage); a rhombic drive has two equal rods on a crank pin,
one up to the piston and one down to the displacer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

Masses = list[tuple[float, np.ndarray]]
DRAWN = 4096


@dataclass(frozen=True)
class Body:
    """Mass, place of its centre on the line of its pins as a share of it, and inertia about that centre."""

    mass: float = 0.0
    share: float = 0.0
    inertia: float = 0.0


@dataclass(frozen=True)
class Linkage:
    """Coupler, rocker and piston rod; the end of the rocker as an angle after the coupler's pin."""

    pivot: complex
    coupler: float
    arm: float
    end: float
    angle: float
    side: int
    rod: float
    offset: float
    bodies: tuple[Body, Body, Body] = (Body(), Body(), Body())


def rocker_pins(k: Linkage, crank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pins of coupler and rod on the rocker for a crank pin at `crank`; NaN out of reach."""
    line = k.pivot - crank
    distance = np.abs(line)
    along = (distance**2 + k.coupler**2 - k.arm**2) / (2.0 * distance)
    height = np.sqrt(k.coupler**2 - along**2)
    pin = crank + line / distance * (along + 1j * k.side * height)
    return pin, k.pivot + (pin - k.pivot) / k.arm * k.end * np.exp(1j * k.angle)


def rocker_travel(k: Linkage, crank: np.ndarray) -> np.ndarray:
    """Return the place of the piston along its cylinder."""
    _, end = rocker_pins(k, crank)
    return end.real + np.sqrt(k.rod**2 - (end.imag - k.offset) ** 2)


def rocker_masses(k: Linkage, crank: np.ndarray, piston_mass: float) -> tuple[Masses, Masses]:
    """Return the masses with their places, and the inertias with the angles of their bodies."""
    pin, end = rocker_pins(k, crank)
    piston = rocker_travel(k, crank) + 1j * k.offset
    ends = ((crank, pin), (k.pivot + 0.0 * end, end), (end, piston))
    masses = [(b.mass, a + b.share * (z - a)) for b, (a, z) in zip(k.bodies, ends, strict=True)]
    swings = [(b.inertia, np.unwrap(np.angle(z - a))) for b, (a, z) in zip(k.bodies, ends, strict=True)]
    return [(piston_mass, piston), *masses], swings


@lru_cache(maxsize=512)
def rocker_radius(k: Linkage, stroke: float) -> float:
    """Return the crank radius that moves the piston by the stroke; NaN if none does."""
    high = min(k.coupler + k.arm - abs(k.pivot), abs(k.pivot) - abs(k.coupler - k.arm), k.coupler) * (1.0 - 1e-9)

    def excess(radius: float) -> float:
        places = rocker_dead_centres(k, radius)
        return math.nan if places is None else places[2] - stroke

    with np.errstate(invalid="ignore"):
        while high > 0.0 and math.isnan(excess(high)):
            high *= 0.9
        if not high > 0.0 or excess(high) < 0.0:
            return math.nan
        return float(brentq(excess, 1e-3 * high, high, xtol=1e-15, rtol=1e-14))


@lru_cache(maxsize=512)
def rocker_dead_centres(k: Linkage, radius: float) -> tuple[float, float, float] | None:
    """Return crank angles of the highest and next lowest place, and the stroke; None if there are others."""
    alpha = 2.0 * math.pi * np.arange(DRAWN) / DRAWN

    def place(angle: Any) -> Any:
        return rocker_travel(k, radius * np.exp(1j * np.asarray(angle)))

    s = place(alpha)
    if not np.all(np.isfinite(s)) or np.count_nonzero(np.diff(np.sign(np.diff([*s, s[0], s[1]])))) != 2:
        return None
    top, bottom = _peak(place, alpha[np.argmax(s)]), _peak(lambda a: -place(a), alpha[np.argmin(s)])
    stroke = float(place(top) - place(bottom))
    return math.remainder(top, math.tau), math.remainder(top, math.tau) + (bottom - top) % math.tau, stroke


def _peak(height: Callable[[float], Any], near: float) -> float:
    step = 2.0 * math.tau / DRAWN
    slope = lambda a: float(height(a + 1e-4) - height(a - 1e-4))  # noqa: E731
    if slope(near - step) > 0.0 > slope(near + step):
        return float(brentq(slope, near - step, near + step, xtol=1e-13))
    bounded = {"bounds": (near - step, near + step), "method": "bounded", "options": {"xatol": 1e-10}}
    return float(minimize_scalar(lambda a: -float(height(a)), **bounded).x)


def linkage(number: Callable[[Any], float], entry: dict[str, Any]) -> Linkage:
    """Return the linkage of [engine]."""
    lengths = ("coupler_length", "rocker_end", "piston_rod_length")
    coupler, end, rod = (number(entry[key]) for key in lengths)
    bodies = []
    for key, length in zip(("coupler", "rocker", "piston_rod"), (coupler, end, rod), strict=True):
        body = entry.get(key, {})
        mass, centre, inertia = (number(body.get(name, 0.0)) for name in ("mass", "centre_of_gravity", "inertia"))
        bodies.append(Body(mass, centre / length, inertia))
    pivot = complex(number(entry["rocker_pivot_along"]), number(entry["rocker_pivot_across"]))
    angle, side = math.radians(entry.get("rocker_angle", 0.0)), int(entry.get("rocker_side", 1))
    offset = number(entry.get("offset", 0.0))
    return Linkage(
        pivot, coupler, number(entry["rocker_arm"]), end, angle, side, rod, offset, (bodies[0], bodies[1], bodies[2])
    )


def rhombic_masses(
    crank: np.ndarray, rod: float, offset: float, masses: tuple[float, float], deficit: float
) -> tuple[Masses, Masses]:
    """Return piston and displacer at the ends of two rods, and the angles of both rods."""
    aside = crank.imag - offset
    reach, lean = np.sqrt(rod**2 - aside**2), np.arcsin(aside / rod)
    places = [crank.real + sign * reach + 1j * offset for sign in (1.0, -1.0)]
    return list(zip(masses, places, strict=True)), [(deficit, -lean), (deficit, math.pi + lean)]
