"""Common parts of all pictures: page, colours, fonts, and the words around the data.

A picture is made under `styled()`, begins with a `page` of panels and ends with `finish_page` (or `heading`), which
adds margins so that everything drawn lies on the page. Figures are made without pyplot and laid out in inches, because
pyplot and automatic layout cost a third of the time that a picture takes.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import shorten
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox
from PIL import Image

from laufruhe.errors import counted, wrong_call
from laufruhe.numerics.arrays import Array
from laufruhe.plots.letters import families
from laufruhe.plots.words import FAINT, INK, SMALL, fit_line, round_ticks, typeset, width_of, wrap_lines
from laufruhe.present.measures import evaluations_with_loads, is_changed
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import FINAL, INITIAL, Result

# Okabe and Ito: distinct for colour-blind readers, and by lightness in print
GREY, SKY, BLUE, ORANGE, VERMILION, GREEN = "#8a8a8a", "#56B4E9", "#0072B2", "#E69F00", "#D55E00", "#009E73"
PURPLE, PALE = "#CC79A7", "#8fc4e8"
INDIGO, OLIVE, LEAF, RUST, MINT, WHITE = "#332288", "#999933", "#00664b", "#a63c00", "#d9ecd9", "#ffffff"
BEFORE, AFTER = GREY, BLUE
DPI = 150
GAP = 0.42
NARROWEST, WIDEST = 6.4, 10.2
"""Width of a page [inch]; the widest page keeps its size in a report."""
EDGE = 0.3
"""Margin around the content of a page [inch]."""
LONGEST_OBJECTIVE = 120
"""Largest number of characters of the objective's name on a picture."""
_BELOW_HEAD, _ABOVE_FOOT = 0.22, 0.2
_TITLE, _ENGINE = 13.0, 10.0
_LINE = 1.35 / 72.0
"""Height of a line of text of one point [inch]."""
_HANDLE, _GAP = 1.6, 1.6
_SMALLEST = 0.5
"""Least size of all panels together on a figure of the caller [inch]."""
_PER_TICK = 0.6
"""Room that a number of a lying axis takes [inch]."""

# names and titles are the user's: a dollar sign in them starts no formula
_SETTINGS: Any = {
    "font.size": SMALL, "axes.titlesize": 10.0,
    "axes.edgecolor": FAINT, "axes.labelcolor": INK, "axes.linewidth": 0.8, "axes.spines.top": False,
    "axes.spines.right": False, "axes.axisbelow": True, "axes.grid": True, "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7, "text.color": INK, "xtick.color": FAINT, "ytick.color": FAINT, "path.simplify": True,
    "text.parse_math": False, "legend.fontsize": SMALL, "svg.hashsalt": "laufruhe",
    # letters without hinting are drawn as wide as they are measured; headings of panels stay in place
    "text.hinting": "no_hinting", "axes.titley": 1.0,
}  # fmt: skip


@contextmanager
def styled() -> Iterator[None]:
    """Apply fonts and colours within the block or the decorated function."""
    with mpl.rc_context({**_SETTINGS, "font.family": families()}), warnings.catch_warnings():
        # `prepare` warns about missing letters once
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


_PLACE: ContextVar[Axes | Figure | SubFigure | None] = ContextVar("place", default=None)


@contextmanager
def drawn_on(place: Axes | Figure | SubFigure | None) -> Iterator[None]:
    """Draw pictures within the block on axes or on a figure of the caller, in place of figures of their own."""
    earlier = _PLACE.set(place)
    try:
        yield
    finally:
        _PLACE.reset(earlier)


@dataclass(frozen=True)
class Page:
    """A figure and its panels, row by row, with the size [inch] that they are laid out for."""

    figure: Figure
    panels: tuple[Axes, ...]
    size: tuple[float, float]


def page(
    rows: int,
    columns: int,
    panel: tuple[float, float],
    count: int | None = None,
    gap: float = GAP,
    lead: float = 0.0,
    across: float | None = None,
) -> Page:
    """Return `count` panels of one size [inch], by default rows times columns; `heading` adds the margins.

    The distance between panels is `gap`, between columns `across` if given; `lead` is above each panel, for its own
    heading [inch].
    """
    across = gap if across is None else across
    width = columns * panel[0] + (columns - 1) * across
    height = rows * (panel[1] + lead) + (rows - 1) * gap
    count = rows * columns if count is None else count
    place = _PLACE.get()
    if isinstance(place, Axes) and count > 1:
        raise wrong_call("ax", place, f"is one panel, and this picture has {count}", "give figure=, or neither")
    with styled():
        if isinstance(place, Axes):
            figure, panels = cast(Figure, place.figure), [place]
        elif place is not None:
            figure, panels = cast(Figure, place), []
        else:
            figure, panels = Figure(figsize=(width, height), dpi=DPI, facecolor="white"), []
            FigureCanvasAgg(figure)
        for k in range(len(panels), count):
            row, column = divmod(k, columns)
            left, bottom = column * (panel[0] + across), (rows - 1 - row) * (panel[1] + lead + gap)
            panels.append(figure.add_axes((left / width, bottom / height, panel[0] / width, panel[1] / height)))
        for axes in panels:
            round_ticks(axes.xaxis, min(max(int(panel[0] / _PER_TICK), 3), 7))
            round_ticks(axes.yaxis, 6)
    return Page(figure, tuple(panels), (width, height))


