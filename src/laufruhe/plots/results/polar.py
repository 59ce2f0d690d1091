"""Polar diagrams: the path that the tip of each mount force draws over one cycle (Hasselgruber, Figs. 8 and 9)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from laufruhe.machine import Mount
from laufruhe.numerics.arrays import Array
from laufruhe.plots.style import Page, Series, axis_end, entry_of_dots, finish_page, page, point_name, series_of, styled
from laufruhe.plots.words import FAINT, INK, SMALL, fit_line, in_thousands, round_ticks
from laufruhe.present.measures import hardest_point, has_mount_forces
from laufruhe.present.numbers import figure as words
from laufruhe.present.numbers import trimmed
from laufruhe.present.pictures import rows_of
from laufruhe.problem.evaluation import channel_samples
from laufruhe.solvers.result import Result

MAX_PANELS, MAX_COLUMNS = 12, 4
POINTS = 1440
PANEL, GAP, LEAD = 2.0, 0.42, 0.42
# magnifications of the smaller direction
ENLARGED = (20, 10, 5, 2, 1)
STEADY = 0.25
"""Share of the largest force; forces that vary less than this are drawn without their steady part."""
NEEDLE = 1.0 / 24.0
"""Ratio of the smaller to the larger force below which the path is drawn over the crank angle."""
LATERAL, VERTICAL = 1, 2
NAMES = {LATERAL: "lateral", VERTICAL: "vertical"}
applies = has_mount_forces


@dataclass(frozen=True)
class Frame:
    """Axis limits that all panels share: the largest force [N], and the magnification of the forces by direction.

    `along` is the only direction that counts, whose force is shown over the crank angle, or None for paths; `others`
    is the largest force in the other direction [N].
    """

    size: float
    times: dict[int, int]
    along: int | None
    others: float

    @classmethod
    def from_paths(cls, paths: Sequence[Array], count: int) -> Frame:
        """Return the frame of the paths of the first `count` mounts."""
        maximum = {c: max(float(np.abs(path[:, :count, c]).max(initial=0.0)) for path in paths) for c in NAMES}
        small, large = sorted(NAMES, key=lambda c: maximum[c])
        share = maximum[small] / axis_end([maximum[large]])
        times = next(factor for factor in ENLARGED if factor * share <= 1.0)
        along = large if share < NEEDLE else None
        return cls(1.08 * axis_end([maximum[large]]), {large: 1, small: times}, along, maximum[small])


@styled()
def figure(result: Result) -> Figure:
    """Draw the path of the force vector on each mount over a cycle, one panel per mount, to one scale."""
    k, series = hardest_point(result), series_of(result, loads=True)
    paths, steady = _moving([_closed(channel_samples(item.design, k)) for item in series])
    mounts = result.problem.engine.mounts[:MAX_PANELS]
    frame, columns = Frame.from_paths(paths, len(mounts)), rows_of(len(mounts), MAX_COLUMNS)[1]
    drawn = page(math.ceil(len(mounts) / columns), columns, (PANEL, PANEL), len(mounts), GAP, LEAD, 0.44)
    cycle = result.problem.engine.cycle
    quarters = (len(paths[0]) - 1) // (4 * cycle.turns)
    first = result.final.engine.cylinders[0]
    firing_step = round((first.firing_angle % cycle.angle) / cycle.angle * (len(paths[0]) - 1))
    factor, unit = in_thousands(frame.size, "N")
    for m, (axes, mount) in enumerate(zip(drawn.panels, mounts, strict=True)):
        for path, item, width in zip(paths, series, (2.4, 1.5)[-len(series) :], strict=True):
            if frame.along is None:
                _path(axes, factor * path[:, m], item, quarters, firing_step, width)
            else:
                angles = np.linspace(0.0, math.degrees(cycle.angle), len(path))
                axes.plot(angles, factor * path[:, m, frame.along], color=item.colour, linewidth=width, label=item.name)
        _frame(axes, frame, factor, cycle.turns)
        _name(axes, mount, result.final.engine.mounts[m])
    _label(drawn, columns, frame, unit)
    legend: list[Artist] = [
        item.entry(linewidth=width) for item, width in zip(series, (2.4, 1.5)[-len(series) :], strict=True)
    ]
    why = ""
    if frame.along is None:
        legend.append(entry_of_dots("every 90° of the crank", color=INK, markersize=3.6))
        legend.append(entry_of_dots(f"{first.name} fires", color=INK, markersize=7, markerfacecolor="none"))
    else:
        other = NAMES[LATERAL if frame.along == VERTICAL else VERTICAL]
        at_most = f"no more than {words(frame.others, 'N', 2)}" if frame.others > 1e-9 * frame.size else "zero"
        why = f" The {other} force is {at_most}, so the {NAMES[frame.along]} one is shown over the crank angle."
    lines = f"Force on each mount at {point_name(result, k)}, seen from the front.{why}{steady}"
    forward, count = max(float(np.abs(path[..., 0]).max(initial=0.0)) for path in paths), paths[0].shape[1]
    note = "Longitudinal forces are not shown. " if forward > 0.01 * frame.size else ""
    note += f"The first {MAX_PANELS} of {count} mounts. " if count > MAX_PANELS else ""
    return finish_page(drawn, result, "Mount forces over one working cycle", lines, legend, note)


def _closed(samples: Array) -> Array:
    count = len(samples)
    step = next((n for n in range(count // POINTS, 1, -1) if count % n == 0), 1)
    return np.concatenate([samples[::step], samples[:1]])


def _moving(paths: list[Array]) -> tuple[list[Array], str]:
    moving = [path - path[:-1].mean(axis=0) for path in paths]
    largest, varying = (
        max(float(np.abs(path[..., 1:]).max(initial=0.0)) for path in group) for group in (paths, moving)
    )
    return (paths, "") if varying > STEADY * largest else (moving, " The steady part is left out.")


def _path(axes: Axes, path: Array, item: Series, quarters: int, firing_step: int, width: float) -> None:
    axes.plot(path[:, 1], path[:, 2], color=item.colour, linewidth=width, label=item.name, solid_joinstyle="round")
    if quarters:
        dots = path[:-1:quarters]
        axes.plot(dots[:, 1], dots[:, 2], "o", color=item.colour, markersize=3.6, markeredgewidth=0)
        ring: Any = {"markersize": 7, "markerfacecolor": "none", "markeredgecolor": item.colour, "markeredgewidth": 1.3}
        axes.plot(*path[firing_step, 1:], "o", **ring)


def _frame(axes: Axes, frame: Frame, factor: float, turns: int) -> None:
    size = factor * frame.size
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    round_ticks(axes.yaxis, 5, symmetric=frame.along is None)
    if frame.along is not None:
        axes.set(xlim=(0.0, 360.0 * turns), ylim=(-size, size))
        axes.xaxis.set_major_locator(MultipleLocator(180.0))
        return
    across, up = (size / frame.times[direction] for direction in (LATERAL, VERTICAL))
    axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.set(xlim=(-across, across), ylim=(-up, up), aspect=across / up)
    round_ticks(axes.xaxis, 4, symmetric=True)


def _name(axes: Axes, mount: Mount, final_mount: Mount) -> None:
    is_moved = mount.position != final_mount.position
    place = ", ".join(trimmed(1e3 * value).replace("-", "−") for value in final_mount.position)
    over: Any = {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(fit_line(mount.name, PANEL + 0.2, 10), (0, 1), (0, 18), size=10, color=INK, **over)
    words = fit_line(f"{'moved to' if is_moved else 'at'} {place} mm", PANEL + 0.3)
    axes.annotate(words, (0, 1), (0, 5), size=SMALL, color=FAINT, **over)


def _label(drawn: Page, columns: int, frame: Frame, unit: str) -> None:
    def label(direction: int) -> str:
        times = frame.times[direction]
        return f"{NAMES[direction]} force [{unit}]" + (f", enlarged {times} times" if times > 1 else "")

    across = label(LATERAL) if frame.along is None else "crank angle [°]"
    up = label(VERTICAL if frame.along is None else frame.along)
    for k, axes in enumerate(drawn.panels):
        below = k + columns < len(drawn.panels)
        axes.tick_params(labelbottom=not below, labelleft=k % columns == 0, length=2)
        axes.set(xlabel="" if below else across.replace(", ", ",\n"))
        axes.set(ylabel="" if k % columns else up.replace(", ", ",\n"))
