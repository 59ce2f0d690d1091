"""Words and numbers in pictures: width, line breaks, colour and placement."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex, to_rgb
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.textpath import text_to_path
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from matplotlib.transforms import ScaledTranslation

from laufruhe.numerics.arrays import Array
from laufruhe.plots.letters import FONT, families
from laufruhe.present.numbers import ROUNDS_TO_ZERO, number

INK, FAINT = "#222222", "#5c5c5c"
SMALL = 9.0
"""Smallest size of letters [points]."""
READ = 4.5
"""Smallest contrast of letters (WCAG 2)."""
THIN_SPACE = "\u2009"
_POINTS = 72.0
_ROUND = (1.0, 2.0, 5.0, 10.0)
UNSEEN = 1e-5
"""Share of the largest load below which a load is stated in words and not drawn."""
LARGE = 1e4
"""Smallest number that is printed in thousands of its unit."""


def width_of(text: str, size: float = SMALL, weight: str = "normal") -> float:
    """Return the width of one line of text [inch]."""
    return _width_in(tuple(families()) if not text.isascii() else (FONT,), text, size, weight)


@lru_cache(maxsize=4096)
def _width_in(fonts: tuple[str, ...], text: str, size: float, weight: str) -> float:
    font = FontProperties(family=list(fonts), size=size, weight=weight)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]) / _POINTS


def fit_line(text: str, inches: float, size: float = SMALL) -> str:
    """Return text cut to one line of this width [inch]."""
    text = " ".join(text.split())
    if width_of(text, size) <= inches:
        return text
    length = next((k for k in range(len(text) - 1, 0, -1) if width_of(f"{text[:k]}…", size) <= inches), 0)
    return f"{text[:length].rstrip()}…"


def wrap_lines(text: str, inches: float, size: float = SMALL, weight: str = "normal") -> list[str]:
    """Break text into lines of this width [inch]; a wider word is cut."""
    lines: list[str] = []
    # widths of words add up; most stand in several pictures
    space, width = width_of("n n", size, weight) - width_of("nn", size, weight), 0.0
    for word in text.split():
        longer = width + space + width_of(word, size, weight)
        if lines and longer <= inches:
            lines[-1], width = f"{lines[-1]} {word}", longer
        else:
            lines.append(fit_line(word, inches, size))
            width = width_of(lines[-1], size, weight)
    return lines


def contrast(colour: str, background: str) -> float:
    """Return the contrast of two colours, 1 to 21 (WCAG 2)."""
    low, high = sorted(map(_luminance, (colour, background)))
    return (high + 0.05) / (low + 0.05)


def ink_on(colour: str) -> str:
    """Return black or white, whichever is read better on a colour."""
    return max(("#000000", "#ffffff"), key=lambda ink: contrast(ink, colour))


def legible(colour: str) -> str:
    """Return a colour darkened until it is legible on white."""
    share = next(k for k in range(21) if contrast(_darker(colour, k), "#ffffff") >= READ)
    return _darker(colour, share)


def _darker(colour: str, twentieths: int) -> str:
    red, green, blue = ((1.0 - 0.05 * twentieths) * part for part in to_rgb(colour))
    return str(to_hex((red, green, blue)))


def _luminance(colour: str) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return float(np.dot((0.2126, 0.7152, 0.0722), linear))


def spread(places: Array, minimum: float, low: float = 0.0, high: float = 1.0) -> Array:
    """Move places by least squares to a minimum distance within two ends, keeping their order."""
    if len(places) == 0:
        return places
    order = np.argsort(places, kind="stable")
    steps = minimum * np.arange(len(places))
    moved = np.clip(_rising(places[order] - steps), low, max(high - steps[-1], low))
    result = np.empty(len(places))
    result[order] = moved + steps
    return result


def _rising(values: Array) -> Array:
    shared: list[tuple[float, int]] = []
    for value in values:
        mean, count = float(value), 1
        while shared and shared[-1][0] > mean:
            other_mean, other_count = shared.pop()
            mean, count = (mean * count + other_mean * other_count) / (count + other_count), count + other_count
        shared.append((mean, count))
    return np.repeat([mean for mean, _ in shared], [count for _, count in shared])


def label_lines(axes: Axes, heights: Sequence[float], texts: Sequence[str]) -> None:
    """Write names of horizontal lines to the right of the panel, without overlaps."""
    low, high = axes.get_ylim()
    minimum = 1.3 * SMALL / _POINTS / (axes.bbox.height / axes.figure.dpi)
    places = spread((np.asarray(heights, dtype=float) - low) / (high - low), minimum)
    for height, place, text in zip(heights, places, texts, strict=True):
        # the leader ends at the middle of the text's left side
        leader = {"arrowstyle": "-", "color": FAINT, "lw": 0.6, "shrinkA": 0.0, "shrinkB": 0.0, "relpos": (0.0, 0.5)}
        axes.annotate(
            text, (1.0, height), (1.035, place), axes.get_yaxis_transform(), "axes fraction", size=SMALL, color=INK,
            va="center", ha="left", annotation_clip=False, arrowprops=leader,
        )  # fmt: skip


def in_thousands(largest: float, unit: str) -> tuple[float, str]:
    """Return factor and unit of numbers up to this size: kN from 10 000 N on."""
    return (1e-3, f"k{unit}") if abs(largest) >= LARGE else (1.0, unit)


def label_of(name: str, unit: str, inches: float) -> str:
    """Return the axis label of an objective; a name longer than the axis becomes "objective"."""
    behind = f" [{unit}]" if unit else ""
    return f"{name if width_of(f'{name}{behind}') <= inches else 'objective'}{behind}"


def empty(axes: Axes, words: str) -> None:
    """Write the reason into an empty panel."""
    axes.set_yticks([])
    axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", va="center", color=FAINT, size=SMALL)


def omitted_words(largest: float, maximum: float, unit: str) -> str:
    """Return in words the size of a load that is too small to draw; empty if the load is drawn."""
    if largest > UNSEEN * maximum:
        return ""
    return "zero" if largest <= ROUNDS_TO_ZERO * maximum else f"at most {number(largest, 2)} {unit}"


def separate_texts(texts: Sequence[Text]) -> None:
    """Move overlapping words up and down, as little as possible."""
    remaining = [(text, text.get_window_extent()) for text in texts]
    while remaining:
        group = [remaining.pop(0)]
        # texts over the same part of the axis are spread together
        for text, box in remaining[:]:
            if any(box.x0 < other_box.x1 and other_box.x0 < box.x1 for _, other_box in group):
                group.append((text, box))
                remaining.remove((text, box))
        heights = np.array([0.5 * (box.y0 + box.y1) for _, box in group])
        minimum = 1.15 * max(box.height for _, box in group)
        moved = spread(heights, minimum, -math.inf, math.inf)
        for (text, _), up in zip(group, moved - heights, strict=True):
            if abs(up) > 0.1:
                # in inches, because a picture is drawn at another resolution than it is laid out
                figure: Any = text.figure
                text.set_transform(
                    text.get_transform() + ScaledTranslation(0.0, up / figure.dpi, figure.dpi_scale_trans)
                )


def typeset(words: str) -> str:
    """Return units as printed: m² for m^2, ° for degrees, µs for us."""
    words = re.sub(r"\^(-?\d+)", lambda match: match[1].translate(_RAISED), words)
    return re.sub(r"\[(.*?)\]", lambda match: f"[{_UNITS.get(match[1], match[1])}]", words)


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {"deg": "°", "us": "µs", "um": "µm", "degC": "°C"}


def align_labels(panels: Sequence[Axes]) -> None:
    """Align the labels of the vertical axes of one column, clear of the longest number."""
    longest = 0.0
    for axes in panels:
        low, high = sorted(axes.get_ylim())
        places = [place for place in axes.yaxis.get_majorticklocs() if low <= place <= high]
        longest = max([longest, *(width_of(text) for text in axes.yaxis.get_major_formatter().format_ticks(places))])
    for axes in panels:
        lines = 1 + axes.get_ylabel().count("\n")
        axes.yaxis.set_label_coords(-(longest + 0.12 + 0.09 * lines) * axes.figure.dpi / axes.bbox.width, 0.5)


class PlainNumbers(ScalarFormatter):
    """Numbers of an axis in full, with thin spaces between thousands from 10 000 on (SI)."""

    def __init__(self) -> None:
        super().__init__(useOffset=False, useMathText=False)
        self.set_scientific(False)

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the text of a tick."""
        return grouped(str(super().__call__(x, pos)))


def grouped(number: str) -> str:
    """Return a number with thin spaces between thousands, from five digits on."""
    integer, point, decimals = number.partition(".")
    digits = integer.lstrip("-−")
    if not digits.isdecimal() or len(digits) < 5:
        return number
    return integer[: len(integer) - len(digits)] + f"{int(digits):,}".replace(",", THIN_SPACE) + point + decimals


def round_ticks(axis: Axis, maximum: int, **options: Any) -> None:
    """Set ticks at steps of 1, 2 or 5, their numbers in full."""
    axis.set_major_locator(MaxNLocator(maximum, steps=_ROUND, **options))
    axis.set_major_formatter(PlainNumbers())