def heading(drawn: Page, title: str, lines: str, legend: Sequence[Artist], source: str, engine: str = "") -> None:
    """Add title, engine, description, legend and source.

    The page grows around them. On a figure of the caller the panels fill the rest. Axes of the caller get title and
    legend only.
    """
    figure, place = drawn.figure, _PLACE.get()
    # a picture removes panels that it leaves empty
    drawn = replace(drawn, panels=tuple(axes for axes in drawn.panels if axes in figure.axes))
    with styled():
        for axis in (axis for axes in drawn.panels for axis in (axes.xaxis, axes.yaxis)):
            axis.set_label_text(typeset(axis.get_label_text()))
        for artist in legend:
            artist.set_label(typeset(str(artist.get_label())))
        if isinstance(place, Axes):
            place.set_title(typeset(title), loc="left")
            if legend:
                place.legend(handles=list(legend))
            return
        page_size = _inches(figure)
        before, after = _outside(drawn, np.zeros(2), page_size)
        places = [axes.get_position(original=True) for axes in drawn.panels]
        width = float((page_size + before + after)[0]) + 2.0 * EDGE
        width = float(page_size[0]) if place is not None else max(width, NARROWEST)
        room = width - 2.0 * EDGE
        words = [(title, _TITLE, "bold", INK), (engine, _ENGINE, "normal", INK), (lines, SMALL, "normal", FAINT)]
        head = [(wrap_lines(text, room, size, weight), size, weight, ink) for text, size, weight, ink in words if text]
        foot = wrap_lines(source, room)
        rows, columns = _legend_shape([str(artist.get_label()) for artist in legend], room)
        above = sum(len(text) * size * _LINE + 0.03 for text, size, _, _ in head) + rows * 1.05 * SMALL * _LINE
        below = EDGE + len(foot) * SMALL * _LINE + _ABOVE_FOOT
        edges, margins = np.array([EDGE, below]), np.array([2.0 * EDGE, EDGE + above + _BELOW_HEAD + below])
        if place is None:
            height = float((page_size + before + after + margins)[1])
            figure.set_size_inches(width, height)
            _arrange(drawn, places, before + edges, page_size)
        else:
            height = float(page_size[1])
            # texts keep their size as panels shrink: what sticks out of them is measured again
            for _ in range(2):
                region, corner = page_size - before - after - margins, before + edges
                if region.min() < _SMALLEST:
                    need = page_size + np.maximum(_SMALLEST - region, 0.0)
                    rule = f"leaves no room for the panels, which need {need[0]:.1f} by {need[1]:.1f} inches"
                    raise wrong_call("figure", place, rule, "give a larger figure")
                _arrange(drawn, places, corner, region)
                before, after = _outside(drawn, corner, region)
        top, left = height - EDGE, EDGE / width
        for text, size, weight, ink in head:
            figure.text(left, top / height, "\n".join(text), size=size, weight=weight, va="top", color=ink,
                        linespacing=1.2)  # fmt: skip
            top -= len(text) * size * _LINE + 0.03
        if legend:
            entries = figure.legend(
                handles=list(legend), loc="upper left", bbox_to_anchor=(left, top / height), ncols=columns,
                frameon=False, fontsize=SMALL, borderpad=0.2, borderaxespad=0.0, handlelength=_HANDLE,
                columnspacing=_GAP, labelcolor=INK,
            )  # fmt: skip
            for entry_text in entries.get_texts():
                entry_text.set_text(fit_line(entry_text.get_text(), room - 2.6 * SMALL / 72.0))
        figure.text(left, EDGE / height, "\n".join(foot), size=SMALL, va="bottom", color=FAINT, linespacing=1.2)


def _inches(figure: Figure) -> Array:
    return np.array(figure.bbox.size) / figure.dpi


