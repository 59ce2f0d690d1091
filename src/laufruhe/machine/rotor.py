"""Shafts and the unbalances that turn with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from laufruhe.errors import ModelError


@dataclass(frozen=True)
class Shaft:
    """A straight shaft along x, geared to the crank at a fixed ratio.

    Attributes
    ----------
    ratio
        Speed over crank speed; negative runs against the crank (C3).
    y, z
        Place of the axis in the plane across the crank axis [m] (C2).
    """

    name: str
    ratio: float = 1.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        if self.ratio == 0.0:
            raise ModelError(f"shaft '{self.name}' has ratio 0: a shaft that stands still balances nothing")

    def scaled(self, length: float) -> Shaft:
        """Return the shaft in another size."""
        return replace(self, y=self.y * length, z=self.z * length)


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
        Place along the crank axis [m].
    unbalance
        Mass times eccentricity, at its angle when phi = 0 [kg m], zeta = z + i y.
    role
        Part of a throw, counterweight, or balancer.
    radius
        Eccentricity of its mass [m], where the mass itself matters.
    """

    name: str
    x: float
    unbalance: complex
    shaft: Shaft = CRANKSHAFT
    role: Role = Role.COUNTERWEIGHT
    radius: float | None = None

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
