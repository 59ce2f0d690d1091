"""Drawing of a body to scale: views, dimensions and title block in millimetres of paper.

A point is a complex number, to the right and up. The shaft's axis in the front view is the origin, and the body hangs
below it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from laufruhe.extensions.workshop.dimensions import LETTER, Angle, Arrowhead, Dimension, Distance, Marks, Radius, Words
from laufruhe.extensions.workshop.outlines import Arc, Line, Outline, Piece, corners_of, heading
from laufruhe.extensions.workshop.part import Weight
from laufruhe.extensions.workshop.shapes import Across, Along, Opening, Round
from laufruhe.machine import Engine
from laufruhe.plots.words import fit_line
from laufruhe.present.numbers import number, trimmed
from laufruhe.units import readable_unbalance

SCALES = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Scales of ISO 5455."""
WIDTH, HEIGHT, BLOCK_HEIGHT = 240.0, 172.0, 39.0
"""Sizes of a sheet and of its title block [mm of paper]."""
GAP, ROW = 12.0, 9.0
"""Distances of the first dimension line from a view, and of the next lines [mm]."""
_MM, _INCH, _SIDE_GAP, _EDGE = 1e3, 25.4, 26.0, 6.0
_FINE, _SHARP = 0.005, 1e-6
_DOWN = -1j


class Layer(StrEnum):
    """Layer of lines, by their meaning."""

    OUTLINE = "outline"
    HIDDEN = "hidden"
    CENTRE = "centre"
    MARK = "mark"
    FRAME = "frame"


@dataclass(frozen=True)
class Stroke:
    """Line or arc of one layer."""

    piece: Piece
    layer: Layer


@dataclass(frozen=True)
class Sheet:
    """Drawing of one body.

    Attributes
    ----------
    scale
        Millimetres of paper over millimetres of the body.
    outline
        Closed outline of the front view.
    corner
        Lower left corner of the sheet.
    """

    name: str
    scale: float
    outline: Outline
    strokes: tuple[Stroke, ...]
    dimensions: tuple[Dimension, ...]
    arrow: Arrowhead
    words: tuple[Words, ...]
    corner: complex

    @property
    def marks(self) -> list[Marks]:
        """Lines, arrowheads and texts of the dimensions."""
        return [dimension.marks(self.scale) for dimension in self.dimensions]


def scale_text(scale: float) -> str:
    """Return a scale as a ratio, such as 1:2."""
    return f"{scale:g}:1" if scale >= 1.0 else f"1:{1.0 / scale:g}"


def sheet_of(engine: Engine, weight: Weight, title: str) -> Sheet:
    """Return the drawing of a weight's body at the largest standard scale that fits."""
    sheets = (_laid_out(engine, weight, title, scale) for scale in SCALES)
    return next((sheet for sheet, fits in sheets if fits), _laid_out(engine, weight, title, SCALES[-1])[0])


def _placed(piece: Piece, factor: complex) -> Piece:
    if isinstance(piece, Line):
        return Line(piece.start * factor, piece.end * factor)
    return Arc(piece.centre * factor, piece.radius * abs(factor), piece.first_angle + cmath.phase(factor), piece.turn)


def _laid_out(engine: Engine, weight: Weight, title: str, scale: float) -> tuple[Sheet, bool]:
    """Return the drawing at a scale, and True if it fits on its sheet."""
    body, factor = weight.body, _DOWN * _MM * scale
    outline = tuple(_placed(piece, factor) for piece in body.shape.outline)
    points = corners_of(outline, _FINE)
    left, right = float(points.real.min()), float(points.real.max())
    bottom, top = float(points.imag.min()), max(float(points.imag.max()), 0.0)
    dimensions = _of_front(weight, outline, factor, (left, bottom, top))
    above = sum(isinstance(one, Distance) and one.base.imag > top for one in dimensions)
    along, label = _direction(engine, weight)
    leaders = (one.elbow for one in dimensions if isinstance(one, Radius) and 0.0 <= one.elbow.real < ROW)
    reach = max(float((points * along.conjugate()).real.max()) + 3.0 + (GAP + 5.0) * above, 6.0,
                *(elbow.imag + 2.0 * LETTER for elbow in leaders))  # fmt: skip
    arrow = Arrowhead((reach + 14.0) * along, along, 1.6)
    centre = body.shape.lever * factor
    strokes = [
        Stroke(Line(reach * along, (reach + 11.0) * along), Layer.OUTLINE),
        Stroke(Line(complex(0.0, top + _EDGE), complex(0.0, bottom - _EDGE)), Layer.CENTRE),
        *(Stroke(piece, Layer.MARK) for piece in _mark(centre)),
    ]
    text_width = len(label) * 0.8 * LETTER
    label_place = arrow.tip + complex(2.0 if arrow.tip.real >= -1.0 else -2.0 - text_width, -0.5 * LETTER)
    words = [Words(label_place, label), Words(centre + complex(2.0, -LETTER - 1.0), "S")]
    side = max(right, label_place.real + text_width, *(point.real for point in _ends(dimensions, ()))) + _SIDE_GAP
    view, of_side = _side_view(weight, points, side, scale)
    strokes += view
    dimensions += of_side
    far = max(_ends(dimensions, view), key=lambda point: point.real).real + 10.0
    lows = [point.imag for point in (*_ends(dimensions, view), complex(0.0, bottom), arrow.tip, label_place)]
    highs = [point.imag for point in (*_ends(dimensions, view), complex(0.0, top + _EDGE), arrow.tip)]
    near = min(*(point.real for point in _ends(dimensions, view)), left, label_place.real) - 8.0
    low, high = min(lows) - 8.0, max(highs) + 8.0
    strokes.append(Stroke(Line(complex(left - _EDGE, 0.0), complex(far - 2.0, 0.0)), Layer.CENTRE))
    room = complex(WIDTH, HEIGHT - BLOCK_HEIGHT)
    fits = far - near <= room.real and high - low <= room.imag
    corner = complex(0.5 * (near + far - room.real), 0.5 * (low + high - room.imag) - BLOCK_HEIGHT)
    block, cells = _block(weight, title, scale, corner)
    sheet = Sheet(weight.rotor.name, scale, outline, (*strokes, *block), tuple(dimensions), arrow,
                  (*words, *cells), corner)  # fmt: skip
    return sheet, fits


