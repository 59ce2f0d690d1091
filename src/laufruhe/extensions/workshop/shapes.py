"""Plane shapes of counterweights: sector, slab and web cheek (H3 to H5)."""

from __future__ import annotations

import cmath
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self, TypeAlias

from laufruhe.errors import ModelError
from laufruhe.extensions.workshop.outlines import Arc, Line, Moments, Outline, moments, rounded


@dataclass(frozen=True)
class Along:
    """Dimension from the shaft along the middle of a shape; negative to the other side [m]."""

    distance: float


@dataclass(frozen=True)
class Across:
    """Dimension of a width across the middle of a shape, at a distance from the shaft [m]."""

    place: float
    width: float


@dataclass(frozen=True)
class Opening:
    """Dimension of an opening angle about the shaft, outside a radius [m]."""

    radius: float
    angle: float


@dataclass(frozen=True)
class Round:
    """Dimension of a radius about the shaft [m], stated at an angle; hollow if the arrow comes from the shaft."""

    radius: float
    angle: float
    is_hollow: bool = False


Dimension: TypeAlias = Along | Across | Opening | Round
_STATED, _STEEPEST = 0.55, 1.1
"""Share of half an arc at which its radius is stated, and the largest such angle [rad]."""


@dataclass(frozen=True)
class Shape(ABC):
    """Outline of a body across its shaft [m]; the body points along the real axis.

    Attributes
    ----------
    outer_radius
        Radius that the body sweeps.
    fillet
        Radius at every corner that points outwards.
    """

    outer_radius: float
    fillet: float = 0.0
    name: ClassVar[str]
    breadth: ClassVar[str] = ""
    """Size, apart from outer radius and thickness, that may be open; empty if there is none.

    The shape grows with it in every direction, and its lever falls.
    """
    angles: ClassVar[frozenset[str]] = frozenset({"angle"})

    @cached_property
    def outline(self) -> Outline:
        """Pieces of the outline with fillets."""
        return rounded(self._sharp_outline(), self.fillet)

    @abstractmethod
    def _sharp_outline(self) -> Outline: ...

    @property
    @abstractmethod
    def dimensions(self) -> tuple[Dimension, ...]:
        """Dimensions of a drawing, without fillets and thickness."""

    @cached_property
    def moments(self) -> Moments:
        """Area, first and polar moment about the shaft."""
        return moments(self.outline)

    @property
    def lever(self) -> float:
        """Distance of the centre of area from the shaft [m]."""
        return self.moments.first.real / self.moments.area

    def sized(self, **sizes: float) -> Self:
        """Return the shape with other sizes."""
        changes: dict[str, Any] = sizes
        return replace(self, **changes)

    @property
    def powers(self) -> Mapping[str, tuple[int, int]]:
        """Powers of mass and length in its sizes."""
        return {name: (0, 1) for name in self.sizes if name not in self.angles}

    @property
    def sizes(self) -> Mapping[str, float]:
        """Sizes by their keys in a file, without those that are left out [m, rad]."""
        pairs = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: size for name, size in pairs if size is not None}


