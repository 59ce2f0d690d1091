"""Counterweights as bodies: mass, unbalance and inertia, and sizes that follow from an unbalance (H8 to H10)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

from laufruhe.errors import ModelError
from laufruhe.extensions.workshop.shapes import Shape
from laufruhe.units import readable_unbalance

SHORT = 1e-6
"""Accuracy of a radius that a clearance limits [m]."""
_STEPS = 9
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Body:
    """A weight of constant thickness, or two equal ones on either side of a throw.

    Attributes
    ----------
    thickness
        Length along the shaft, of each [m].
    density
        Density [kg/m3].
    spacing
        Distance between the middles of two equal weights [m]; 0 for one weight.
    """

    shape: Shape
    thickness: float
    density: float
    spacing: float = 0.0
    powers: ClassVar = {"thickness": (0, 1), "spacing": (0, 1), "density": (1, -3)}

    @property
    def per_area(self) -> float:
        """Mass over the area of its shape [kg/m2]."""
        return self.density * self.thickness * (2.0 if self.spacing else 1.0)

    @property
    def mass(self) -> float:
        """Mass [kg] (H8)."""
        return self.per_area * self.shape.moments.area

    @property
    def unbalance(self) -> float:
        """Unbalance along the middle of the shape [kg m] (H8)."""
        return self.per_area * self.shape.moments.first.real

    @property
    def inertia(self) -> float:
        """Moment of inertia about the shaft [kg m2] (H8)."""
        return self.per_area * self.shape.moments.polar

    def extents(self, x: float) -> tuple[tuple[float, float], ...]:
        """Return the rear and front end of each weight of a rotor at x [m]."""
        half, middles = 0.5 * self.thickness, (x - 0.5 * self.spacing, x + 0.5 * self.spacing)
        return tuple((middle - half, middle + half) for middle in dict.fromkeys(middles))


@dataclass(frozen=True)
class BodyRange:
    """Bodies between the smallest and the largest sizes of a file; equal if all sizes are fixed.

    Only outer radius, thickness and breadth (angle or width) may differ.
    """

    smallest: Body
    largest: Body

    @property
    def is_open(self) -> bool:
        """True if a size is open."""
        return self.smallest != self.largest

    @property
    def has_open_shape(self) -> bool:
        """True if a size apart from the thickness is open, so that the centre of mass moves."""
        return self.smallest.shape != self.largest.shape


@dataclass(frozen=True)
class BodyFit:
    """Bodies of least mass, one for each unbalance from `least_unbalance` to `largest` (H9, H10).

    With growing unbalance first the outer radius grows, then the thickness, then the angle or width.

    Attributes
    ----------
    sizes
        Range of the sizes.
    is_clear
        Function that returns True for a shape that keeps its clearances with the largest thickness.
    """

    sizes: BodyRange
    is_clear: Callable[[Shape], bool]

    def _shape(self, radius: float, breadth: float | None = None) -> Shape:
        shape = self.sizes.smallest.shape.sized(outer_radius=radius)
        return shape if breadth is None else shape.sized(**{shape.breadth: breadth})

    @cached_property
    def _radii(self) -> tuple[float, float]:
        return self.sizes.smallest.shape.outer_radius, self.sizes.largest.shape.outer_radius

    @cached_property
    def _breadths(self) -> tuple[float, float] | None:
        low, high = (body.shape.sizes.get(body.shape.breadth) for body in (self.sizes.smallest, self.sizes.largest))
        return None if low is None or high is None or low == high else (low, high)

    @cached_property
    def fits(self) -> bool:
        """True if the smallest shape keeps its clearances."""
        return self.is_clear(self.sizes.smallest.shape)

    @cached_property
    def _is_free(self) -> bool:
        return self.is_clear(self.sizes.largest.shape)

    def _widest(self, breadth: float | None) -> Shape:
        """Return the shape of this breadth with the largest outer radius that keeps its clearances."""
        low, high = self._radii
        if breadth is not None and self._is_one_radius:
            return self._shape(self.narrow.outer_radius, breadth)
        if self._is_free or self.is_clear(self._shape(high, breadth)):
            return self._shape(high, breadth)
        if not self.is_clear(self._shape(low, breadth)):
            raise ModelError("no outer radius keeps the clearance")
        while high - low > SHORT:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.is_clear(self._shape(middle, breadth)) else (low, middle)
        return self._shape(low, breadth)

    def _first_moment(self, breadth: float) -> float:
        try:
            return self._widest(breadth).moments.first.real
        except ModelError:
            return 0.0

    @cached_property
    def narrow(self) -> Shape:
        """Shape of the least breadth with its largest radius."""
        return self._widest(None)

    @cached_property
    def _is_one_radius(self) -> bool:
        # true if the largest breadth allows the radius of the least one, and so every breadth between does
        return self._breadths is not None and self.is_clear(self._shape(self.narrow.outer_radius, self._breadths[1]))

    @cached_property
    def _best_breadth(self) -> float | None:
        """Breadth with the largest first moment; None if the breadth is fixed."""
        from scipy.optimize import minimize_scalar

        if self._breadths is None or self._is_free or self._is_one_radius:
            return None if self._breadths is None else self._breadths[1]
        low, high = self._breadths
        places = [low + (high - low) * k / (_STEPS - 1) for k in range(_STEPS)]
        moments = [self._first_moment(place) for place in places]
        k = max(range(_STEPS), key=moments.__getitem__)
        ends = places[max(k - 1, 0)], places[min(k + 1, _STEPS - 1)]
        best = minimize_scalar(
            lambda b: -self._first_moment(b), bounds=ends, method="bounded", options={"xatol": 1e-5 * (high - low)}
        )
        return float(best.x) if -best.fun > moments[k] else places[k]

    @cached_property
    def largest(self) -> Body:
        """Body with the largest unbalance that keeps its clearances."""
        shape = self.narrow if self._best_breadth is None else self._widest(self._best_breadth)
        return replace(self.sizes.largest, shape=shape)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest unbalance [kg m]."""
        return self.sizes.smallest.unbalance, max(self.largest.unbalance, self.sizes.smallest.unbalance)

    def body_of(self, unbalance: float) -> Body:
        """Return the body of least mass with this unbalance [kg m] (H10).

        Raise ModelError if no body within the range has it.
        """
        low, high = self.bounds
        slack = _ROUNDING * high
        if not low - slack <= unbalance <= high + slack:
            unit, factor = readable_unbalance(max(unbalance, high))
            rule = f"an unbalance of {factor * unbalance:.5g} {unit} is outside the range of the body"
            raise ModelError(f"{rule}, {factor * low:.5g} to {factor * high:.5g} {unit}")
        small, large = self.sizes.smallest, self.sizes.largest
        thin, thick = replace(small, shape=self.narrow), replace(large, shape=self.narrow)
        if unbalance <= low:
            return small
        if unbalance <= thin.unbalance:
            ends = small.shape.outer_radius, self.narrow.outer_radius

            def excess(radius: float) -> float:
                return replace(small, shape=self._shape(radius)).unbalance - unbalance

            return replace(small, shape=self._shape(_root(excess, *ends)))
        if unbalance <= thick.unbalance or self._best_breadth is None or self._breadths is None:
            share = unbalance / thick.unbalance
            return replace(thick, thickness=max(min(large.thickness * share, large.thickness), small.thickness))
        moment = unbalance / large.per_area
        breadth = _root(lambda b: self._first_moment(b) - moment, self._breadths[0], self._best_breadth)
        return replace(large, shape=self._widest(breadth))


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    # return the root of a growing function; an end if rounding leaves no change of sign
    if excess(low) >= 0.0:
        return low
    if excess(high) <= 0.0:
        return high
    return float(brentq(excess, low, high, xtol=1e-12, rtol=4.0 * math.ulp(1.0)))