def _ends(dimensions: Sequence[Dimension], strokes: Sequence[Stroke]) -> list[complex]:
    points = [point for stroke in strokes for point in (stroke.piece.start, stroke.piece.end)]
    return [*points, *(point for one in dimensions for point in one.reach)]


def _of_front(weight: Weight, outline: Outline, factor: complex, box: tuple[float, float, float]) -> list[Dimension]:
    """Return the dimensions of the front view: those of the shape, centre of mass and fillets."""
    left, bottom, top = box
    shape = weight.body.shape
    dimensions: list[Dimension] = []
    for one in shape.dimensions:
        if isinstance(one, Across):
            start, end = (complex(one.place, side * one.width) * factor for side in (-0.5, 0.5))
            height = top + GAP if start.imag >= 0.0 else bottom - GAP
            dimensions.append(Distance(start, end, complex(0.0, height), False))
        elif isinstance(one, Opening):
            radius, half = one.radius * abs(factor), 0.5 * one.angle
            first = -0.5 * math.pi - half
            dimensions.append(Angle(radius, first, one.angle, radius + GAP))
        elif isinstance(one, Round):
            dimensions.append(_radius(one, abs(factor), top))
    lengths = sorted((shape.lever, *(one.distance for one in shape.dimensions if isinstance(one, Along))), key=abs)
    arcs = [complex(one.line + ROW, 0.0) * cmath.exp(1j * one.first) for one in dimensions if isinstance(one, Angle)]
    if any(end.imag > min(length * factor.imag for length in lengths) for end in arcs):
        left = min(point.real for one in dimensions if isinstance(one, Angle) for point in one.reach)
    for row, length in enumerate(lengths):
        dimensions.append(Distance(0j, length * factor, complex(left - GAP - ROW * row, 0.0), True))
    fillets = [piece for piece in outline if isinstance(piece, Arc) and abs(piece.centre) > _SHARP
               and math.isclose(piece.radius, shape.fillet * abs(factor), rel_tol=1e-9)]  # fmt: skip
    if shape.fillet and fillets:
        arc = max(fillets, key=lambda piece: (round(piece.centre.imag, 6), piece.centre.real))
        angle = arc.first_angle + 0.5 * arc.turn
        tip = arc.centre + cmath.rect(arc.radius, angle)
        elbow = tip + cmath.rect(11.0, min(max(angle, -0.2), 0.6))
        # the text stays off the axis of the shaft
        height = elbow.imag if abs(elbow.imag + LETTER) > 2.0 * LETTER else -2.5 * LETTER
        dimensions.append(Radius(arc.centre, arc.radius, angle, complex(elbow.real, height), len(fillets)))
    return dimensions


def _radius(one: Round, factor: float, top: float) -> Radius:
    angle, radius = one.angle - 0.5 * math.pi, one.radius * factor
    # a hollow arc has its leader beyond the shaft, and above the body
    length = -max(9.0, (top + 4.0) / math.cos(one.angle)) if one.is_hollow else radius + GAP + ROW
    return Radius(0j, radius, angle, cmath.rect(length, angle))


def _direction(engine: Engine, weight: Weight) -> tuple[complex, str]:
    # return the direction to the crank pin, or upwards for a shaft without cranks, and its text
    rotor = weight.rotor
    parts = [part for part in engine.slider_cranks if part.shaft.name == rotor.shaft.name]
    to, label = 0.0, "up at crank angle 0"
    if parts:
        part = min(parts, key=lambda part: abs(part.x - rotor.x))
        to, label = part.throw, f"crank pin of {part.name}"
    # seen from the front, angles grow clockwise
    return _DOWN * cmath.rect(1.0, (weight.seat.angle or 0.0) - to), label


