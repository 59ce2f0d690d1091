"""Unbalance of drilled holes and slugs, the planes that they correct, and the angles of a balancing machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray, Mask

SMALLEST_SHARE = 0.3
"""Smallest share of the permitted unbalance that a plane gets."""


@dataclass(frozen=True)
class Drilling:
    """Material and form of holes.

    Attributes
    ----------
    density
        Density of the rotor [kg/m3].
    is_radial
        True for holes towards the axis, from the surface; False for holes along the axis.
    point_angle
        Included angle of the drill's point [rad]; pi for a flat bottom.
    slug_density
        Density of the slugs [kg/m3]; None if slugs are not allowed.
    """

    density: float
    is_radial: bool = False
    point_angle: float = math.pi
    slug_density: float | None = None

    def point_height(self, diameter: float) -> float:
        """Return the height of the cone that the drill's point leaves [m] (U2)."""
        return 0.5 * diameter / math.tan(0.5 * self.point_angle)

    def tip(self, diameter: float, depth: float) -> float:
        """Return the depth to the tip of the drill's point [m]."""
        return depth + self.point_height(diameter)

    def hole(self, diameter: float, depth: float, radius: float, filled: bool = False) -> Hole:
        """Return a hole; `radius` is that of the axis of an axial hole, or of the surface at a radial one [m]."""
        # a round end covers a drill's point that is not longer than the radius of the hole
        end = depth + max(self.point_height(diameter) - 0.5 * diameter, 0.0)
        change = self.unbalance(diameter, depth, radius, filled)
        return Hole(diameter, depth, filled, change, radius - end * self.is_radial)

    def mass(self, diameter: float, depth: float, filled: bool = False) -> float:
        """Return the change of mass by a hole, or by a hole with a slug [kg] (U2)."""
        return sum(mass for mass, _ in self._bodies(diameter, depth, filled))

    def unbalance(self, diameter: float, depth: float, radius: float, filled: bool = False) -> float:
        """Return the change of unbalance by a hole, or by a hole with a slug [kg m] (U3).

        Parameters
        ----------
        diameter, depth
            Diameter of the hole, and its depth to the end of the full diameter [m].
        radius
            Radius of the axis of an axial hole, or of the surface at a radial hole [m].
        filled
            True if a slug fills the full diameter; the cone below it stays empty.
        """
        return sum(mass * (radius - centre * self.is_radial) for mass, centre in self._bodies(diameter, depth, filled))

    def _bodies(self, diameter: float, depth: float, filled: bool) -> tuple[tuple[float, float], ...]:
        # mass and depth of the centre of the cylinder and of the cone
        area, height = 0.25 * math.pi * diameter**2, self.point_height(diameter)
        fill = self.slug_density if filled and self.slug_density is not None else 0.0
        cylinder = (fill - self.density) * area * depth
        return (cylinder, 0.5 * depth), (-self.density * area * height / 3.0, depth + 0.25 * height)


@dataclass(frozen=True)
class Hole:
    """Hole that a place may get.

    Attributes
    ----------
    diameter, depth
        Diameter, and depth to the end of the full diameter [m].
    filled
        True with a slug.
    change
        Change of the unbalance [kg m], negative for a hole without slug.
    end
        Radius on the crank at which its axis ends [m], with a round end of its diameter beyond (U5).
    """

    diameter: float
    depth: float
    filled: bool
    change: float
    end: float


Design: TypeAlias = tuple[tuple[int, int], ...]
"""Holes of a plane: (place, hole of this place), as indices from zero, places in ascending order."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Correction plane with its places and the holes that each may get.

    Attributes
    ----------
    name
        Name of the plane.
    radius
        Radius of the hole circle, or of the drilled surface [m].
    initial
        Unbalance before correction [kg m], at its angle on the crank (C4).
    angles
        Angles of the places on the crank [rad].
    holes
        Holes that each place may get.
    permitted
        Permitted residual unbalance [kg m]; None if only the least residual is of interest.
    wall
        Least thickness of material between two holes [m].
    solid
        Sectors without holes, from one angle to the next with the rotation [rad].
    """

    name: str
    radius: float
    initial: complex
    angles: tuple[float, ...]
    holes: tuple[tuple[Hole, ...], ...]
    permitted: float | None = None
    wall: float = 0.0
    solid: tuple[tuple[float, float], ...] = ()

    @cached_property
    def changes(self) -> tuple[ComplexArray, ...]:
        """Changes of the unbalance by the holes of each place [kg m]."""
        return tuple(
            np.array([hole.change for hole in holes]) * np.exp(1j * angle)
            for angle, holes in zip(self.angles, self.holes, strict=True)
        )

    @cached_property
    def sizes(self) -> tuple[tuple[Array, Array], ...]:
        """Diameters of the holes of each place, and radii at which their axes end [m]."""
        return tuple((np.array([h.diameter for h in there]), np.array([h.end for h in there])) for there in self.holes)

    def residual(self, design: Design) -> complex:
        """Return the unbalance after correction [kg m] (U4)."""
        return self.initial + sum(complex(self.changes[place][hole]) for place, hole in design)

    def score(self, design: Design, waste: float) -> float:
        """Return the residual plus a share `waste` of the sum of all changes [kg m]."""
        return abs(self.residual(design)) + waste * sum(abs(self.holes[place][hole].change) for place, hole in design)

    def clashes(self, place: int, other: int) -> Mask:
        """Return which holes of two places leave too little material between them, shape (holes, holes) (U5)."""
        (diameters, ends), (others, other_ends) = self.sizes[place], self.sizes[other]
        bend = 4.0 * math.sin(0.5 * (self.angles[place] - self.angles[other])) ** 2
        # the shallower hole is nearest at its end, to the end or to the side of the deeper one
        deep, shallow = np.minimum(ends[:, None], other_ends), np.maximum(ends[:, None], other_ends)
        along = np.maximum(deep, shallow * (1.0 - 0.5 * bend))
        square = (along - shallow) ** 2 + bend * along * shallow
        clash: Mask = (0.5 * (diameters[:, None] + others) + self.wall) ** 2 > square * (1.0 + 2e-12)
        return clash


@dataclass(frozen=True)
class Dial:
    """Angles that a balancing machine shows.

    Attributes
    ----------
    zero
        Angle of the zero mark on the crank [rad].
    sense
        1 if the machine counts with the rotation, -1 if against it.
    """

    zero: float = 0.0
    sense: float = 1.0

    def on_crank(self, reading: float) -> float:
        """Return the angle on the crank of a reading [rad] (U6)."""
        return self.zero + self.sense * reading

    def reading(self, angle: float) -> float:
        """Return the reading of an angle on the crank, from 0 to a turn [rad] (U6)."""
        turns = self.sense * (angle - self.zero) / math.tau
        turns -= math.floor(turns)
        # an angle that rounds to a whole turn is read as zero
        return 0.0 if turns > 1.0 - 1e-12 else math.tau * turns


def plane_shares(places: Sequence[float], centre: float) -> tuple[float, float]:
    """Return the shares of two planes in the permitted unbalance of a rotor, by the lever rule (U7).

    Parameters
    ----------
    places
        Places of the planes along the axis [m].
    centre
        Place of the centre of mass [m], between the planes.
    """
    first, second = places
    share = (second - centre) / (second - first)
    share = min(max(share, SMALLEST_SHARE), 1.0 - SMALLEST_SHARE)
    return share, 1.0 - share
