"""Shafts and the unbalances that turn with them."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar

from laufruhe.errors import ModelError


@dataclass(frozen=True)
class Shaft:
    """A straight shaft along x, geared to the crank at a fixed ratio.

    Attributes
    ----------
    ratio
        Speed over crank speed; negative if it runs against the crank (C3).
    y, z
        Position of the axis in the plane across the crank axis [m] (C2).
    """

    name: str
    ratio: float = 1.0
    y: float = 0.0
    z: float = 0.0
    powers: ClassVar = {"y": (0, 1), "z": (0, 1)}

    def __post_init__(self) -> None:
        if self.ratio == 0.0:
            raise ModelError(f"shaft '{self.name}' has ratio 0: a shaft that stands still balances nothing")


CRANKSHAFT = Shaft("crankshaft")


class Role(StrEnum):
    """Purpose of an unbalance; mass limits count by it."""

    THROW = "throw"
    COUNTERWEIGHT = "counterweight"
    BALANCER = "balancer"


@dataclass(frozen=True)
class Rotor:
    """Unbalance on a shaft (C4).

    Attributes
    ----------
    x
        Position along the crank axis [m].
    unbalance
        Mass times eccentricity at phi = 0, as a complex number z + i y [kg m].
    radius
        Eccentricity of its mass [m]; None if the mass itself is not needed.
    reach
        Radius that its body sweeps about the shaft [m]; None if it has no body.
    """

    name: str
    x: float
    unbalance: complex
    shaft: Shaft = CRANKSHAFT
    role: Role = Role.COUNTERWEIGHT
    radius: float | None = None
    reach: float | None = None
    powers: ClassVar = {"unbalance": (1, 1), **dict.fromkeys(("x", "radius", "reach"), (0, 1))}

    @property
    def place(self) -> tuple[float, float, float]:
        """Position: x of the rotor, y and z of its shaft [m] (C2)."""
        return self.x, self.shaft.y, self.shaft.z

    def placed(self, x: float, y: float, z: float) -> Rotor:
        """Return the rotor at another position, its shaft moved with it."""
        moved = self.shaft if (y, z) == (self.shaft.y, self.shaft.z) else replace(self.shaft, y=y, z=z)
        return replace(self, x=x, shaft=moved)

    @property
    def mass(self) -> float:
        """Mass [kg] that makes the unbalance at the radius given."""
        if self.radius is None:
            raise ModelError(f"rotor '{self.name}' has no radius, so its mass is not known")
        return abs(self.unbalance) / self.radius


@dataclass(frozen=True)
class GearedInertia:
    """A second crank, or a flywheel of its own, geared to the crank.

    Attributes
    ----------
    ratio
        Speed over crank speed; negative if it runs against the crank (C3).
    share
        Share of the inertia of all that turns, reduced to the crank: n^2 J_n over the sum of all (L8).
    """

    name: str
    ratio: float
    share: float

    def __post_init__(self) -> None:
        if self.ratio == 0.0:
            raise ModelError(f"geared inertia '{self.name}' has ratio 0: it stands still; give a ratio such as 2 or -1")
        if not 0.0 <= self.share <= 1.0:
            raise ModelError(
                f"geared inertia '{self.name}' has a share of {self.share:g}; give a share between 0 and 1"
            )


_GRADE = re.compile(r"^\s*G\s*(\d+\.?\d*|\.\d+)\s*$")


def grade_of(text: str) -> float | None:
    """Return the balance quality grade [m/s] of a text such as "G 6.3" (in mm/s), or None."""
    match = _GRADE.match(text)
    return float(match.group(1)) * 1e-3 if match else None


def permitted_unbalance(grade: float, mass: float, speed: float) -> float:
    """Return the unbalance [kg m] that a grade [m/s] permits at the fastest service speed, summed over planes (R1)."""
    return grade * mass / speed
