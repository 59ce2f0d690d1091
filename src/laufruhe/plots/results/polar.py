"""Polar diagrams: the path that the tip of each mount force draws over one cycle (Hasselgruber, Figs. 8 and 9)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from laufruhe.machine import Mount
from laufruhe.plots.style import Page, Series, entry_of_dots, headed, page, point_name, series_of, styled, thin
from laufruhe.plots.words import FAINT, INK, fitted
from laufruhe.present.measures import Array, hardest_point, has_mount_forces
from laufruhe.present.numbers import trimmed
from laufruhe.problem.evaluation import samples_of
from laufruhe.solvers.result import Result

MOST_PANELS = 12
POINTS = 1440
PANEL = 2.9
applies = has_mount_forces


@styled()
def figure(result: Result) -> Figure:
    """One panel for each mount, all to one scale."""
    k, series = hardest_point(result), series_of(result, loads=True)
    paths = [_closed(samples_of(one.design, k)) for one in series]
    mounts = result.problem.engine.mounts[:MOST_PANELS]
    lateral, vertical = _reach(paths, len(mounts))
    columns = _columns(len(mounts), lateral < 0.7 * vertical)
    size = max(lateral, vertical)
    panel = (PANEL * lateral / size, PANEL * vertical / size)
    drawn = page(math.ceil(len(mounts) / columns), columns, panel, len(mounts), gap=0.5, lead=0.3)
    quarters = (len(paths[0]) - 1) // (4 * result.problem.engine.cycle.turns)
    for m, (axes, mount) in enumerate(zip(drawn.panels, mounts, strict=True)):
        for path, one in zip(paths, series, strict=True):
            _path(axes, path[:, m], one, quarters)
        _frame(axes, mount, result.final.engine.mounts[m], lateral, vertical)
    _label(drawn, columns)
    lines = f"Force on each mount at {point_name(result, k)}, seen from the front."
    return headed(drawn, result, "Mount forces over one working cycle", lines, _legend(series), _left_out(paths))


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
    """A turn of the path that ends where it began, in no more points than a picture shows."""
    count = len(samples)
    step = next((n for n in range(count // POINTS, 1, -1) if count % n == 0), 1)
    return np.concatenate([samples[::step], samples[:1]])


def _path(axes: Axes, path: Array, one: Series, quarters: int) -> None:
    axes.plot(path[:, 1], path[:, 2], color=one.colour, linewidth=1.6, label=one.name, solid_joinstyle="round")
    if quarters:
        dots = path[:-1:quarters]
        axes.plot(dots[:, 1], dots[:, 2], "o", color=one.colour, markersize=3.6, markeredgewidth=0)
        ring: Any = {"markersize": 7, "markerfacecolor": "none", "markeredgecolor": one.colour, "markeredgewidth": 1.3}
        axes.plot(*dots[0, 1:], "o", **ring)


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
        axes.set(xlabel="" if below else "lateral force [N]", ylabel="" if k % columns else "vertical force [N]")


def _left_out(paths: list[Array]) -> str:
    size = max(float(np.abs(path).max(initial=0.0)) for path in paths)
    along = max(float(np.abs(path[..., 0]).max(initial=0.0)) for path in paths)
    count = paths[0].shape[1]
    forces = "Longitudinal forces are not shown. " if along > 0.01 * size else ""
    return forces + (f"The first {MOST_PANELS} of {count} mounts. " if count > MOST_PANELS else "")


def _legend(series: list[Series]) -> list[Artist]:
    dot = entry_of_dots("every 90° of the crank", color=INK, markersize=3.6)
    ring = entry_of_dots("cylinder 1 fires", color=INK, markersize=7, markerfacecolor="none")
    return [*(one.entry() for one in series), dot, ring]
