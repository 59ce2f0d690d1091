"""Engines of equal total power from one cylinder design (Hasselgruber 1964, eqs. 14-23).

Brake mean pressure and mean piston speed stay, cylinders stay geometrically similar;
then z D^2 is constant and every length follows the bore.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EqualPowerScale:
    """Factors from the reference engine to one of z cylinders and the same power.

    Attributes
    ----------
    length
        Bore, stroke and every other length (eqs. 18, 19).
    speed
        Crank speed (eq. 20).
    cylinder_volume
        Displacement of one cylinder (eq. 21).
    displacement
        Of the engine (eq. 22).
    force
        Mount forces, gas and inertia alike (eq. 23).
    mass
        Of similar parts in the same material.
    """

    length: float
    speed: float
    cylinder_volume: float
    displacement: float
    force: float
    mass: float


def equal_power_scale(cylinders: int, reference_cylinders: int) -> EqualPowerScale:
    """Return the factors from an engine with `reference_cylinders` to one with `cylinders` (eqs. 14-23)."""
    ratio = cylinders / reference_cylinders
    return EqualPowerScale(
        length=ratio**-0.5,
        speed=ratio**0.5,
        cylinder_volume=ratio**-1.5,
        displacement=ratio**-0.5,
        force=1.0 / ratio,
        mass=ratio**-1.5,
    )
