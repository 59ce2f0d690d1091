"""Engines of equal total power from one cylinder design (Hasselgruber 1964, eqs. 14-23).

Brake mean pressure and mean piston speed stay, cylinders stay geometrically similar;
then z D^2 is constant and every length follows the bore.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EqualPowerScale:
    """Factors from the reference engine to one of z cylinders and the same power.

    Volumes and masses of parts grow as the cube of length (eq. 21), forces of gas and inertia as its square (eq. 23).

    Attributes
    ----------
    length
        Factor of bore, stroke and every other length (eqs. 18, 19).
    speed
        Factor of crank speed (eq. 20).
    """

    length: float
    speed: float
    mass: float


def equal_power_scale(cylinders: int, reference_cylinders: int) -> EqualPowerScale:
    """Return the factors from an engine with `reference_cylinders` to one with `cylinders` (eqs. 14-23)."""
    ratio = cylinders / reference_cylinders
    return EqualPowerScale(length=ratio**-0.5, speed=ratio**0.5, mass=ratio**-1.5)