def _outside(drawn: Page, corner: Array, region: Array) -> tuple[Array, Array]:
    # what is drawn left of and below the region of the panels, and right of and above it [inch]
    bounds = Bbox.union([box for axes in drawn.panels if (box := axes.get_tightbbox()) is not None])
    ends = (bounds.get_points() - drawn.figure.bbox.get_points()[0]) / drawn.figure.dpi
    return corner - ends[0], ends[1] - corner - region


def _arrange(drawn: Page, places: Sequence[Bbox], corner: Array, region: Array) -> None:
    size = _inches(drawn.figure)
    for axes, place in zip(drawn.panels, places, strict=True):
        left_and_low, widths = (np.array(place.min) * region + corner) / size, np.array(place.size) * region / size
        axes.set_position((*left_and_low, *widths))


def finish_page(
    drawn: Page, result: Result, title: str, lines: str, legend: Sequence[Artist], note: str = ""
) -> Figure:
    """Finish the page of a result; `note` says what the picture leaves out."""
    problem = result.problem
    described = f"Source: {problem.source}. " if problem.source else ""
    source = f"{note}{described}Computed with Laufruhe, {problem.fidelity.summary}."
    heading(drawn, title, f"{lines} {_objective(problem)}".rstrip(), legend, source, problem.title)
    return drawn.figure


def _objective(problem: Problem) -> str:
    # without it, a load that the design raises looks like a fault
    if not problem.objective_name:
        return ""
    limits = f", under {counted(len(problem.limits), 'limit')}" if problem.limits else ""
    return f"Objective: {shorten(problem.objective_name, LONGEST_OBJECTIVE, placeholder='…')}{limits}."


def _legend_shape(labels: Sequence[str], room: float) -> tuple[int, int]:
    size = SMALL / 72.0
    for columns in range(len(labels), 0, -1):
        split = [list(part) for part in np.array_split(list(labels), columns)]
        width = sum(max(map(width_of, part)) + (_HANDLE + 0.8 + _GAP) * size for part in split)
        if width - _GAP * size <= room or columns == 1:
            return max(map(len, split)), columns
    return 0, 1


def point_name(result: Result, k: int) -> str:
    """Return the name of an operating point, and the reason for its choice."""
    points = result.problem.points
    return points[k].name if len(points) == 1 else f"{points[k].name} (largest loads of {len(points)} points)"


@dataclass(frozen=True)
class Series:
    """Design of a result with its colour and name."""

    design: Evaluation
    colour: str
    name: str

    def entry(self, text: str = "", **look: Any) -> Artist:
        """Return a legend entry."""
        return entry(f"{self.name}{text}", color=self.colour, **({"linewidth": 2.0} | look))


def series_of(result: Result, loads: bool = False) -> list[Series]:
    """Return the initial and the final design; only one if nothing was decided, or if one lacks loads."""
    if not is_changed(result):
        return [Series(result.final, AFTER, INITIAL)]
    designs = [Series(result.initial, BEFORE, INITIAL), Series(result.final, AFTER, FINAL)]
    return designs[-len(evaluations_with_loads(result)) :] if loads else designs


def entry(label: str, **look: Any) -> Line2D:
    """Return a legend entry of a line or a dot."""
    return Line2D([], [], label=label, **look)


def entry_of_dots(label: str, **look: Any) -> Line2D:
    """Return a legend entry of dots without a line."""
    return entry(label, **({"marker": "o", "linestyle": "none"} | look))


def save(figure: Figure, path: Path, svg: str = "") -> None:
    """Write a PNG or an SVG, by the ending; `svg` is the picture if it is already drawn as SVG."""
    if path.suffix == ".svg":
        path.write_text(svg or as_svg(figure), encoding="utf-8", newline="\n")
    else:
        path.write_bytes(as_png(figure))


def save_and_show(figure: Figure, place: Path, kinds: Sequence[str]) -> str:
    """Write a picture as files of these kinds, `place` has no ending; return it as SVG."""
    svg = as_svg(figure)
    for kind in kinds:
        save(figure, place.with_name(f"{place.name}.{kind}"), svg)
    return svg


def as_png(figure: Figure) -> bytes:
    """Return the picture as PNG."""
    canvas: Any = FigureCanvasAgg(figure)
    with styled():
        canvas.draw()
    drawn = io.BytesIO()
    # a picture without transparency
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(drawn, format="png", compress_level=3, dpi=(DPI, DPI))
    return drawn.getvalue()


def as_svg(figure: Figure) -> str:
    """Return the picture as SVG, letters as outlines, identical on every run."""
    drawn = io.StringIO()
    with styled():
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return drawn.getvalue()


def axis_end(values: Iterable[float]) -> float:
    """Return the largest value, or one if all are zero: the end of an axis."""
    return max(values, default=0.0) or 1.0
