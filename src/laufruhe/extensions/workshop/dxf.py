"""Drawings of bodies as DXF files, in millimetres of the body."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from laufruhe.errors import refused
from laufruhe.extensions.workshop.dimensions import (
    ARROW,
    DECIMALS,
    LETTER,
    Angle,
    Arrowhead,
    Dimension,
    Distance,
    Marks,
    Words,
)
from laufruhe.extensions.workshop.outlines import Arc, Line, Outline, Piece
from laufruhe.extensions.workshop.sheet import HEIGHT, WIDTH, Layer, Sheet

_VERSION, _STYLE = "R2010", "LAUFRUHE"
_LINES = {
    Layer.OUTLINE: ("CONTINUOUS", 50), Layer.HIDDEN: ("DASHED", 25), Layer.CENTRE: ("CENTER", 18),
    Layer.MARK: ("CONTINUOUS", 25), Layer.FRAME: ("CONTINUOUS", 35),
}  # fmt: skip
"""Line types, and widths in hundredths of a millimetre, of the layers."""
_SMALL = 0.85


def library() -> Any:
    """Return the module `ezdxf`; raise InputError without it."""
    try:
        import ezdxf
    except ImportError:
        rule, remedy = "is not installed, and DXF files need it", "pip install 'laufruhe[drawings]'"
        raise refused("ezdxf", "", rule, remedy) from None
    return ezdxf


def write_dxf(sheet: Sheet, path: Path) -> None:
    """Write a drawing as DXF; the front view has its shaft at the origin, and lengths are those of the body."""
    ezdxf = library()
    # the same drawing makes the same file
    ezdxf.options.write_fixed_meta_data_for_testing = True
    document = ezdxf.new(_VERSION, setup=True, units=ezdxf.units.MM)
    document.header["$LTSCALE"] = 0.25 / sheet.scale
    for layer, (line_type, width) in _LINES.items():
        document.layers.add(layer.value, linetype=line_type, lineweight=width)
    _set_dimensions(document, 1.0 / sheet.scale)
    space, full = document.modelspace(), 1.0 / sheet.scale
    _closed(space, sheet.outline, full)
    for stroke in sheet.strokes:
        _stroke(space, stroke.piece, full, stroke.layer)
    _arrowhead(space, sheet.arrow, full)
    for words in sheet.words:
        _words(space, words, full)
    for dimension, marks in zip(sheet.dimensions, sheet.marks, strict=True):
        _dimension(document, dimension, marks, full)
    low, high = sheet.corner * full, (sheet.corner + complex(WIDTH, HEIGHT)) * full
    document.header["$EXTMIN"], document.header["$EXTMAX"] = (low.real, low.imag, 0.0), (high.real, high.imag, 0.0)
    document.set_modelspace_vport(HEIGHT * full, center=_point(0.5 * (low + high), 1.0))
    document.saveas(path)


def _set_dimensions(document: Any, full: float) -> None:
    document.styles.add(_STYLE, font="DejaVuSans.ttf")
    style = document.dimstyles.duplicate_entry("EZDXF", _STYLE)
    settings = {
        "dimscale": full, "dimtxt": LETTER, "dimtxsty": _STYLE, "dimasz": ARROW, "dimtsz": 0.0,
        "dimexo": 1.0, "dimexe": 1.5, "dimgap": 0.6, "dimtad": 1, "dimdec": DECIMALS, "dimzin": 8, "dimlfac": 1.0,
        "dimadec": DECIMALS, "dimazin": 2, "dimaunit": 0, "dimrnd": 0.0, "dimtih": 0, "dimtoh": 0, "dimdsep": ord("."),
        "dimfxlon": 0,
    }  # fmt: skip
    for name, value in settings.items():
        style.dxf.set(name, value)


def _point(place: complex, full: float) -> tuple[float, float]:
    return full * place.real, full * place.imag


def _closed(space: Any, outline: Outline, full: float) -> None:
    # a bulge is the tangent of a quarter of an arc's angle
    vertices = [
        (*_point(piece.start, full), math.tan(0.25 * piece.turn) if isinstance(piece, Arc) else 0.0)
        for piece in outline
    ]
    space.add_lwpolyline(vertices, format="xyb", close=True, dxfattribs={"layer": Layer.OUTLINE.value})


def _stroke(space: Any, piece: Piece, full: float, layer: Layer) -> None:
    attributes = {"layer": layer.value}
    if isinstance(piece, Line):
        space.add_line(_point(piece.start, full), _point(piece.end, full), dxfattribs=attributes)
    elif piece.turn >= math.tau:
        space.add_circle(_point(piece.centre, full), piece.radius * full, dxfattribs=attributes)
    else:
        first, last = (math.degrees(angle) for angle in (piece.first_angle, piece.first_angle + piece.turn))
        space.add_arc(_point(piece.centre, full), piece.radius * full, first, last, dxfattribs=attributes)


def _arrowhead(space: Any, head: Arrowhead, full: float) -> None:
    space.add_solid([_point(corner, full) for corner in head.corners], dxfattribs={"layer": Layer.MARK.value})


def _words(space: Any, words: Words, full: float) -> None:
    from ezdxf.enums import TextEntityAlignment

    height = (_SMALL if words.is_small else 1.0) * LETTER * full
    attributes = {"layer": Layer.FRAME.value, "height": height, "style": _STYLE, "rotation": math.degrees(words.angle)}
    align = TextEntityAlignment.MIDDLE_CENTER if words.is_centred else TextEntityAlignment.LEFT
    space.add_text(words.text, dxfattribs=attributes).set_placement(_point(words.place, full), align=align)


def _dimension(document: Any, one: Dimension, marks: Marks, full: float) -> None:
    """Add a dimension that other programs can change, drawn as in the picture until they do."""
    space, attributes = document.modelspace(), {"dimstyle": _STYLE, "dxfattribs": {"layer": Layer.MARK.value}}
    if isinstance(one, Distance):
        added = space.add_linear_dim(
            base=_point(one.base, full), p1=_point(one.start, full), p2=_point(one.end, full),
            angle=90.0 if one.is_upright else 0.0, **attributes,
        )  # fmt: skip
    elif isinstance(one, Angle):
        last = one.first + one.turn
        added = space.add_angular_dim_cra(
            (0.0, 0.0), one.radius * full, math.degrees(one.first), math.degrees(last),
            (one.line - one.radius) * full, **attributes,
        )  # fmt: skip
    else:
        text = "<>" if one.count == 1 else f"{one.count}x <>"
        added = space.add_radius_dim(
            _point(one.centre, full), radius=one.radius * full, angle=math.degrees(one.angle), text=text, **attributes
        )
    entity, block = added.dimension, document.blocks.new_anonymous_block(type_char="D")
    entity.dxf.geometry, entity.dxf.text_midpoint = block.name, _point(marks.words.place, full)
    # bit 128: the text stands at a place of its own
    entity.dxf.dimtype |= 128
    for piece in marks.pieces:
        _stroke(block, piece, full, Layer.MARK)
    for head in marks.arrowheads:
        _arrowhead(block, head, full)
    _words(block, marks.words, full)
