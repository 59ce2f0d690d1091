"""Bodies of a mechanism: the rod, the motion of masses, and drawn outlines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Rod:
    """Connecting rod as a rigid body, of a mass [kg] and a length between the pins [m].

    Attributes
    ----------
    centre_of_gravity
        Distance from the crank pin, on the line of the pins [m].
    inertia
        Moment of inertia about the centre of gravity, across the plane of motion [kg m2].
    """

    length: float
    mass: float
    centre_of_gravity: float
    inertia: float

    @property
    def reciprocating_mass(self) -> float:
        """Mass at the piston pin [kg]: masses at both pins keep the rod's mass and centre of gravity (eq. 9)."""
        return self.mass * self.centre_of_gravity / self.length

    @property
    def rotating_mass(self) -> float:
        """Mass at the crank pin [kg]."""
        return self.mass - self.reciprocating_mass

    @property
    def inertia_deficit(self) -> float:
        """Inertia of the rod less that of its two masses, Theta - m1 s1^2 - m2 s2^2 [kg m2] (eqs. 9, 10)."""
        return self.inertia - self.mass * self.centre_of_gravity * (self.length - self.centre_of_gravity)


@dataclass(frozen=True)
class Motion:
    """Masses of a mechanism and their motion over the crank's own angle alpha (C5).

    The plane is turned so that the cylinder axis is real: zeta e^{-i beta} (C4). Momentum of all this is
    the mechanism's load; the mass at the crank pin is a rotor and left out.

    Attributes
    ----------
    points
        Masses [kg], each with its position [m] and the first two derivatives by alpha. The piston comes first.
    swings
        Inertias that point masses leave out [kg m2], each with the first two derivatives of its angle by alpha.
    """

    points: tuple[tuple[float, tuple[Any, Any, Any]], ...]
    swings: tuple[tuple[float, tuple[Any, Any]], ...] = ()


@dataclass(frozen=True)
class Outline:
    """A body as it is drawn.

    Attributes
    ----------
    points
        Points of a closed line about the shaft, in the plane turned to the cylinder axis [m].
    width
        Width along the shaft [m].
    moves
        True if the body moves; False if it belongs to the block.
    """

    points: Any
    width: float
    moves: bool


def bar(first: complex, last: complex, width: float) -> Any:
    """Return the corners of a bar between two points, as long as their distance [m]."""
    along = 0.5 * (last - first)
    across = 0.5j * width * along / abs(along)
    return first + along * np.array([2, 2, 0, 0]) + across * np.array([1, -1, -1, 1])
