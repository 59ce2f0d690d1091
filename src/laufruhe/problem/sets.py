"""Sets of allowed values of decisions, with nearest points and minima of linear functions (P4)."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array

Value: TypeAlias = complex | float

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
        """Largest size."""
        return max(abs(self.lower), abs(self.upper)) or 1.0

    def scaled(self, factor: float) -> Interval:
        """Return the set in a unit of another size."""
        return replace(self, lower=self.lower * factor, upper=self.upper * factor)

    def within(self, size: float) -> Interval:
        """Return the part of the set that is not larger than a size."""
        return replace(self, lower=max(self.lower, -size), upper=min(self.upper, size))

    @property
    def angles(self) -> tuple[float, float]:
        """Bounds of the angle [rad], which are equal."""
        return self.angle, self.angle

    @property
    def directions(self) -> tuple[complex, ...]:
        """Complex value per unit of each column (C4)."""
        return (cmath.exp(1j * self.angle),) if self.angle else (1.0 + 0.0j,)

    def split(self, u: Value) -> tuple[float, float]:
        """Return the size and angle [rad] of a value."""
        return (u * self.directions[0].conjugate()).real, self.angle

    def minimum(self, g: Array) -> float:
        """Return min g . x over the set."""
        return float(min(g[0] * self.lower, g[0] * self.upper))

    def project(self, v: Array) -> Array:
        """Return the nearest point of the set."""
        return np.clip(v, self.lower, self.upper)

    def margins(self, _: Array) -> tuple[float, ...]:
        """Return relative distances from edges that are no bounds of a column: none."""
        return ()

    def inside(self, v: Array) -> Array:
        """Return the directions in which a point of the set is not on a bound, shape (1, m)."""
        x = float(v[0])
        on_bound = any(abs(x - bound) <= EDGE * max(abs(x), abs(bound)) for bound in (self.lower, self.upper))
        return np.eye(1, int(not on_bound))


@dataclass(frozen=True)
class Sector:
    """A complex number of limited size with its angle between bounds; a disc if these are a turn apart (C4)."""

    upper: float
    angles: tuple[float, float] = (0.0, math.tau)
    lower: ClassVar[float] = 0.0
    width: ClassVar[int] = 2
    directions: ClassVar[tuple[complex, ...]] = (1.0 + 0.0j, 1.0j)

    @property
    def scale(self) -> float:
        """Largest size."""
        return self.upper or 1.0

    def scaled(self, factor: float) -> Sector:
        """Return the set in a unit of another size."""
        return replace(self, upper=self.upper * factor)

    def within(self, size: float) -> Sector:
        """Return the part of the set that is not larger than a size."""
        return replace(self, upper=min(self.upper, size))

    @property
    def free_angle(self) -> bool:
        """True if every angle is allowed."""
        return self.angles[1] - self.angles[0] >= math.tau * (1.0 - 1e-12)

    @property
    def edges(self) -> Array:
        """Unit vectors along the two sides, shape (2, 2); shape (0, 2) for a disc."""
        if self.free_angle:
            return np.zeros((0, 2))
        low, high = self.angles
        return np.array([[np.cos(low), np.sin(low)], [np.cos(high), np.sin(high)]])

    def split(self, u: Value) -> tuple[float, float]:
        """Return the size and angle [rad] of a value, the angle at most a turn over the lower bound."""
        low = self.angles[0]
        return abs(u), low + (cmath.phase(u) - low) % math.tau if u != 0 else low

    def minimum(self, g: Array) -> float:
        """Return min g . x over the set: the negative support function of -g (P4)."""
        if self._inside_cone(-g):
            return -self.upper * float(np.hypot(*g))
        return min(0.0, self.upper * float((self.edges @ g).min()))

    def project(self, v: Array) -> Array:
        """Return the nearest point of the set."""
        if not self._inside_cone(v):
            along = np.maximum(self.edges @ v, 0.0)
            best = int(np.argmax(along))
            v = along[best] * self.edges[best]
        size = float(np.hypot(*v))
        return v * (self.upper / size) if size > self.upper else v

    def margins(self, v: Array) -> tuple[float, ...]:
        """Return relative distances of a point from the arc, and from the sides if they enclose under half a turn."""
        arc = 0.5 * (1.0 - float(v @ v) / self.scale**2)
        sides = zip(self.edges, (1.0, -1.0), strict=False)
        return arc, *(sense * float(a * v[1] - b * v[0]) / self.scale for (a, b), sense in sides)

    def inside(self, v: Array) -> Array:
        """Return the directions in which a point of the set is not on a bound, shape (2, m)."""
        size = float(np.hypot(*v))
        if size >= self.upper * (1.0 - EDGE):
            return np.zeros((2, 0))
        along = [edge[:, None] for edge in self.edges if abs(edge[0] * v[1] - edge[1] * v[0]) <= EDGE * size]
        return along[0] if along else np.eye(2)

    def _inside_cone(self, v: Array) -> bool:
        if self.free_angle:
            return True
        (ax, ay), (bx, by) = self.edges
        return bool(ax * v[1] - ay * v[0] >= 0.0 and bx * v[1] - by * v[0] <= 0.0)


Set: TypeAlias = Interval | Sector
