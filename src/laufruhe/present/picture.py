"""A picture as data: panels of lines, bars, areas and words. `laufruhe.plots.picture` draws it.

Colours are names of `laufruhe.plots.style` in small letters, or numbers from dark (0) to light (1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

Colour: TypeAlias = str | float
SERIES: tuple[Colour, ...] = ("blue", "orange", "green", "vermilion", "purple", "sky", "indigo", "olive")
WIDE, HIGH = 6.4, 3.6
WIDEST = 8.8
"""Width of all panels side by side [inch]."""
DASHES = ((6.0, 2.0), (2.0, 2.0), (1.0, 3.0))


def colour(k: int, count: int) -> Colour:
    """Return the colour of the k-th line: a hue, or a shade from dark to light for many lines."""
    return SERIES[k] if count <= len(SERIES) else k / (count - 1)


@dataclass(frozen=True)
class Line:
    """Dots, joined unless `width` is zero; a label puts the line into the legend.

    Width, size of dots and dashes (lengths drawn and left out) are in points; markers are matplotlib's.
    """

    x: Any = ()
    y: Any = ()
    colour: Colour = "ink"
    label: str = ""
    width: float = 1.5
    dash: Sequence[float] = ()
    marker: str = ""
    size: float = 6.0
    hollow: bool = False
    behind: bool = False


@dataclass(frozen=True)
class Bars:
    """Bars along the first axis, or horizontal ones if `upright` is False, with `numbers` at their ends."""

    places: Any = ()
    values: Any = ()
    width: float = 0.36
    colour: Colour = "after"
    label: str = ""
    numbers: Sequence[str] = ()
    upright: bool = True
    hollow: bool = False


@dataclass(frozen=True)
class Area:
    """Area between two lines."""

    x: Any = ()
    low: Any = ()
    high: Any = ()
    colour: Colour = "pale"
    label: str = ""


@dataclass(frozen=True)
class Words:
    """Text at a place; `across` and `along` align it, `inside` is the colour behind it."""

    x: float
    y: float
    text: str
    colour: Colour = "ink"
    across: str = "left"
    along: str = "center"
    boxed: bool = False
    inside: Colour = ""


Mark: TypeAlias = Line | Bars | Area | Words


@dataclass(frozen=True)
class Axis:
    """Axis of numbers, or of texts at their places (`ticks`).

    `ends` may descend; without ends, the marks determine the range. `log` has the first figures of the ticks of a
    logarithmic axis.
    """

    label: str = ""
    ends: tuple[float, float] | None = None
    ticks: Sequence[tuple[float, str]] | None = None
    log: Sequence[float] = ()
    grid: bool = True


@dataclass(frozen=True)
class Panel:
    """Marks on two axes."""

    marks: Sequence[Mark]
    x: Axis = Axis()
    y: Axis = Axis()
    title: str = ""


@dataclass(frozen=True)
class Picture:
    """Panels with a title, a description above and a credit below.

    Size of each panel and the gap between them are in inches.
    """

    title: str
    words: str
    panels: Sequence[Panel]
    credit: str
    size: tuple[float, float] = (WIDE, HIGH)
    columns: int = 1
    gap: float = 0.42
    legend: Sequence[Mark] = ()

    @property
    def width(self) -> float:
        """Width of each panel [inch]."""
        return min(self.size[0], (WIDEST - (self.columns - 1) * self.gap) / self.columns)


def credit(data: Any, note: str = "") -> str:
    """Return the source line of a study's dataset."""
    source = f"{data.attrs['source']}. " if data.attrs["source"] else ""
    return f"{source}{note}Computed with Laufruhe."
