"""Dimensions of a drawing: lines, arrowheads and text of distances, radii and angles [mm of paper]."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.extensions.workshop.outlines import Arc, Line, Piece

LETTER, ARROW, LANDING = 2.5, 2.5, 16.0
"""Height of letters, length of arrowheads, and length of the line beneath the text of a radius."""
DECIMALS = 2
_OFF, _BEYOND = 1.0, 1.5
_SLENDER, _LETTER_WIDTH = 0.16, 0.85


@dataclass(frozen=True)
class Words:
    """Line of text from its lower left corner, or about its middle and turned [rad]."""

    place: complex
    text: str
    is_small: bool = False
    is_centred: bool = False
    angle: float = 0.0


@dataclass(frozen=True)
class Arrowhead:
    """Filled arrowhead."""

    tip: complex
    direction: complex
    scale: float = 1.0

    @property
    def corners(self) -> tuple[complex, ...]:
        """Corners of the triangle."""
        back = -ARROW * self.scale * self.direction / abs(self.direction)
        return self.tip, *(self.tip + back * cmath.rect(1.0, side * _SLENDER) for side in (1.0, -1.0))


@dataclass(frozen=True)
class Marks:
    """Lines, arrowheads and text of a dimension."""

    pieces: tuple[Piece, ...]
    arrowheads: tuple[Arrowhead, ...]
    words: Words


@dataclass(frozen=True)
class Distance:
    """Distance along one direction of the paper; `base` is a point of the dimension line."""

    start: complex
    end: complex
    base: complex
    is_upright: bool

    def marks(self, scale: float) -> Marks:
        """Return lines, arrowheads and text; the text states the distance over the scale."""
        along = 1j if self.is_upright else 1.0 + 0j
        pieces: list[Piece] = []
        feet = []
        for point in (self.start, self.end):
            foot = complex(self.base.real, point.imag) if self.is_upright else complex(point.real, self.base.imag)
            away = (foot - point) / (abs(foot - point) or 1.0)
            pieces.append(Line(point + _OFF * away, foot + _BEYOND * away))
            feet.append(foot)
        low, high = sorted(feet, key=lambda foot: foot.real + foot.imag)
        length = abs(high - low)
        text = size_text(length / scale)
        room = _LETTER_WIDTH * LETTER * len(text)
        # arrows come from outside where there is no room within, and the text stands beyond a short line
        sign = 1.0 if length >= 3.0 * ARROW else -1.0
        beyond = 0j if sign > 0.0 else 2.5 * ARROW * along
        ends, place = [low - beyond, high + beyond], 0.5 * (low + high)
        if length < room + (2.0 * ARROW if sign > 0.0 else _BEYOND):
            side = int(feet[1] == high)
            away = (2.0 * side - 1.0) * along
            place, ends[side] = ends[side] + 0.5 * room * away, ends[side] + room * away
        pieces.append(Line(*ends))
        place += 0.9j * along * LETTER
        angle = cmath.phase(along)
        heads = Arrowhead(low, -sign * along), Arrowhead(high, sign * along)
        return Marks(tuple(pieces), heads, Words(place, text, is_centred=True, angle=angle))

    @property
    def reach(self) -> tuple[complex, ...]:
        """Points that the dimension reaches beyond the view."""
        return (self.base,)


@dataclass(frozen=True)
class Radius:
    """Radius of `count` equal arcs: the arrow touches one at an angle, and the leader ends at `elbow`."""

    centre: complex
    radius: float
    angle: float
    elbow: complex
    count: int = 1

    def marks(self, scale: float) -> Marks:
        """Return lines, arrowheads and text; the text states the radius over the scale."""
        tip, end = self.centre + cmath.rect(self.radius, self.angle), self.elbow + LANDING
        text = f"R{size_text(self.radius / scale)}"
        words = Words(self.elbow + complex(0.5 * LANDING, 0.9 * LETTER),
                      f"{self.count}× {text}" if self.count > 1 else text, is_centred=True)  # fmt: skip
        return Marks((Line(tip, self.elbow), Line(self.elbow, end)), (Arrowhead(tip, tip - self.elbow),), words)

    @property
    def reach(self) -> tuple[complex, ...]:
        """Points that the dimension reaches beyond the view."""
        return self.elbow, self.elbow + LANDING


@dataclass(frozen=True)
class Angle:
    """Angle about the shaft between the ends of an arc; the dimension line has a larger radius, `line`."""

    radius: float
    first: float
    turn: float
    line: float

    def marks(self, _: float) -> Marks:
        """Return lines, arrowheads and text."""
        arc = Arc(0j, self.line, self.first, self.turn)
        sides = [Line(cmath.rect(self.radius + _OFF, angle), cmath.rect(self.line + _BEYOND, angle))
                 for angle in (self.first, self.first + self.turn)]  # fmt: skip
        heads = Arrowhead(arc.start, -1j * arc.start), Arrowhead(arc.end, 1j * arc.end)
        place = cmath.rect(self.line + LETTER, self.first + 0.5 * self.turn)
        return Marks((*sides, arc), heads, Words(place, f"{size_text(math.degrees(self.turn))}°", is_centred=True))

    @property
    def reach(self) -> tuple[complex, ...]:
        """Points that the dimension reaches beyond the view."""
        arc = Arc(0j, self.line + 2.0 * LETTER, self.first, self.turn)
        return *arc.points(0.1), arc.end


Dimension: TypeAlias = Distance | Radius | Angle


def size_text(size: float) -> str:
    """Return a size as a drawing states it, without zeros at its end."""
    return f"{size:.{DECIMALS}f}".rstrip("0").rstrip(".")