@dataclass(frozen=True)
class Sector(Shape):
    """Sector of a disc, or with an inner radius of a ring (H3)."""

    inner_radius: float = 0.0
    angle: float = math.pi
    name: ClassVar[str] = "sector"
    breadth: ClassVar[str] = "angle"

    def __post_init__(self) -> None:
        if not self.inner_radius < self.outer_radius:
            raise ModelError(f"the inner radius of a sector, {_mm(self.inner_radius)}, must be below the outer one")

    def _sharp_outline(self) -> Outline:
        half, low, high = 0.5 * self.angle, self.inner_radius, self.outer_radius
        start, end = cmath.exp(-1j * half), cmath.exp(1j * half)
        inside = (Arc(0j, low, half, -self.angle),) if low else ()
        return (Line(low * start, high * start), Arc(0j, high, -half, self.angle), Line(high * end, low * end), *inside)

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Dimensions of a drawing, without fillets and thickness."""
        half = 0.5 * self.angle
        inside = (Round(self.inner_radius, -0.5 * min(half, math.pi - half), True),) if self.inner_radius else ()
        return _outer(self.outer_radius, half), *inside, Opening(self.outer_radius, self.angle)


@dataclass(frozen=True)
class Slab(Shape):
    """Slab with a flat inner side, turned to the outer radius; without a width a segment of the disc (H4)."""

    inner_radius: float = 0.0
    width: float | None = None
    name: ClassVar[str] = "slab"
    breadth: ClassVar[str] = "width"

    def __post_init__(self) -> None:
        if not self.inner_radius < self.outer_radius:
            raise ModelError(f"the flat side of a slab, at {_mm(self.inner_radius)}, must be inside the outer radius")

    def _sharp_outline(self) -> Outline:
        low, high = self.inner_radius, self.outer_radius
        full = math.sqrt(high**2 - low**2)
        half = full if self.width is None else 0.5 * self.width
        if half >= full:
            turn = 2.0 * math.acos(low / high)
            return Line(complex(low, full), complex(low, -full)), Arc(0j, high, -0.5 * turn, turn)
        turn, top = 2.0 * math.asin(half / high), math.sqrt(high**2 - half**2)
        right, left = Line(complex(low, -half), complex(top, -half)), Line(complex(top, half), complex(low, half))
        return right, Arc(0j, high, -0.5 * turn, turn), left, Line(complex(low, half), complex(low, -half))

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Dimensions of a drawing, without fillets and thickness."""
        low, high = self.inner_radius, self.outer_radius
        full = math.sqrt(high**2 - low**2)
        half = full if self.width is None else min(0.5 * self.width, full)
        flat = (Along(low),) if low else ()
        sides = (Across(math.sqrt(high**2 - half**2), 2.0 * half),) if half < full else ()
        return _outer(high, math.asin(half / high)), *flat, *sides


@dataclass(frozen=True)
class Cheek(Shape):
    """Web cheek: plate with a round end about the crank pin, and opposite to it a sector that may be wider (H5).

    Attributes
    ----------
    tail
        Distance of the round end from the shaft, on the side of the pin.
    angle
        Opening angle of the sector; None for a plate of constant width.
    """

    tail: float = 0.0
    width: float = 0.0
    angle: float | None = None
    name: ClassVar[str] = "cheek"

    def __post_init__(self) -> None:
        if self.width >= 2.0 * min(self.outer_radius, self.tail):
            rule = f"a cheek of {_mm(self.width)} is wider than its outer radius or its tail allow"
            raise ModelError(f"{rule}; make it narrower than twice each of them")

    def _sharp_outline(self) -> Outline:
        half, high, back = 0.5 * self.width, self.outer_radius, 0.5 * self.width - self.tail
        flare = 0.5 * (self.angle or 0.0)
        if high * math.sin(flare) > half:
            # the sides of the sector begin on the sides of the plate
            foot = complex(half / math.tan(flare), half)
            rim = (Line(foot.conjugate(), cmath.rect(high, -flare)), Arc(0j, high, -flare, 2.0 * flare),
                   Line(cmath.rect(high, flare), foot))  # fmt: skip
        else:
            flare, foot = math.asin(half / high), complex(math.sqrt(high**2 - half**2), half)
            rim = (Arc(0j, high, -flare, 2.0 * flare),)  # type: ignore[assignment]
        sides = Line(complex(back, -half), foot.conjugate()), Line(foot, complex(back, half))
        return sides[0], *rim, sides[1], Arc(complex(back), half, 0.5 * math.pi, math.pi)

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Dimensions of a drawing, without fillets and thickness."""
        half, flare = 0.5 * self.width, 0.5 * (self.angle or 0.0)
        is_wide = self.outer_radius * math.sin(flare) > half
        end = flare if is_wide else math.asin(half / self.outer_radius)
        opening = (Opening(self.outer_radius, 2.0 * flare),) if is_wide else ()
        plate = Along(-self.tail), Across(half - self.tail, self.width)
        return _outer(self.outer_radius, end), *plate, *opening


SHAPES: Mapping[str, type[Shape]] = {shape.name: shape for shape in (Sector, Slab, Cheek)}


def _outer(radius: float, half: float) -> Round:
    return Round(radius, min(_STATED * half, _STEEPEST))


def _mm(length: float) -> str:
    return f"{1e3 * length:.6g} mm"
