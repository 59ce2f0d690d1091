"""Draw a picture that is described as data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from laufruhe.plots import style
from laufruhe.plots.letters import prepare
from laufruhe.plots.style import heading, page, save_and_show, styled
from laufruhe.plots.words import SMALL, grouped, ink_on, legible, separate_texts, typeset
from laufruhe.present.picture import Area, Axis, Bars, Colour, Line, Mark, Panel, Picture, Words

MAX_ENTRIES, FEW_ENTRIES = 8, 5


def draw(picture: Picture) -> Figure:
    """Return the figure of a picture."""
    prepare(_texts(picture))
    return _drawn(picture)


def _texts(picture: Picture) -> Iterator[str]:
    yield from (picture.title, picture.words, picture.credit)
    for panel in picture.panels:
        yield panel.title
        for axis in (panel.x, panel.y):
            yield from (axis.label, *(text for _, text in axis.ticks or ()))
    for mark in (*(mark for panel in picture.panels for mark in panel.marks), *picture.legend):
        yield mark.text if isinstance(mark, Words) else mark.label


@styled()
def _drawn(picture: Picture) -> Figure:
    rows = -(-len(picture.panels) // picture.columns)
    lead = 0.2 if any(panel.title for panel in picture.panels) else 0.0
    size = (picture.width, picture.size[1])
    drawn = page(rows, picture.columns, size, len(picture.panels), picture.gap, lead)
    for axes, panel in zip(drawn.panels, picture.panels, strict=True):
        _panel(axes, panel)
    labelled = {getattr(mark, "label", ""): mark for panel in picture.panels for mark in panel.marks}
    marks = list(picture.legend) or [mark for label, mark in labelled.items() if label]
    if len(marks) > MAX_ENTRIES:
        marks = [marks[k] for k in np.linspace(0, len(marks) - 1, FEW_ENTRIES).round().astype(int)]
    legend: list[Artist] = [
        Line2D([], [], label=mark.label, **_look(mark))
        if isinstance(mark, Line)
        else Patch(color=colour_of(mark.colour), label=getattr(mark, "label", ""))
        for mark in marks
    ]
    heading(drawn, picture.title, picture.words, legend, picture.credit)
    return drawn.figure


def save_picture(picture: Picture, place: Path, kinds: Sequence[str] = ("png",)) -> str:
    """Write a picture as files of these kinds, `place` has no ending; return it as SVG."""
    return save_and_show(draw(picture), place, kinds)


def colour_of(colour: Colour) -> str:
    """Return a colour as matplotlib takes it."""
    if isinstance(colour, float):
        return to_hex(colormaps["viridis"](colour))
    return str(getattr(style, colour.upper()))


def _panel(axes: Axes, panel: Panel) -> None:
    words = [(mark, _words(axes, mark)) for mark in panel.marks if isinstance(mark, Words)]
    for mark in panel.marks:
        _mark(axes, mark)
    axes.set_title(typeset(panel.title), loc="left", size=SMALL)
    _axis(axes, "x", panel.x)
    _axis(axes, "y", panel.y)
    separate_texts([text for mark, text in words if mark.across == "left"])


def _words(axes: Axes, mark: Words) -> Text:
    drawn = axes.text(
        mark.x, mark.y, typeset(grouped(mark.text)), size=SMALL, clip_on=False, ha=mark.across, va=mark.along,
        color=ink_on(colour_of(mark.inside)) if mark.inside else legible(colour_of(mark.colour)),
    )  # fmt: skip
    if mark.boxed:
        drawn.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.0})
    return drawn


def _mark(axes: Axes, mark: Mark) -> None:
    if isinstance(mark, Bars):
        draws = axes.bar if mark.upright else axes.barh
        fill: dict[str, Any] = (
            {"facecolor": "none", "edgecolor": colour_of(mark.colour)}
            if mark.hollow
            else {"color": colour_of(mark.colour)}
        )
        bars = draws(mark.places, mark.values, mark.width, linewidth=1.3 if mark.hollow else 0.0, **fill)
        if mark.numbers:
            axes.bar_label(bars, [grouped(text) for text in mark.numbers], size=SMALL)
    elif isinstance(mark, Area):
        axes.fill_between(mark.x, mark.low, mark.high, color=colour_of(mark.colour), linewidth=0)
    elif isinstance(mark, Line) and np.size(mark.x):
        axes.plot(mark.x, mark.y, clip_on=bool(mark.width), **_look(mark))


def _look(line: Line) -> dict[str, Any]:
    dash = (0, tuple(line.dash)) if line.dash else "-"
    look: dict[str, Any] = {"color": colour_of(line.colour), "marker": line.marker, "markersize": line.size}
    look |= {"linestyle": dash if line.width else "", "linewidth": line.width, "zorder": 1 if line.behind else 2}
    if line.hollow:
        look["fillstyle"] = "none"
    if line.marker == "|":
        look["markeredgewidth"] = 2.5
    return look


def _axis(axes: Axes, name: Literal["x", "y"], axis: Axis) -> None:
    ticks_axis = axes.xaxis if name == "x" else axes.yaxis
    axes.set(**{f"{name}label": axis.label})
    if axis.log:
        axes.set(**{f"{name}scale": "log"})
        ticks_axis.set_major_locator(LogLocator(10.0, tuple(axis.log), numticks=12))
        ticks_axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ticks_axis.set_minor_locator(LogLocator(10.0, (), numticks=12))
    if axis.ends is not None:
        axes.set(**{f"{name}lim": axis.ends})
    if axis.ticks is not None:
        ticks_axis.set_ticks([place for place, _ in axis.ticks], [text for _, text in axis.ticks])
        ticks_axis.set_minor_locator(NullLocator())
    if not axis.grid:
        axes.grid(axis=name, visible=False)
        if name == "y":
            axes.tick_params(axis="y", length=0)