def _mark(centre: complex) -> list[Piece]:
    return [Arc(centre, 1.5, 0.0, math.tau), Line(centre - 2.5, centre + 2.5), Line(centre - 2.5j, centre + 2.5j)]


def _side_view(weight: Weight, points: np.ndarray, left: float, scale: float) -> tuple[list[Stroke], list[Dimension]]:
    """Return the side view of one or two bodies, with thickness and spacing."""
    body = weight.body
    thick, spacing = body.thickness * _MM * scale, body.spacing * _MM * scale
    low, high = float(points.imag.min()), float(points.imag.max())
    strokes: list[Stroke] = []
    starts = [left, left + spacing] if spacing else [left]
    for start in starts:
        corners = [complex(start, low), complex(start + thick, low), complex(start + thick, high), complex(start, high)]
        strokes += [Stroke(Line(a, b), Layer.OUTLINE) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        for level, is_seen in _edges(weight, points, scale):
            layer = Layer.OUTLINE if is_seen else Layer.HIDDEN
            strokes.append(Stroke(Line(complex(start, level), complex(start + thick, level)), layer))
    dimensions: list[Dimension] = [
        Distance(complex(left, low), complex(left + thick, low), complex(left, low - GAP), False)
    ]
    if spacing:
        top = max(high, 0.0) + GAP
        middles = [start + 0.5 * thick for start in starts]
        strokes += [Stroke(Line(complex(x, low - 3.0), complex(x, high + 3.0)), Layer.CENTRE) for x in middles]
        dimensions.append(
            Distance(complex(middles[0], high), complex(middles[1], high), complex(middles[0], top), False)
        )
    return strokes, dimensions


def _edges(weight: Weight, points: np.ndarray, scale: float) -> list[tuple[float, bool]]:
    """Return heights of the edges of the side view between its ends, single with True if it is seen."""
    outline = weight.body.shape.outline
    edges: dict[float, bool] = {}
    for before, after in zip((outline[-1], *outline[:-1]), outline, strict=True):
        turn = (heading(before, at_end=True).conjugate() * heading(after, at_end=False)).imag
        corner = after.start * _DOWN * _MM * scale
        if abs(turn) < _SHARP or corner.real < _SHARP:
            continue
        ends = points.imag, np.roll(points.imag, -1)
        crosses = (ends[0] - corner.imag) * (ends[1] - corner.imag) <= 0.0
        widest = float(np.maximum(points.real, np.roll(points.real, -1))[crosses].max(initial=corner.real))
        level = round(corner.imag, 6)
        edges[level] = edges.get(level, False) or widest <= corner.real + 0.02 * abs(corner)
    inside = float(points.imag.min()) + 1e-3, float(points.imag.max()) - 1e-3
    return [(level, is_seen) for level, is_seen in edges.items() if inside[0] < level < inside[1]]


def _block(weight: Weight, title: str, scale: float, corner: complex) -> tuple[list[Stroke], list[Words]]:
    """Return lines and texts of the frame and the title block."""
    body = weight.body
    count = 2 if body.spacing else 1
    single = f"{number(_MM * body.mass / count)} g"
    mass = f"2 × {single} = {number(_MM * body.mass)} g" if count > 1 else single
    unbalance, factor = readable_unbalance(body.unbalance)
    rows = (
        ((0.0, "part", weight.rotor.name), (70.0, "engine", title)),
        ((0.0, "body", f"{body.shape.name}, {count} off"), (70.0, "mass", mass),
         (150.0, "unbalance" + (" of both" if count > 1 else ""), f"{number(factor * body.unbalance)} {unbalance}")),
        ((0.0, "density of the material", f"{trimmed(body.density)} kg/m³"),
         (70.0, "inertia about the shaft", f"{number(1e6 * body.inertia)} kg mm²"),
         (150.0, "scale", scale_text(scale)), (185.0, "dimensions in", "mm and °")),
    )  # fmt: skip
    height = BLOCK_HEIGHT / len(rows)
    far = corner + complex(WIDTH, HEIGHT)
    corners = [corner, complex(far.real, corner.imag), far, complex(corner.real, far.imag)]
    strokes = [Stroke(Line(a, b), Layer.FRAME) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    words = []
    for k, row in enumerate(rows):
        low = corner.imag + BLOCK_HEIGHT - (k + 1) * height
        top = low + height
        strokes.append(Stroke(Line(complex(corner.real, top), complex(far.real, top)), Layer.FRAME))
        for (x, label, text), end in zip(row, [*(cell[0] for cell in row[1:]), WIDTH], strict=True):
            place = complex(corner.real + x, low)
            if x:
                strokes.append(Stroke(Line(place, place + 1j * height), Layer.FRAME))
            words += [
                Words(place + complex(2.0, height - LETTER - 2.0), label, is_small=True),
                Words(place + complex(2.0, 2.2), fit_line(text, (end - x - 5.0) / _INCH, 10.0)),
            ]
    return strokes, words
