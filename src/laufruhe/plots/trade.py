"""Time against error of every fidelity, its regret as colour."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PathCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from laufruhe.plots.style import FAINT, INK, Page, heading, page
from laufruhe.studies.trade import Row, Trade

Array = NDArray[np.float64]

LEAST_ERROR, LEAST_REGRET = 1e-7, 1e-8
LABEL_WIDTH, LABEL_HEIGHT = 0.28, 0.03
"""Of a name, over the panel."""


def has_picture(found: Trade) -> bool:
    """Whether the fidelities differ in anything but time."""
    return any(row.error > 0.0 for row in found.rows)


def figure(found: Trade) -> Figure:
    """One panel: evaluation time of another design against error, the front joined."""
    drawn = page(1, 1, (6.6, 4.4))
    axes, rows = drawn.panels[0], found.rows
    times = np.array([1e6 * row.evaluation for row in rows])
    errors = np.array([max(row.error, LEAST_ERROR) for row in rows])
    front = _front(rows)
    joined = [(1e6 * row.evaluation, max(row.error, LEAST_ERROR)) for row in front]
    axes.plot(*zip(*joined, strict=True), color=FAINT, lw=0.9, zorder=1)
    decides = np.array([not math.isnan(row.regret) for row in rows])
    axes.scatter(times[~decides], errors[~decides], s=55, zorder=3, facecolors="white", edgecolors=INK, linewidths=0.8)
    regrets = [max(row.regret, LEAST_REGRET) for row in rows if not math.isnan(row.regret)]
    dots = axes.scatter(
        times[decides], errors[decides], c=regrets, cmap="viridis_r", norm=LogNorm(LEAST_REGRET, 1.0), s=55, zorder=3,
        edgecolors=INK, linewidths=0.5,
    )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="time of another design [µs]", ylabel="relative error of the objective")
    axes.set_xlim(0.75 * times.min(), 3.2 * times.max())
    axes.set_ylim(_lowest(errors), 3.0 * errors.max())
    _name(axes, rows, times, errors)
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    scales: list[Axis] = [axes.xaxis, axes.yaxis]
    if regrets:
        scales.append(_colour_bar(drawn, dots))
    for axis in scales:
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    hollow = "" if decides.all() else " Hollow: nothing decided."
    heading(
        drawn.figure, "Speed against accuracy", found.problem.title, [],
        f"Joined: beaten by none in both. At the edge: errors under {LEAST_ERROR:g}, regrets under "
        f"{LEAST_REGRET:g}.{hollow} Computed with Laufruhe.",
    )  # fmt: skip
    return drawn.figure


def _lowest(errors: Array) -> float:
    """Lower end of the scale: names of all that lie at the edge stand under each other."""
    share = LABEL_HEIGHT * (2.0 + float(np.sum(errors == LEAST_ERROR)))
    top, edge = math.log10(3.0 * errors.max()), math.log10(LEAST_ERROR)
    return float(10.0 ** ((edge - share * top) / (1.0 - share)))


def _colour_bar(drawn: Page, dots: PathCollection) -> Axis:
    """The scale of regret beside the panel."""
    axes = drawn.panels[0]
    place = axes.get_position()
    axes.set_position((place.x0, place.y0, 0.86 * place.width, place.height))
    side = drawn.figure.add_axes((place.x0 + 0.89 * place.width, place.y0, 0.022 * place.width, place.height))
    drawn.figure.colorbar(dots, cax=side).set_label("regret of its optimum")
    return side.yaxis


def _front(rows: tuple[Row, ...]) -> list[Row]:
    """Rows that no other beats in time and error, in the order of time."""
    front: list[Row] = []
    for row in sorted(rows, key=lambda r: (r.evaluation, r.error)):
        if not front or row.error < front[-1].error:
            front.append(row)
    return front


def _name(axes: Axes, rows: tuple[Row, ...], times: Array, errors: Array) -> None:
    """Names beside the dots, moved down where two would cover each other, to the left at the right edge."""
    (left, right), (low, high) = np.log10(axes.get_xlim()), np.log10(axes.get_ylim())
    width, height = right - left, high - low
    taken: list[tuple[float, float]] = []
    for k in np.argsort(-errors):
        x, y, shift = math.log10(times[k]), math.log10(errors[k]), 0.0
        leftwards = x + LABEL_WIDTH * width > right
        start = x - (LABEL_WIDTH * width if leftwards else 0.0)
        while any(
            abs(y + shift - v) < LABEL_HEIGHT * height and abs(start - u) < LABEL_WIDTH * width for u, v in taken
        ):
            shift -= 0.25 * LABEL_HEIGHT * height
        taken.append((start, y + shift))
        gap = -0.012 * width if leftwards else 0.012 * width
        axes.annotate(
            rows[k].name, (times[k], errors[k]), xytext=(10 ** (x + gap), 10 ** (y + shift)), fontsize=7,
            va="center", ha="right" if leftwards else "left", color=INK,
        )  # fmt: skip
