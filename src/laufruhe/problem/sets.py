"""Sets of allowed values of decisions, with nearest points and minima of linear functions (P4)."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array

Value: TypeAlias = complex | float

SAME_ANGLE = 1e-12
"""Difference of angles that is a rounding error [rad]."""
EDGE = 1e-6
"""Fraction of a size within which a point counts as lying on a bound."""


@dataclass(frozen=True)
class Interval:
    """A real number between bounds, along a direction in the plane across the crank (C4)."""

    lower: float
    upper: float
    angle: float = 0.0
    width: ClassVar[int] = 1
    free_angle: ClassVar[bool] = False
    edges: ClassVar[Array] = np.zeros((0, 2))

    @property
    def scale(self) -> float:
        """Largest absolute value; one if that is zero."""
        return max(abs(self.lower), abs(self.upper)) or 1.0

    def scaled(self, factor: float) -> Interval:
        """Return the set with all values multiplied by a factor."""
        return replace(self, lower=self.lower * factor, upper=self.upper * factor)

    def within(self, size: float) -> Interval:
        """Return the subset of values whose absolute value is at most `size`."""
        return replace(self, lower=max(self.lower, -size), upper=min(self.upper, size))

    @property
    def angles(self) -> tuple[float, float]:
        """Lower and upper bound of the angle [rad], equal for an interval."""
        return self.angle, self.angle

    @property
    def directions(self) -> tuple[complex, ...]:
        """Complex value per unit of each column (C4)."""
        return (cmath.exp(1j * self.angle),) if self.angle else (1.0 + 0.0j,)

    def split(self, u: Value) -> tuple[float, float]:
        """Return the size and angle [rad] of a value."""
        return (u * self.directions[0].conjugate()).real, self.angle

    def minimum(self, g: Array) -> float:
        """Return the minimum of a linear function g . x over the points x of the set, g of shape (1,)."""
        return float(min(g[0] * self.lower, g[0] * self.upper))

    def project(self, v: Array) -> Array:
        """Return the point of the set nearest to v, shape (1,)."""
        return np.clip(v, self.lower, self.upper)

    def margins(self, _: Array) -> tuple[float, ...]:
        """Return relative distances to edges that are not bounds of one column: none for an interval."""
        return ()

    def inside(self, v: Array) -> Array:
        """Return the directions in which a point of the set can move both ways, shape (1, m), m = 0 on a bound."""
        x = float(v[0])
        on_bound = any(abs(x - bound) <= EDGE * max(abs(x), abs(bound)) for bound in (self.lower, self.upper))
        return np.eye(1, int(not on_bound))


@dataclass(frozen=True)
class Sector:
    """A complex number of limited size with its angle between bounds; a disc if these differ by a turn (C4)."""

    upper: float
    angles: tuple[float, float] = (0.0, math.tau)
    lower: ClassVar[float] = 0.0
    width: ClassVar[int] = 2
    directions: ClassVar[tuple[complex, ...]] = (1.0 + 0.0j, 1.0j)

    @property
    def scale(self) -> float:
        """Largest absolute value; one if that is zero."""
        return self.upper or 1.0

    def scaled(self, factor: float) -> Sector:
        """Return the set with all values multiplied by a factor."""
        return replace(self, upper=self.upper * factor)

    def within(self, size: float) -> Sector:
        """Return the subset of values whose absolute value is at most `size`."""
        return replace(self, upper=min(self.upper, size))

    @property
    def free_angle(self) -> bool:
        """True if every angle is allowed."""
        return self.angles[1] - self.angles[0] >= math.tau * (1.0 - 1e-12)

    @property
    def edges(self) -> Array:
        """Unit vectors along the two straight edges of the sector, shape (2, 2); shape (0, 2) for a disc."""
        if self.free_angle:
            return np.zeros((0, 2))
        low, high = self.angles
        return np.array([[np.cos(low), np.sin(low)], [np.cos(high), np.sin(high)]])

    def split(self, u: Value) -> tuple[float, float]:
        """Return the size and angle [rad] of a value, the angle within one turn above its lower bound."""
        low = self.angles[0]
        turn = (cmath.phase(u) - low) % math.tau if u != 0 else 0.0
        # a rounding error below the lower bound is no turn
        return abs(u), low + (turn if turn < math.tau - SAME_ANGLE else 0.0)

    def minimum(self, g: Array) -> float:
        """Return the minimum of g . x over the set, g of shape (2,): minus the support function of -g (P4)."""
        if self._inside_cone(-g):
            return -self.upper * float(np.hypot(*g))
        return min(0.0, self.upper * float((self.edges @ g).min()))

    def project(self, v: Array) -> Array:
        """Return the point of the set nearest to v, shape (2,)."""
        if not self._inside_cone(v):
            components = np.maximum(self.edges @ v, 0.0)
            best = int(np.argmax(components))
            v = components[best] * self.edges[best]
        size = float(np.hypot(*v))
        return v * (self.upper / size) if size > self.upper else v

    def margins(self, v: Array) -> tuple[float, ...]:
        """Return relative distances of a point from the arc and the straight edges of the sector, negative outside.

        A disc has no straight edges.
        """
        arc = 0.5 * (1.0 - float(v @ v) / self.scale**2)
        sides = zip(self.edges, (1.0, -1.0), strict=False)
        return arc, *(sense * float(a * v[1] - b * v[0]) / self.scale for (a, b), sense in sides)

    def inside(self, v: Array) -> Array:
        """Return the directions along which a point of the set can move forward and back, shape (2, m), m = 0 ... 2."""
        size = float(np.hypot(*v))
        if size >= self.upper * (1.0 - EDGE):
            return np.zeros((2, 0))
        edge_directions = [edge[:, None] for edge in self.edges if abs(edge[0] * v[1] - edge[1] * v[0]) <= EDGE * size]
        return edge_directions[0] if edge_directions else np.eye(2)

    def _inside_cone(self, v: Array) -> bool:
        if self.free_angle:
            return True
        (ax, ay), (bx, by) = self.edges
        return bool(ax * v[1] - ay * v[0] >= 0.0 and bx * v[1] - by * v[0] <= 0.0)


Set: TypeAlias = Interval | Sector
