"""Kinematics of the slider-crank, exact, offset included (K1-K6).

Lengths are in crank radii and time is crank angle. Every kernel is a function of the local crank angle alpha (C5), the
rod ratio lambda = r/l and the offset ratio epsilon = e/l. The maths namespace `lib` is NumPy or CasADi. Arguments are
scalars, symbols, or arrays of one shape, and the result has that shape. A Scotch yoke has lambda = 0. The kernels raise
no error: a crank with lambda + |epsilon| >= 1, which cannot turn, is refused by the class of the mechanism.
"""

from __future__ import annotations

from typing import Any


def sin_psi(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the sine of the rod's angle, sin psi = lambda sin alpha - epsilon (K1)."""
    return rod_ratio * lib.sin(alpha) - offset_ratio


def cos_psi(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the cosine of the rod's angle, as the root of (1 - sin psi)(1 + sin psi) to keep digits (K1)."""
    return _cosine(lib, sin_psi(lib, alpha, rod_ratio, offset_ratio))


def _cosine(lib: Any, sine: Any) -> Any:
    return lib.sqrt((1.0 - sine) * (1.0 + sine))


def rod_rate(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the rate of the rod's angle, psi' = d psi / d alpha = lambda cos alpha / cos psi (K2)."""
    return rod_ratio * lib.cos(alpha) / cos_psi(lib, alpha, rod_ratio, offset_ratio)


def rod_acceleration(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the acceleration of the rod's angle, psi'' = (psi'^2 sin psi - lambda sin alpha) / cos psi (K3)."""
    height = rod_ratio * lib.sin(alpha)
    sine = height - offset_ratio
    cosine = _cosine(lib, sine)
    rate = rod_ratio * lib.cos(alpha) / cosine
    return (rate * rate * sine - height) / cosine


def travel(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the piston travel from alpha = 0, (s(0) - s(alpha)) / r (K4; Roetscher eq. 285).

    The formula has no differences of near-equal numbers, so it holds for any rod ratio
    down to the Scotch yoke.
    """
    half = lib.sin(0.5 * alpha)
    sine = lib.sin(alpha)
    start = lib.sqrt((1.0 - offset_ratio) * (1.0 + offset_ratio))
    rod_part = sine * (rod_ratio * sine - 2.0 * offset_ratio)
    return 2.0 * half * half + rod_part / (start + _cosine(lib, rod_ratio * sine - offset_ratio))


def piston_velocity(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the piston velocity s' / r = -sin alpha - cos alpha tan psi, positive away from the crank (K5)."""
    height = lib.sin(alpha)
    sine = rod_ratio * height - offset_ratio
    return -height - lib.cos(alpha) * (sine / _cosine(lib, sine))


def piston_acceleration(lib: Any, alpha: Any, rod_ratio: Any, offset_ratio: Any = 0.0) -> Any:
    """Return the piston acceleration s'' / r = -cos alpha + sin alpha tan psi - lambda cos^2 alpha / cos^3 psi (K6)."""
    height, turning = lib.sin(alpha), lib.cos(alpha)
    sine = rod_ratio * height - offset_ratio
    cosine = _cosine(lib, sine)
    return -turning + height * sine / cosine - rod_ratio * turning * turning / (cosine * cosine * cosine)
