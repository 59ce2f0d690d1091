"""Polar diagrams: the path that the tip of each mount force draws over one cycle (Hasselgruber, Figs. 8 and 9)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from laufruhe.machine import Mount
from laufruhe.plots.style import (
    FAINT,
    INK,
    Page,
    colours_of,
    fitted,
    heading,
    names_of,
    page,
    point_name,
    source_line,
    thin,
)
from laufruhe.present.measures import hardest_point, load_designs
from laufruhe.present.numbers import trimmed
from laufruhe.problem.evaluation import mount_samples
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

MOST_PANELS = 12
PANEL = 2.9


def figure(result: Result) -> Figure:
    """One panel for each mount, all to one scale."""
    k = hardest_point(result)
    designs = load_designs(result)
    paths = [_closed(mount_samples(design, k)) for design in designs]
    mounts = result.problem.engine.mounts[:MOST_PANELS]
    lateral, vertical = _reach(paths, len(mounts))
    columns = _columns(len(mounts), lateral < 0.7 * vertical)
    size = max(lateral, vertical)
    panel = (PANEL * lateral / size, PANEL * vertical / size)
    drawn = page(math.ceil(len(mounts) / columns), columns, panel, len(mounts), gap=0.5, lead=0.3)
    quarters = (len(paths[0]) - 1) // (4 * result.problem.engine.cycle.turns)
    for m, (axes, mount) in enumerate(zip(drawn.panels, mounts, strict=True)):
        for path, colour, name in zip(paths, colours_of(result, loads=True), names_of(result, loads=True), strict=True):
            _path(axes, path[:, m], colour, name, quarters)
        _frame(axes, mount, result.final.engine.mounts[m], lateral, vertical)
    _label(drawn, columns)
    heading(
        drawn.figure,
        "Mount forces over one working cycle",
        f"Force on each mount at {point_name(result, k)}, seen from the front.",
        _legend(result),
        source_line(result, _left_out(paths)),
    )
    return drawn.figure


def _reach(paths: list[Array], count: int) -> tuple[float, float]:
    """Ends of both axes, in one scale; no panel gets narrower than 0.55 of the other side."""
    lateral, vertical = (1.1 * thin(float(np.abs(p[:, :count, c]).max(initial=0.0)) for p in paths) for c in (1, 2))
    most = max(lateral, vertical)
    return max(lateral, 0.55 * most), max(vertical, 0.55 * most)


def _columns(count: int, narrow: bool) -> int:
    if narrow:
        return min(count, 4)
    return 2 if count in (2, 4) else min(count, 3)


def _closed(samples: Array) -> Array:
    return np.concatenate([samples, samples[:1]])


def _path(axes: Axes, path: Array, colour: str, name: str, quarters: int) -> None:
    axes.plot(path[:, 1], path[:, 2], color=colour, linewidth=1.6, label=name, solid_joinstyle="round")
    if quarters:
        dots = path[:-1:quarters]
        axes.plot(dots[:, 1], dots[:, 2], "o", color=colour, markersize=3.6, markeredgewidth=0)
        axes.plot(*dots[0, 1:], "o", markersize=7, markerfacecolor="none", markeredgecolor=colour, markeredgewidth=1.3)


def _frame(axes: Axes, mount: Mount, moved: Mount, lateral: float, vertical: float) -> None:
    axes.set(xlim=(-lateral, lateral), ylim=(-vertical, vertical), aspect="equal")
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    for direction in (axes.xaxis, axes.yaxis):
        direction.set_major_locator(MaxNLocator(4, symmetric=True, steps=[1, 2, 5, 10]))
    name = fitted(mount.name, PANEL * lateral / max(lateral, vertical) + 0.9, 10)
    axes.set_title(name, loc="left", pad=17, size=10, color=INK, parse_math=False)
    words = f"at {_place(mount)} mm" if mount.position == moved.position else f"moved to {_place(moved)} mm"
    axes.annotate(words, (0, 1), (0, 6), "axes fraction", "offset points", size=7, color=FAINT)


def _place(mount: Mount) -> str:
    return ", ".join(trimmed(1e3 * value).replace("-", "−") for value in mount.position)


def _label(drawn: Page, columns: int) -> None:
    for k, axes in enumerate(drawn.panels):
        below = k + columns < len(drawn.panels)
        axes.tick_params(labelbottom=not below, labelleft=k % columns == 0, length=2)
        if not below:
            axes.set_xlabel("lateral force [N]")
        if k % columns == 0:
            axes.set_ylabel("vertical force [N]")


def _left_out(paths: list[Array]) -> str:
    size = max(float(np.abs(path).max(initial=0.0)) for path in paths)
    along = max(float(np.abs(path[..., 0]).max(initial=0.0)) for path in paths)
    count = paths[0].shape[1]
    forces = "Longitudinal forces are not shown. " if along > 0.01 * size else ""
    return forces + (f"The first {MOST_PANELS} of {count} mounts. " if count > MOST_PANELS else "")


def _legend(result: Result) -> list[Artist]:
    lines: list[Artist] = [
        Line2D([], [], color=colour, linewidth=2.0, label=name)
        for colour, name in zip(colours_of(result, loads=True), names_of(result, loads=True), strict=True)
    ]
    dot = Line2D([], [], color=INK, marker="o", linestyle="none", markersize=3.6, label="every 90° of the crank")
    ring = Line2D(
        [], [], color=INK, marker="o", linestyle="none", markersize=7, markerfacecolor="none", label="cylinder 1 fires"
    )
    return [*lines, dot, ring]
