"""What all pictures share: page, colours, fonts, and the words around the data.

Figures are made without pyplot and laid out in inches: both cost a third of the time
that a picture takes.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from laufruhe.present.measures import changed, load_designs
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

# Okabe and Ito: told apart by every eye, and by their lightness in print
GREY, SKY, BLUE, ORANGE, VERMILION, GREEN = "#8a8a8a", "#56B4E9", "#0072B2", "#E69F00", "#D55E00", "#009E73"
PURPLE, PALE = "#CC79A7", "#8fc4e8"
BEFORE, AFTER = GREY, BLUE
INK, FAINT = "#222222", "#666666"
DPI = 150
LEFT, RIGHT, TOP, BOTTOM = 0.85, 0.3, 1.2, 0.85
GAP = 0.42
NARROWEST = 6.4

# names and titles are the user's: a dollar sign in them starts no formula
_SETTINGS: Any = {
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans"], "font.size": 9.0, "axes.titlesize": 10.0,
    "axes.edgecolor": FAINT, "axes.labelcolor": INK, "axes.linewidth": 0.8, "axes.spines.top": False,
    "axes.spines.right": False, "axes.axisbelow": True, "axes.grid": True, "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7, "text.color": INK, "xtick.color": FAINT, "ytick.color": FAINT, "path.simplify": True,
    "text.parse_math": False,
}  # fmt: skip


@dataclass(frozen=True)
class Page:
    """A figure and its panels, row by row."""

    figure: Figure
    panels: tuple[Axes, ...]


def page(
    rows: int,
    columns: int,
    panel: tuple[float, float],
    count: int | None = None,
    gap: float = GAP,
    lead: float = 0.0,
    across: float | None = None,
) -> Page:
    """Panels of one size [inch] with room for a heading above and a source line below.

    Parameters
    ----------
    count
        Panels wanted, where fewer than rows times columns.
    gap, across
        Between panels, and between columns of them where that is another [inch].
    lead
        Above each panel, for a heading of its own [inch].
    """
    across = gap if across is None else across
    wide = max(LEFT + RIGHT + columns * panel[0] + (columns - 1) * across, NARROWEST)
    high = TOP + BOTTOM + rows * (panel[1] + lead) + (rows - 1) * gap
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(wide, high), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
        panels = []
        for k in range(rows * columns if count is None else count):
            row, column = divmod(k, columns)
            left = LEFT + column * (panel[0] + across)
            bottom = BOTTOM + (rows - 1 - row) * (panel[1] + lead + gap)
            panels.append(figure.add_axes((left / wide, bottom / high, panel[0] / wide, panel[1] / high)))
    return Page(figure, tuple(panels))


def heading(figure: Figure, title: str, lines: str, legend: Sequence[Artist], source: str) -> None:
    """Title, one line that says what is seen, the legend, and where the data come from."""
    wide, high = figure.get_size_inches()
    left = 0.3 / wide
    figure.text(left, 1 - 0.2 / high, fitted(title, wide, 13), size=13, weight="bold", va="top", color=INK)
    figure.text(left, 1 - 0.49 / high, fitted(lines, wide, 9), size=9, va="top", color=FAINT)
    columns = _legend_columns([str(artist.get_label()) for artist in legend], wide)
    figure.legend(
        handles=list(legend), loc="upper left", bbox_to_anchor=(left, 1 - 0.65 / high), ncols=columns, frameon=False,
        fontsize=9, borderpad=0.2, borderaxespad=0.0, handlelength=1.6, columnspacing=1.6, labelcolor=INK,
    )  # fmt: skip
    figure.text(left, 0.14 / high, fitted(source, wide, 7), size=7, va="bottom", color=FAINT)


def headed(drawn: Page, result: Result, title: str, lines: str, legend: Sequence[Artist], note: str = "") -> Figure:
    """The page of a result, finished; the note says what it leaves out."""
    problem = result.problem
    described = f"Engine: {problem.source}. " if problem.source else ""
    source = f"{note}{described}Computed with Laufruhe, {problem.fidelity.summary}."
    heading(drawn.figure, title, lines, legend, source)
    return drawn.figure


def _legend_columns(labels: Sequence[str], inches: float) -> int:
    """Entries side by side: all of them, or half where the figure is too narrow for one row."""
    letters = sum(len(label) for label in labels)
    handles_and_gaps = 4.0 * len(labels)
    fits = 9.0 / 72.0 * (0.53 * letters + handles_and_gaps) <= inches - 0.6
    return len(labels) if fits else -(-len(labels) // 2)


def fitted(text: str, inches: float, points: float) -> str:
    """Text cut to one line of a figure this wide; DejaVu Sans takes half its size a letter."""
    most = int((inches - 0.6) * 72.0 / (0.53 * points))
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


def point_name(result: Result, k: int) -> str:
    """An operating point, and why it is the one shown."""
    points = result.problem.points
    return points[k].name if len(points) == 1 else f"{points[k].name} (largest loads of {len(points)} points)"


@dataclass(frozen=True)
class Series:
    """One design of a result as pictures show it."""

    design: Evaluation
    colour: str
    name: str

    def entry(self, text: str = "", **look: Any) -> Artist:
        """Of a legend."""
        return entry(f"{self.name}{text}", color=self.colour, **({"linewidth": 2.0} | look))


def series_of(result: Result, loads: bool = False) -> list[Series]:
    """As given and as decided; one where nothing was decided, or where it is loads that only one design has."""
    if not changed(result):
        return [Series(result.final, AFTER, "as given")]
    both = [Series(result.initial, BEFORE, "as given"), Series(result.final, AFTER, "as decided")]
    return both[-len(load_designs(result)) :] if loads else both


def entry(label: str, **look: Any) -> Line2D:
    """A line or a dot of a legend."""
    return Line2D([], [], label=label, **look)


def entry_of_dots(label: str, **look: Any) -> Line2D:
    """Dots without a line."""
    return entry(label, **({"marker": "o", "linestyle": "none"} | look))


def save(figure: Figure, path: Path) -> None:
    """Write a PNG or an SVG, as the ending says."""
    if path.suffix == ".svg":
        path.write_text(as_svg(figure), encoding="utf-8", newline="\n")
        return
    with _drawing({}):
        figure.savefig(path, dpi=DPI, pil_kwargs={"compress_level": 4})


def as_svg(figure: Figure) -> str:
    """The picture as SVG, letters as outlines, the same every time."""
    drawn = io.StringIO()
    with _drawing({"svg.hashsalt": "laufruhe"}):
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return drawn.getvalue()


@contextmanager
def _drawing(more: Any) -> Iterator[None]:
    with mpl.rc_context({**_SETTINGS, **more}), warnings.catch_warnings():
        # a name in a script that the font lacks shows boxes; the tables have it right
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def thin(values: Iterable[float]) -> float:
    """Largest value, or one where all are zero: the end of an axis."""
    return max(values, default=0.0) or 1.0
