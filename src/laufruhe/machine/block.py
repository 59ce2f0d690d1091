"""The body that the mounts carry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.mount import Matrix3, Vector3
from laufruhe.numerics.arrays import Array

_SLACK = 1e-9


@dataclass(frozen=True)
class Block:
    """Engine, gearbox and all that is bolted to them, as one rigid body.

    Attributes
    ----------
    mass
        Mass of everything that the mounts carry, moving parts included [kg].
    inertia
        Inertia tensor about the centre of gravity in the axes of C2 [kg m2]; xy = - integral of x y dm.
    centre_of_gravity
        Position (x, y, z) [m] (C2).
    turning_inertia
        Inertia of what turns with the crank at its imposed speed, about the crank axis [kg m2]: a part of `inertia`
        that does not roll with the block (E1a).
    """

    mass: float
    inertia: Matrix3
    centre_of_gravity: Vector3 = (0.0, 0.0, 0.0)
    turning_inertia: float = 0.0

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and math.isfinite(self.mass)):
            raise ModelError(f"the block's mass {self.mass:g} kg must be positive")
        tensor = np.array(self.inertia, dtype=float)
        if not np.all(np.isfinite(tensor)) or np.abs(tensor - tensor.T).max() > _SLACK * np.abs(tensor).max():
            raise ModelError("the block's inertia tensor is not symmetric; give xy, xz and yz once each")
        small, middle, large = np.linalg.eigvalsh(tensor)
        if small <= 0.0:
            raise ModelError(
                f"the block's inertia tensor has a principal moment of {small:.4g} kg m2, which must be positive; "
                "check the products of inertia and their sign"
            )
        if large > (small + middle) * (1.0 + _SLACK):
            raise ModelError(
                f"the block's principal moments of inertia {small:.4g}, {middle:.4g}, {large:.4g} kg m2 belong to no "
                "body, the largest must not exceed the sum of the others; check the numbers and the signs of products"
            )

        still = float(np.linalg.det(tensor) / np.linalg.det(tensor[1:, 1:]))
        if not 0.0 <= self.turning_inertia < still * (1.0 - _SLACK):
            raise ModelError(
                f"turning_inertia {self.turning_inertia:.4g} kg m2 must not be negative, and less than the "
                f"{still:.4g} kg m2 with which the block resists a roll; turning_inertia is a part of inertia"
            )

    @property
    def tensor(self) -> Array:
        """Inertia tensor without `turning_inertia`, shape (3, 3) [kg m2] (E1a)."""
        return np.array(self.inertia, dtype=float) - np.diag([self.turning_inertia, 0.0, 0.0])

    @property
    def mass_matrix(self) -> Array:
        """Mass matrix M for displacement u and rotation theta at the centre of gravity, shape (6, 6) (E1)."""
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = self.mass * np.eye(3)
        matrix[3:, 3:] = self.tensor
        return matrix


@dataclass(frozen=True)
class LoadCase:
    """Static forces and moments on the block, whose travel counts from its position without them (E55).

    Attributes
    ----------
    times_weight
        Multiples of the weight of the block along x, y and z (C2).
    force, place, moment
        Force [N], point where it acts [m], and moment [N m].
    """

    name: str
    times_weight: Vector3 = (0.0, 0.0, 0.0)
    force: Vector3 = (0.0, 0.0, 0.0)
    place: Vector3 = (0.0, 0.0, 0.0)
    moment: Vector3 = (0.0, 0.0, 0.0)
