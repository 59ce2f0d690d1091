"""One picture for each part of a study: lines over what is swept, bars where engines are compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from laufruhe.plots.style import AFTER, BEFORE, heading, page, save

if TYPE_CHECKING:
    import xarray as xr

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8a8a8a")


def draw_study(datasets: dict[str, xr.Dataset], folder: Path) -> None:
    """A PNG named as its part."""
    for name, data in datasets.items():
        swept = [str(c) for c in data.coords if c not in ("mount", "case", "status")]
        drawn = page(1, 1, (max(6.4, 1.3 * data.sizes["point"] if not swept else 6.4), 3.6))
        legend = _lines(drawn.panels[0], data, swept) if swept else _bars(drawn.panels[0], data)
        drawn.panels[0].set_ylabel("mean mount force [N]")
        drawn.panels[0].set_ylim(bottom=0.0)
        words = "Mean over the working cycle and all mounts."
        heading(drawn.figure, data.attrs["title"], words, legend, f"{data.attrs['source']}. Computed with Laufruhe.")
        save(drawn.figure, folder / f"{name}.png")


def _bars(axes: Axes, data: xr.Dataset) -> list[Artist]:
    places = np.arange(data.sizes["point"])
    for shift, name, colour in ((-0.2, "objective_given", BEFORE), (0.2, "objective", AFTER)):
        bars = axes.bar(places + shift, data[name].values, 0.36, color=colour, linewidth=0)
        axes.bar_label(bars, fmt="%.0f", size=7.5)
    axes.set_xticks(places, [str(c) for c in data["case"].values], size=8)
    axes.grid(axis="x", visible=False)
    return [Patch(color=BEFORE, label="as given"), Patch(color=AFTER, label="proven optimum")]


def _lines(axes: Axes, data: xr.Dataset, swept: list[str]) -> list[Artist]:
    along = data[swept[-1]].values
    if along.dtype.kind not in "fi":
        along = np.array([float(str(v).split()[0]) for v in along])
    groups = data[swept[0]].values if len(swept) > 1 else data["case"].values
    legend: list[Artist] = []
    for group, colour in zip(dict.fromkeys(groups.tolist()), COLOURS, strict=False):
        chosen = groups == group
        x, y = along[chosen], data["objective"].values[chosen]
        axes.plot(x, y, color=colour)
        axes.plot(x[y.argmin()], y.min(), "o", color=colour)
        legend.append(Line2D([], [], color=colour, marker="o", label=str(group)))
    axes.set_xlabel(f"{swept[-1].split('.')[-1].replace('_', ' ')} (dot: least of the values swept)")
    return legend
