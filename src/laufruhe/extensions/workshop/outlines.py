"""Closed outlines of lines and circular arcs, and their area, first and polar moments in closed form (H1, H2).

A point is a complex number in the plane of a body: the real axis runs from the shaft through the middle of the body.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import ComplexArray

_CLOSE = 1e-12


@dataclass(frozen=True)
class Moments:
    """Area [m2], first moment about the shaft [m3] and polar moment about the shaft [m4] of a plane figure."""

    area: float = 0.0
    first: complex = 0j
    polar: float = 0.0

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.area + other.area, self.first + other.first, self.polar + other.polar)


@dataclass(frozen=True)
class Line:
    """Straight piece of an outline."""

    start: complex
    end: complex

    @property
    def moments(self) -> Moments:
        """Moments of the triangle of the shaft and this line (H1)."""
        a, b = self.start, self.end
        area = 0.5 * (a.conjugate() * b).imag
        polar = area / 6.0 * (abs(a) ** 2 + abs(b) ** 2 + (a.conjugate() * b).real)
        return Moments(area, area / 3.0 * (a + b), polar)

    def points(self, _: float) -> list[complex]:
        """Return its points without the last one."""
        return [self.start]


@dataclass(frozen=True)
class Arc:
    """Circular piece of an outline, about a centre; `turn` is its angle, negative if clockwise [rad]."""

    centre: complex
    radius: float
    first_angle: float
    turn: float

    @property
    def start(self) -> complex:
        """First point."""
        return self.centre + cmath.rect(self.radius, self.first_angle)

    @property
    def end(self) -> complex:
        """Last point."""
        return self.centre + cmath.rect(self.radius, self.first_angle + self.turn)

    @property
    def moments(self) -> Moments:
        """Moments of the triangle of the shaft and the chord, and of the segment between chord and arc (H2)."""
        r, c, t = self.radius, self.centre, self.turn
        middle = cmath.exp(1j * (self.first_angle + 0.5 * t))
        area, first = 0.5 * r**2 * (t - math.sin(t)), 2.0 / 3.0 * r**3 * math.sin(0.5 * t) ** 3 * middle
        polar = r**4 * (0.25 * t - math.sin(t) * (2.0 + math.cos(t)) / 12.0)
        about_shaft = polar + 2.0 * (c.conjugate() * first).real + abs(c) ** 2 * area
        return Line(self.start, self.end).moments + Moments(area, area * c + first, about_shaft)

    def points(self, step: float) -> list[complex]:
        """Return points at most `step` apart [rad], without the last one."""
        count = max(math.ceil(abs(self.turn) / step), 1)
        angles = self.first_angle + self.turn * np.arange(count) / count
        return [self.centre + cmath.rect(self.radius, angle) for angle in angles]


Piece: TypeAlias = Line | Arc
Outline: TypeAlias = tuple[Piece, ...]
"""Pieces of a closed line, counterclockwise, each from the end of the one before."""


def moments(outline: Sequence[Piece]) -> Moments:
    """Return the moments of the area inside an outline."""
    return sum((piece.moments for piece in outline), Moments())


def corners_of(outline: Sequence[Piece], step: float) -> ComplexArray:
    """Return points of an outline, those of arcs at most `step` apart [rad]."""
    return np.array([point for piece in outline for point in piece.points(step)])


def rounded(outline: Outline, radius: float) -> Outline:
    """Return the outline with a radius at every corner that points outwards [m].

    Raise ModelError if a piece between two corners is shorter than its roundings.
    """
    if radius == 0.0:
        return outline
    pieces, arcs = list(outline), dict[int, Arc]()
    for k in range(len(pieces)):
        before, after = outline[k - 1], outline[k]
        inside = (heading(before, at_end=True).conjugate() * heading(after, at_end=False)).imag
        if inside > 1e-9:
            arcs[k] = _fillet(before, after, radius)
    for k, arc in arcs.items():
        pieces[k - 1] = _trimmed(pieces[k - 1], arc.start, at_end=True)
        pieces[k] = _trimmed(pieces[k], arc.end, at_end=False)
    return tuple(piece for k, part in enumerate(pieces) for piece in ((arcs[k], part) if k in arcs else (part,)))


def heading(piece: Piece, at_end: bool) -> complex:
    """Return the direction of a piece at its end or start, of length one."""
    if isinstance(piece, Line):
        return (piece.end - piece.start) / abs(piece.end - piece.start)
    angle = piece.first_angle + (piece.turn if at_end else 0.0)
    return 1j * math.copysign(1.0, piece.turn) * cmath.exp(1j * angle)


def _fillet(before: Piece, after: Piece, radius: float) -> Arc:
    # return the arc inside a corner that touches both pieces
    corner = after.start
    middles = _common(_inward(before, radius), _inward(after, radius))
    if not middles:
        raise ModelError(f"a fillet of {1e3 * radius:g} mm does not fit into a corner; make it smaller")
    centre = min(middles, key=lambda middle: abs(middle - corner))
    first, last = (_foot(piece, centre) - centre for piece in (before, after))
    turn = cmath.phase(last / first) % math.tau
    return Arc(centre, radius, cmath.phase(first), turn)


def _inward(piece: Piece, distance: float) -> Piece:
    if isinstance(piece, Line):
        shift = 1j * heading(piece, True) * distance
        return Line(piece.start + shift, piece.end + shift)
    radius = piece.radius - math.copysign(distance, piece.turn)
    return Arc(piece.centre, max(radius, 0.0), piece.first_angle, piece.turn)


def _common(one: Piece, other: Piece) -> list[complex]:
    """Return the points that the whole lines or circles of two pieces share."""
    if isinstance(one, Arc) and isinstance(other, Line):
        return _common(other, one)
    if isinstance(one, Line):
        along = heading(one, True)
        if isinstance(other, Line):
            across = (along.conjugate() * heading(other, True)).imag
            reach = ((other.start - one.start).conjugate() * heading(other, True)).imag / across
            return [one.start + reach * along]
        offset = (other.centre - one.start) / along
        half = other.radius**2 - offset.imag**2
        roots = (-math.sqrt(half), math.sqrt(half)) if half >= 0.0 else ()
        return [one.start + along * (offset.real + root) for root in roots]
    assert isinstance(other, Arc)
    between = other.centre - one.centre
    distance = abs(between)
    if distance < _CLOSE:
        return []
    along = (distance**2 + one.radius**2 - other.radius**2) / (2.0 * distance)
    half = one.radius**2 - along**2
    roots = (-math.sqrt(half), math.sqrt(half)) if half >= 0.0 else ()
    return [one.centre + between / distance * complex(along, root) for root in roots]


def _foot(piece: Piece, point: complex) -> complex:
    if isinstance(piece, Line):
        along = heading(piece, True)
        return piece.start + along * ((point - piece.start) / along).real
    outwards = point - piece.centre
    return piece.centre + piece.radius * outwards / abs(outwards)


def _trimmed(piece: Piece, point: complex, at_end: bool) -> Piece:
    """Return the piece up to a point, or from a point on."""
    trimmed: Piece
    if isinstance(piece, Line):
        trimmed = Line(piece.start, point) if at_end else Line(point, piece.end)
        is_left = ((piece.end - piece.start).conjugate() * (trimmed.end - trimmed.start)).real > 0.0
    else:
        sign = math.copysign(1.0, piece.turn)
        share = sign * (cmath.phase((point - piece.centre) / cmath.exp(1j * piece.first_angle)))
        share %= math.tau
        start, turn = (piece.first_angle, sign * share)
        if not at_end:
            start, turn = piece.first_angle + sign * share, piece.turn - sign * share
        trimmed = Arc(piece.centre, piece.radius, start, turn)
        is_left = 0.0 < sign * turn <= abs(piece.turn)
    if not is_left:
        raise ModelError("the fillet is larger than a side of the body; make it smaller")
    return trimmed
