"""Faults that any picture can have: words that are cut, covered, small, pale or crooked, and odd ticks."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.ticker import MaxNLocator

from laufruhe.plots.style import DPI, WIDEST, styled
from laufruhe.plots.words import READ, SMALL, contrast

COARSE = 60
"""Dots an inch are enough to see what lies under letters."""


def faults_of(figure: Figure, engine: str = "") -> list[str]:
    """Return the faults of a picture, in words."""
    with styled():
        texts = drawn_texts(figure)
        found = [*_outside(figure, texts), *_covered(texts), *_small(texts), *_pale(figure, texts), *_ticks(figure)]
    wide = figure.get_figwidth()
    if wide > WIDEST + 0.6:
        found.append(f"{wide:.1f} inches wide: letters shrink in a report")
    words = " ".join(" ".join(text.get_text().split()) for text in figure.texts)
    if engine and " ".join(engine.split()) not in words:
        found.append("the engine is not named")
    return found


def drawn_texts(figure: Figure) -> list[Text]:
    """Return the texts that can be seen; matplotlib keeps labels of ticks beyond the ends of an axis."""
    figure.draw_without_rendering()
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            room = 1e-9 * (high - low)
            hidden |= {
                label
                for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]
                for label in (tick.label1, tick.label2)
                if not (axes.axison and low - room <= tick.get_loc() <= high + room)
            }
        if not axes.axison:
            hidden |= {axes.xaxis.label, axes.yaxis.label, axes.xaxis.offsetText, axes.yaxis.offsetText}
    return [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip() and t not in hidden]


def overlaps(texts: list[Text]) -> list[tuple[str, str]]:
    """Return the pairs of texts that lie on each other."""
    boxes = [(t.get_text(), Text.get_window_extent(t)) for t in texts]
    return [
        (a, b)
        for k, (a, first) in enumerate(boxes)
        for b, second in boxes[k + 1 :]
        if min(first.x1, second.x1) - max(first.x0, second.x0) > 1.0
        and min(first.y1, second.y1) - max(first.y0, second.y0) > 1.0
    ]


def _outside(figure: Figure, texts: list[Text]) -> Iterator[str]:
    """Yield the artists beyond the page, as a whole and text by text."""
    width, height = figure.get_size_inches() * DPI
    for text in texts:
        box = Text.get_window_extent(text)
        if box.x0 < 0.0 or box.y0 < 0.0 or box.x1 > width or box.y1 > height:
            yield f"outside: {text.get_text()!r}"
    for axes in figure.axes:
        box = axes.get_tightbbox()
        if box is not None and (box.x0 < 0.0 or box.y0 < 0.0 or box.x1 > width or box.y1 > height):
            yield f"outside: what is drawn on {axes.get_ylabel() or axes.get_title(loc='left')!r}"


def _covered(texts: list[Text]) -> Iterator[str]:
    for one, other in overlaps(texts):
        yield f"covered: {one!r} and {other!r}"


def _small(texts: list[Text]) -> Iterator[str]:
    for text in texts:
        if text.get_fontsize() < SMALL:
            yield f"{text.get_fontsize()} points: {text.get_text()!r}"


def _pale(figure: Figure, texts: list[Text]) -> Iterator[str]:
    """Yield the letters too near to what lies under them, which is seen with all letters taken away."""
    for text in texts:
        text.set_visible(False)
    figure.set_dpi(COARSE)
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]
    for text in texts:
        text.set_visible(True)
        if isinstance(text, Annotation):
            text.update_positions(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        box = Text.get_window_extent(text)
        rows = slice(max(len(pixels) - math.ceil(box.y1), 0), max(len(pixels) - math.floor(box.y0), 1))
        under = pixels[rows, max(math.floor(box.x0), 0) : math.ceil(box.x1)].reshape(-1, 3)
        if len(under):
            box_of_its_own = text.get_bbox_patch()
            behind = np.median(under, axis=0) / 255.0 if box_of_its_own is None else box_of_its_own.get_facecolor()[:3]
            seen = contrast(to_hex(text.get_color()), to_hex(tuple(behind)))
            if seen < READ:
                yield f"contrast {seen:.1f}: {text.get_text()!r}"
    figure.set_dpi(DPI)


def _ticks(figure: Figure) -> Iterator[str]:
    """Yield the ticks that a reader cannot count in."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            places = axis.get_majorticklocs()
            if axis.get_scale() != "linear" or not isinstance(axis.get_major_locator(), MaxNLocator) or len(places) < 3:
                continue
            step = float(np.diff(places).mean())
            first = round(step / 10.0 ** math.floor(math.log10(step) + 1e-9), 6)
            if first not in (1.0, 2.0, 5.0):
                yield f"steps of {step:g} on {axis.get_label_text()!r}"
