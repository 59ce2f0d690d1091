"""Free forces and couples by layout: a row an engine, a column a force or couple of an order."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from laufruhe.plots.style import AFTER, INK, PALE, credit, heading, page

ROW = 0.2
NAMES = 1.1


def free_forces(data: xr.Dataset) -> Figure:
    """Bars of what is free, the part that crank weights cannot take beside it, printed values as dots."""
    count = data.sizes["case"]
    drawn = page(1, 4, (1.75, ROW * count + 0.2), gap=0.3, lead=0.0)
    panels = drawn.panels
    columns = [(what, order) for order in data["order"].values for what in ("force", "couple")]
    for k, (axes, (what, order)) in enumerate(zip(panels, columns, strict=True)):
        _column(axes, data.sel(order=order), what)
        axes.set_title(f"{what}, order {order}", loc="left", size=9)
        axes.set_yticks(range(count), [str(name) for name in data["case"].values] if k == 0 else [], size=7.5)
    _make_room(panels, drawn.figure.get_figwidth())
    legend: list[Artist] = [
        Patch(color=AFTER, label="free"),
        Patch(color=PALE, label="of it against the crank"),
        Line2D([], [], color=INK, marker="o", markersize=3.5, linestyle="", label="literature"),
    ]
    words = "Pistons alone, over one cylinder's force, couples times the spacing."
    heading(drawn.figure, data.attrs["title"], words, legend, credit(data))
    return drawn.figure


def _column(axes: Axes, data: xr.Dataset, what: str) -> None:
    rows = list(range(data.sizes["case"]))
    free, against, printed = (data[name].values for name in (what, f"{what}_against", f"{what}_printed"))
    axes.barh(rows, free, 0.62, color=AFTER, linewidth=0)
    axes.barh(rows, against, 0.26, color=PALE, linewidth=0)
    axes.plot(printed, rows, "o", color=INK, markersize=3.5, clip_on=False)
    most = float(max(free.max(initial=0.0), np.nanmax(printed, initial=0.0))) or 1.0
    for row, value in zip(rows, free, strict=True):
        axes.text(value + 0.04 * most, row, f"{value:.4g}" if value > 1e-9 else "0", size=6.5, va="center")
    axes.set_xlim(0.0, 1.3 * most)
    axes.set_ylim(rows[-1] + 0.6, -0.6)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)


def _make_room(panels: tuple[Axes, ...], wide: float) -> None:
    """Shift the panels right, for the names of the engines."""
    left, right = panels[0].get_position(), panels[-1].get_position()
    shift = NAMES / wide
    factor = (right.x1 - left.x0 - shift) / (right.x1 - left.x0)
    for axes in panels:
        own = axes.get_position()
        start = left.x0 + shift + (own.x0 - left.x0) * factor
        axes.set_position((start, own.y0, own.width * factor, own.height))
