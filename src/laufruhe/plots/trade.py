"""Time against error of every fidelity, its regret as colour."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator
from numpy.typing import NDArray

from laufruhe.plots.style import Page, heading, page, styled
from laufruhe.plots.words import FAINT, INK, spread
from laufruhe.studies.trade import Row, Trade

Array = NDArray[np.float64]

LEAST_ERROR, LEAST_REGRET = 1e-7, 1e-8
PANEL, NAMES = (5.2, 4.4), 2.0
"""Width and height of the panel, width of the names beside it [inch]."""
NAME_HEIGHT = 0.036
"""Of a name, over the panel."""
_FEW_DECADES = 30.0
_PLAIN = FuncFormatter(lambda value, _: f"{value:g}")


def has_picture(found: Trade) -> bool:
    """Whether the fidelities differ in anything but time."""
    return any(row.error > 0.0 for row in found.rows)


@styled()
def figure(found: Trade) -> Figure:
    """One panel: evaluation time of another design against error, the front joined."""
    drawn = page(1, 1, (PANEL[0] + NAMES, PANEL[1]))
    axes, rows = drawn.panels[0], found.rows
    place = axes.get_position()
    axes.set_position((place.x0, place.y0, PANEL[0] / (PANEL[0] + NAMES) * place.width, place.height))
    times = np.array([1e6 * row.evaluation for row in rows])
    errors = np.array([max(row.error, LEAST_ERROR) for row in rows])
    joined = [(1e6 * row.evaluation, max(row.error, LEAST_ERROR)) for row in _front(rows)]
    axes.plot(*zip(*joined, strict=True), color=FAINT, lw=1.1, zorder=2)
    decides = np.array([not math.isnan(row.regret) for row in rows])
    axes.scatter(times[~decides], errors[~decides], s=55, zorder=3, facecolors="white", edgecolors=INK, linewidths=0.8)
    regrets = [max(row.regret, LEAST_REGRET) for row in rows if not math.isnan(row.regret)]
    dots = axes.scatter(
        times[decides], errors[decides], c=regrets, cmap="viridis_r", norm=LogNorm(LEAST_REGRET, 1.0), s=55, zorder=3,
        edgecolors=INK, linewidths=0.5,
    )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="time of another design [µs]", ylabel="relative error of the objective")
    axes.set_xlim(0.75 * times.min(), 1.4 * times.max())
    axes.set_ylim(0.5 * errors.min(), 2.0 * errors.max())
    if times.max() < _FEW_DECADES * times.min():
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(_PLAIN)
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    _name(axes, rows, times, errors)
    if regrets:
        _colour_bar(drawn, dots)
    hollow = "" if decides.all() else " Hollow: nothing decided."
    heading(
        drawn.figure, "Speed against accuracy", found.problem.title, [],
        f"Joined: beaten by none in both. At the edge: errors under {LEAST_ERROR:g}, regrets under "
        f"{LEAST_REGRET:g}.{hollow} Computed with Laufruhe.",
    )  # fmt: skip
    return drawn.figure


def _colour_bar(drawn: Page, dots: PathCollection) -> None:
    """The scale of regret above the panel."""
    place, high = drawn.panels[0].get_position(), drawn.figure.get_size_inches()[1]
    above = drawn.figure.add_axes((place.x0 + 0.3 * place.width, place.y1 + 0.3 / high, 0.7 * place.width, 0.1 / high))
    bar = drawn.figure.colorbar(dots, cax=above, orientation="horizontal", format=_PLAIN)
    bar.ax.tick_params(labelsize=7, which="major")
    bar.ax.minorticks_off()
    bar.ax.text(-0.02, 0.5, "regret of its optimum", transform=bar.ax.transAxes, ha="right", va="center", fontsize=9)


def _front(rows: tuple[Row, ...]) -> list[Row]:
    """Rows that no other beats in time and error, in the order of time."""
    front: list[Row] = []
    for row in sorted(rows, key=lambda r: (r.evaluation, r.error)):
        if not front or row.error < front[-1].error:
            front.append(row)
    return front


def _name(axes: Axes, rows: tuple[Row, ...], times: Array, errors: Array) -> None:
    """Names in a column beside the panel, each joined to its dot."""
    low, high = np.log10(axes.get_ylim())
    # of dots at one height the nearest to the names is named lowest: no line crosses another dot's name
    heights = (np.log10(errors) - low) / (high - low) - 1e-6 * np.argsort(np.argsort(times))
    for row, time, error, height in zip(rows, times, errors, spread(heights, NAME_HEIGHT), strict=True):
        axes.annotate(
            row.name, (time, error), xytext=(1.03, height), textcoords="axes fraction", fontsize=7, va="center",
            ha="left", color=INK, annotation_clip=False, zorder=1,
            arrowprops={"arrowstyle": "-", "color": "#c4c4c4", "lw": 0.6, "shrinkA": 0.0, "shrinkB": 3.0},
        )  # fmt: skip
