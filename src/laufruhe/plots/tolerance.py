"""What tolerances leave against what the drawing leaves: a row an engine, forces on a logarithmic axis."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter

from laufruhe.physics.modes import GRAVITY
from laufruhe.plots.style import AFTER, FAINT, INK, PALE, credit, heading, page
from laufruhe.present.numbers import percent
from laufruhe.studies.tolerance_study import rise_of

LEAST = 0.1
"""Left end of the axis [kp]; what is smaller stands there with its value."""
TALL = 0.7


def tolerance(data: xr.Dataset) -> Figure:
    """Density over random engines, worst sum, and the free force of the drawing."""
    count = data.sizes["case"]
    drawn = page(1, 1, (7.2, 0.62 * count + 0.5))
    axes = drawn.panels[0]
    for row, name in enumerate(data["case"].values):
        _row(axes, data.sel(case=name), row)
    _marks(axes, data, count)
    stated = np.atleast_1d(data.attrs.get("mark_forces", []))
    most = max([float(data["nominal"].max()), float(data["worst"].max()), *stated]) / GRAVITY
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlim(LEAST, max(2.0 * most, 10.0 * LEAST))
    axes.set_ylim(count - 0.5, -0.8)
    axes.set_yticks(range(count), [_label(data.sel(case=name)) for name in data["case"].values], size=8)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("largest free force over the cycle [kp]")
    legend: list[Artist] = [
        Patch(color=PALE, label=f"{data.attrs['engines']:,} random engines"),
        Line2D([], [], color=AFTER, marker="|", markersize=12, markeredgewidth=2.5, linestyle="", label="worst sum"),
        Line2D([], [], color=INK, marker="D", markersize=6, linestyle="", label="drawing"),
    ]
    if len(stated):
        legend.append(Line2D([], [], color=FAINT, linestyle=(0, (3, 2)), label="stated"))
    words = "What tolerances add to the free force. Percents: what 95 of 100 add to the mean mount force at most."
    heading(drawn.figure, data.attrs["title"], words, legend, credit(data, f"Seed {data.attrs['seed']}. "))
    return drawn.figure


def _label(data: xr.Dataset) -> str:
    """Name, and what tolerances do to the mounts."""
    rise = rise_of(data)
    return str(data["case"].item()) + (f"\n{percent(rise)}" if np.isfinite(rise) else "")


def _row(axes: Axes, data: xr.Dataset, row: int) -> None:
    places, density = _density(data["random"].values / GRAVITY, data["share"].values)
    axes.fill_between(places, row, row - TALL * density, color=PALE, linewidth=0)
    worst, nominal = float(data["worst"]) / GRAVITY, float(data["nominal"]) / GRAVITY
    axes.plot([worst], [row - 0.3], "|", color=AFTER, markersize=14, markeredgewidth=2.5)
    axes.text(worst * 1.08, row - 0.3, f"{worst:.0f}", size=8, va="center", color=AFTER)
    axes.plot([max(nominal, LEAST)], [row - 0.3], "D", color=INK, markersize=6, clip_on=False)
    axes.text(max(nominal, LEAST) * 1.12, row - 0.3, f"{nominal:.3g}", size=8, va="center", color=INK)


def _density(quantiles: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Density over the logarithm of the force, its peak at one, from quantiles four percent apart."""
    force = np.maximum(quantiles, 1e-6)[::8]
    steps = np.diff(np.log(force))
    density = np.diff(shares[::8]) / np.maximum(steps, 1e-9)
    middle = np.sqrt(force[1:] * force[:-1])
    places = np.concatenate([force[:1], middle, force[-1:]])
    return places, np.concatenate([[0.0], density / density.max(), [0.0]])


def _marks(axes: Axes, data: xr.Dataset, count: int) -> None:
    names, forces = (np.atleast_1d(data.attrs.get(key, [])) for key in ("mark_names", "mark_forces"))
    for name, force in zip(names, forces / GRAVITY if len(forces) else forces, strict=True):
        axes.plot([force, force], [-0.55, count - 0.5], color=FAINT, linestyle=(0, (3, 2)), linewidth=1.2, zorder=1)
        axes.text(force, -0.58, f"{name}: {force:.0f}", size=7.5, ha="center", va="bottom", color=FAINT)
