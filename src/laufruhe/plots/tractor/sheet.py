"""What the pictures of the tractor study share: colours, bars, the words around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from laufruhe.plots.style import BLUE, FAINT, GREEN, GREY, ORANGE, SKY, VERMILION, heading
from laufruhe.present.numbers import number
from laufruhe.studies.tractor.engines import KILOPOND

SERIES = (GREY, SKY, ORANGE, BLUE, VERMILION, GREEN)
FORCE = "force on the mount [kp]"
SOURCE = "After Hasselgruber 1964, {}. Computed with Laufruhe, exact kinematics."


def entitled(figure: Figure, title: str, line: str, legend: Sequence[Artist], number_of: str) -> Figure:
    """Title, what is seen, legend and source."""
    kiloponds = " 1 kp = 9.81 N." if any("kp" in axes.get_ylabel() + axes.get_title() for axes in figure.axes) else ""
    heading(figure, title, line, legend, SOURCE.format(number_of) + kiloponds)
    return figure


def line(colour: str, label: str, style: Literal["-", "--"] = "-", width: float = 2.0) -> Line2D:
    """A line in a legend."""
    return Line2D([], [], color=colour, label=label, linestyle=style, linewidth=width)


def dot(colour: str, label: str) -> Line2D:
    """A dot in a legend."""
    return Line2D([], [], color=colour, label=label, linestyle="none", marker="o", markersize=5)


def bar_legend(names: Sequence[str], colours: Sequence[str] = SERIES) -> list[Artist]:
    """Names of the series, and what filled and hollow means."""
    fills: list[Artist] = [Patch(facecolor=c, label=n) for n, c in zip(names, colours[: len(names)], strict=True)]
    return [
        *fills,
        Patch(facecolor=FAINT, label="filled: mean"),
        Patch(facecolor="none", edgecolor=FAINT, label="outline: largest"),
    ]


def _pairs(
    axes: Axes,
    places: NDArray[np.float64],
    mean: NDArray[np.float64],
    most: NDArray[np.float64],
    colour: str,
    width: float,
    top: float,
) -> None:
    """Mean as a filled bar, the largest value as an outline around it, with their numbers."""
    axes.bar(places, mean, width, color=colour, linewidth=0)
    axes.bar(places, most, width, facecolor="none", edgecolor=colour, linewidth=1.3)
    for x, low, high in zip(places, mean, most, strict=True):
        axes.text(x, high + 0.012 * top, number(float(high), 3), ha="center", va="bottom", size=6.5, color=FAINT)
        if low > 0.055 * top:
            axes.text(x, low - 0.012 * top, number(float(low), 3), ha="center", va="top", size=6.5, color="white")


def mount_bars(axes: Axes, data: xr.Dataset, colours: Sequence[str] = SERIES) -> None:
    """Bars of every mount and of all, a series for each design or engine of a dataset."""
    mean, most, names = _mounts_and_all(data)
    _group(axes, mean, most, names, colours[: len(mean)])
    axes.set_ylabel(FORCE)


def _group(
    axes: Axes, mean: NDArray[np.float64], most: NDArray[np.float64], names: Sequence[str], colours: Sequence[str]
) -> None:
    """Groups of bars, shape (series, groups), names below the groups."""
    count = len(mean)
    width = 0.84 / count
    top = float(most.max())
    places = np.arange(mean.shape[1], dtype=float)
    for k, colour in enumerate(colours):
        _pairs(axes, places + (k - 0.5 * (count - 1)) * width, mean[k], most[k], colour, 0.9 * width, top)
    axes.set_xticks(places, list(names))
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="x", visible=False)
    axes.set(xlim=(-0.6, places[-1] + 0.6), ylim=(0.0, 1.13 * top))


def _mounts_and_all(data: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Mean and largest of each mount and of all, shapes (design, mounts + 1) [kp]."""
    mean = np.column_stack([data["mean"].values, data["mean_of_mounts"].values]) / KILOPOND
    most = np.column_stack([data["maximum"].values, data["maximum"].max("mount").values]) / KILOPOND
    return mean, most, [*map(str, data["mount"].values), "all mounts"]
