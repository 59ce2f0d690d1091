"""Mean and maximum of each mount's force as bars (Hasselgruber, Fig. 12)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.plots.style import Series, headed, page, series_of, styled, thin
from laufruhe.plots.words import FAINT, fitted
from laufruhe.present.measures import Array, hardest_point, has_mount_forces
from laufruhe.present.numbers import number
from laufruhe.problem.evaluation import Evaluation, measured
from laufruhe.solvers.result import Result

MOST_POINTS = 4
WIDTH = 0.36
applies = has_mount_forces


@styled()
def figure(result: Result) -> Figure:
    """One group of bars for each mount and one for all; one row for each operating point."""
    several = range(len(result.problem.points))
    shown = list(several) if len(several) <= MOST_POINTS else [hardest_point(result)]
    names = [*result.initial.mount_names, "all mounts"]
    wide = min(max(6.4, 1.15 * len(names)), 24.0)
    drawn = page(len(shown), 1, (wide, 3.4 if len(shown) == 1 else 2.3))
    series = series_of(result, loads=True)
    for axes, k in zip(drawn.panels, shown, strict=True):
        values = [_measures(one.design, k) for one in series]
        _groups(axes, values, series)
        _frame(axes, names, values, wide)
        axes.tick_params(labelbottom=k == shown[-1])
        if len(several) > 1:
            axes.set_title(f"at {result.problem.points[k].name}", loc="left", size=10, parse_math=False)
    at = f" at {result.problem.points[shown[0]].name}" if len(shown) == 1 else ""
    lines = f"Magnitude of each mount's force{at}: mean over the working cycle, and its largest value."
    legend = [patch for one in series for patch in (
        Patch(facecolor=one.colour, edgecolor=one.colour, label=f"{one.name}: mean"),
        Patch(facecolor="none", edgecolor=one.colour, linewidth=1.4, label="maximum"),
    )]  # fmt: skip
    return headed(drawn, result, "Mean and maximum mount forces", lines, legend)


def _measures(design: Evaluation, k: int) -> Array:
    """Mean and maximum of every mount and of all, shape (2, mounts + 1) [N]."""
    each = measured(design, k)
    mean, most = np.array([m.mean for m in each]), np.array([m.max for m in each])
    return np.array([[*mean, mean.mean()], [*most, most.max()]])


def _places(count: int) -> Array:
    """Where groups stand: that of all mounts apart from the others."""
    places = np.arange(count, dtype=float)
    places[-1] += 0.35
    return places


def _groups(axes: Axes, values: list[Array], series: list[Series]) -> None:
    top = thin(float(v.max(initial=0.0)) for v in values)
    places = _places(values[0].shape[1])
    for k, ((mean, most), one) in enumerate(zip(values, series, strict=True)):
        at = places + (k - 0.5 * (len(values) - 1)) * (WIDTH + 0.04)
        axes.bar(at, mean, WIDTH, color=one.colour, linewidth=0, label="mean")
        axes.bar(at, most, WIDTH, facecolor="none", edgecolor=one.colour, linewidth=1.4, label="maximum")
        for x, low, high in zip(at, mean, most, strict=True):
            axes.text(x, high + 0.015 * top, number(high, 3, top), ha="center", va="bottom", size=7.5, color=FAINT)
            if low > 0.07 * top:
                axes.text(x, low - 0.015 * top, number(low, 3, top), ha="center", va="top", size=7.5, color="white")


def _frame(axes: Axes, names: list[str], values: list[Array], wide: float) -> None:
    places = _places(len(names))
    axes.set_xticks(places, [fitted(name, wide / len(names) + 0.5, 9) for name in names], parse_math=False)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="x", visible=False)
    axes.axvline(0.5 * (places[-1] + places[-2]), color=FAINT, linewidth=0.7, linestyle=(0, (2, 3)))
    top = 1.12 * thin(float(v.max(initial=0.0)) for v in values)
    axes.set(xlim=(-0.6, places[-1] + 0.6), ylim=(0.0, top), ylabel="force on the mount [N]")
