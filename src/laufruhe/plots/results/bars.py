"""Mean and maximum of each mount's force as bars (Hasselgruber, Fig. 12)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.numerics.arrays import Array
from laufruhe.plots.style import Series, axis_end, finish_page, page, series_of, styled
from laufruhe.plots.words import FAINT, INK, SMALL, fit_line, in_thousands, ink_on
from laufruhe.present.measures import hardest_point, has_mount_forces
from laufruhe.present.numbers import number
from laufruhe.present.pictures import rows_of
from laufruhe.problem.evaluation import Evaluation, place_measures
from laufruhe.solvers.result import Result

MAX_POINTS, MAX_GROUPS = 4, 7
GROUP, WIDTH = 1.22, 0.42
"""Width of a group of bars [inch], and of a bar over it."""
applies = has_mount_forces


@styled()
def figure(result: Result) -> Figure:
    """Draw mean and maximum mount force as bars: a group for each mount, one for all, a row per operating point."""
    several = range(len(result.problem.points))
    points = list(several) if len(several) <= MAX_POINTS else [hardest_point(result)]
    names = [*result.initial.mount_names, "all mounts"]
    parts, side = rows_of(len(names), MAX_GROUPS)
    rows = [(k, part) for k in points for part in parts]
    high = 3.2 if len(rows) == 1 else 2.1
    drawn = page(len(rows), 1, (max(GROUP * (side + 0.3), 4.2), high), lead=0.12 if len(points) > 1 else 0.0)
    series = series_of(result, loads=True)
    values = {k: [_measures(one.design, k) for one in series] for k in points}
    top = axis_end(float(table.max(initial=0.0)) for tables in values.values() for table in tables)
    factor, unit = in_thousands(top, "N")
    for axes, (k, part) in zip(drawn.panels, rows, strict=True):
        _groups(axes, values[k], series, part, top)
        axes.set_xticks(axes.get_xticks(), [fit_line(names[mount], GROUP - 0.08) for mount in part])
        axes.tick_params(axis="x", length=0)
        axes.grid(axis="x", visible=False)
        # room for a number above the highest bar
        room = 1.0 + 0.24 * axes.figure.dpi / axes.bbox.height
        axes.set(xlim=(-0.55, side - 0.15), ylim=(0.0, room * factor * top), ylabel=f"force on the mount [{unit}]")
        if len(several) > 1 and part is parts[0]:
            axes.set_title(f"at {result.problem.points[k].name}", loc="left", size=10)
    at = f" at {result.problem.points[points[0]].name}" if len(points) == 1 else ""
    lines = f"Magnitude of each mount's force{at}: mean over the working cycle, and its largest value."
    legend = [Patch(facecolor=one.colour, edgecolor=one.colour, label=one.name) for one in series]
    legend.append(Patch(facecolor=FAINT, edgecolor=FAINT, label="full: mean"))
    legend.append(Patch(facecolor="none", edgecolor=FAINT, linewidth=1.4, label="outline: maximum"))
    return finish_page(drawn, result, "Mean and maximum mount forces", lines, legend)


def _measures(design: Evaluation, k: int) -> Array:
    measures = place_measures(design, k)
    mean, maximum = np.array([m.mean for m in measures]), np.array([m.max for m in measures])
    return np.array([[*mean, mean.mean()], [*maximum, maximum.max()]])


def _groups(axes: Axes, values: list[Array], series: list[Series], part: range, top: float) -> None:
    factor = in_thousands(top, "N")[0]
    all_mounts = values[0].shape[1] - 1
    # the group of all mounts is separated by a gap
    places = np.array([k - part[0] + (0.3 if k == all_mounts and len(part) > 1 else 0.0) for k in part])
    # least height of a bar with a number inside
    room = 0.18 * axes.figure.dpi / axes.bbox.height * factor * top
    for k, (table, item) in enumerate(zip(values, series, strict=True)):
        mean, maximum = factor * table[:, part]
        at = places + (k - 0.5 * (len(values) - 1)) * (WIDTH + 0.04)
        axes.bar(at, mean, WIDTH, color=item.colour, linewidth=0, label="mean")
        axes.bar(at, maximum, WIDTH, facecolor="none", edgecolor=item.colour, linewidth=1.4, label="maximum")
        for x, low, high in zip(at, mean, maximum, strict=True):
            words = number(high, 3, factor * top)
            axes.annotate(words, (x, high), (0, 2), textcoords="offset points", ha="center", size=SMALL, color=INK)
            if low > room:
                inside: Any = {"ha": "center", "va": "top", "size": SMALL, "color": ink_on(item.colour)}
                axes.annotate(number(low, 3, factor * top), (x, low), (0, -2), textcoords="offset points", **inside)
    axes.set_xticks(places)
    if all_mounts in part and len(part) > 1:
        axes.axvline(0.5 * (places[-1] + places[-2]), color=FAINT, linewidth=0.7, linestyle=(0, (2, 3)))
