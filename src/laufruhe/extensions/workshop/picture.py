"""Drawings of bodies as pictures, to scale on paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.extensions.workshop.dimensions import Arrowhead, Words
from laufruhe.extensions.workshop.outlines import Piece, corners_of
from laufruhe.extensions.workshop.part import Weight, weights_of
from laufruhe.extensions.workshop.section import applies as applies
from laufruhe.extensions.workshop.sheet import HEIGHT, WIDTH, Layer, Sheet, sheet_of
from laufruhe.plots.style import finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL
from laufruhe.solvers.result import Result

_INCH, _LETTERS, _FINE = 25.4, 10.0, 0.02
_STYLES = {
    Layer.OUTLINE: (INK, 1.4, "-"), Layer.HIDDEN: (INK, 0.8, (0, (4, 2))),
    Layer.CENTRE: (FAINT, 0.6, (0, (12, 3, 2, 3))), Layer.MARK: (INK, 0.7, "-"), Layer.FRAME: (INK, 0.8, "-"),
}  # fmt: skip


def figure(result: Result) -> Figure:
    """Draw every body of the final design, one below the other."""
    return figure_of(result, weights_of(result.final.engine))


@styled()
def figure_of(result: Result, weights: Sequence[Weight]) -> Figure:
    """Draw some bodies of the final design."""
    engine, title = result.final.engine, result.problem.title
    layout = page(len(weights), 1, (WIDTH / _INCH, HEIGHT / _INCH))
    sheets = [sheet_of(engine, weight, title) for weight in weights]
    for axes, sheet in zip(layout.panels, sheets, strict=True):
        _draw(axes, sheet)
    names = ", ".join(sheet.name for sheet in sheets)
    lines = (
        "To scale on paper if it is printed at its own size. S is the centre of mass; the arrow is at crank angle 0."
    )
    return finish_page(layout, result, f"Drawing of {names}", lines, ())


def _draw(axes: Axes, sheet: Sheet) -> None:
    axes.set(xlim=(sheet.corner.real, sheet.corner.real + WIDTH), ylim=(sheet.corner.imag, sheet.corner.imag + HEIGHT))
    axes.set_axis_off()
    _line(axes, [*corners_of(sheet.outline, _FINE), sheet.outline[0].start], Layer.OUTLINE)
    for stroke in sheet.strokes:
        _line(axes, _points(stroke.piece), stroke.layer)
    for head in (sheet.arrow, *(head for marks in sheet.marks for head in marks.arrowheads)):
        _arrowhead(axes, head)
    for piece in (piece for marks in sheet.marks for piece in marks.pieces):
        _line(axes, _points(piece), Layer.MARK)
    for words in (*sheet.words, *(marks.words for marks in sheet.marks)):
        _words(axes, words)


def _points(piece: Piece) -> list[complex]:
    return [*piece.points(_FINE), piece.end]


def _line(axes: Axes, points: Sequence[complex], layer: Layer) -> None:
    colour, width, dash = _STYLES[layer]
    x, y = np.real(points), np.imag(points)
    axes.plot(x, y, color=colour, linewidth=width, linestyle=dash, solid_joinstyle="miter", clip_on=False)


def _arrowhead(axes: Axes, head: Arrowhead) -> None:
    axes.fill(np.real(head.corners), np.imag(head.corners), color=INK, linewidth=0.0, clip_on=False)


def _words(axes: Axes, words: Words) -> None:
    size, colour = (SMALL, FAINT) if words.is_small else (_LETTERS, INK)
    about: dict[str, Any] = {"ha": "center", "va": "center"} if words.is_centred else {}
    axes.text(
        words.place.real, words.place.imag, words.text, size=size, color=colour, clip_on=False,
        rotation=math.degrees(words.angle), **about,
    )  # fmt: skip
