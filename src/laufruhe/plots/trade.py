"""Time against error of every fidelity, its regret as colour."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from laufruhe.plots.style import FAINT, INK, heading, page
from laufruhe.studies.trade import Row, Trade

Array = NDArray[np.float64]

LEAST_ERROR, LEAST_REGRET = 1e-7, 1e-8


def figure(found: Trade) -> Figure:
    """One panel: evaluation time of another design against error, the front joined."""
    drawn = page(1, 1, (6.6, 4.4))
    axes = drawn.panels[0]
    rows = found.rows
    times = np.array([1e6 * row.evaluation for row in rows])
    errors = np.array([max(row.error, LEAST_ERROR) for row in rows])
    regrets = np.array([max(0.0 if math.isnan(row.regret) else row.regret, LEAST_REGRET) for row in rows])
    front = _front(rows)
    joined = [(1e6 * row.evaluation, max(row.error, LEAST_ERROR)) for row in front]
    axes.plot(*zip(*joined, strict=True), color=FAINT, lw=0.9, zorder=1)
    dots = axes.scatter(
        times, errors, c=regrets, cmap="viridis_r", norm=LogNorm(LEAST_REGRET, 1.0), s=55, zorder=3,
        edgecolors=INK, linewidths=0.5,
    )  # fmt: skip
    _name(axes, rows, times, errors)
    axes.set(xscale="log", yscale="log", xlabel="time of another design [µs]", ylabel="relative error of the objective")
    axes.set_xlim(0.75 * times.min(), 3.2 * times.max())
    axes.set_ylim(0.4 * LEAST_ERROR, 3.0 * errors.max())
    place = axes.get_position()
    axes.set_position((place.x0, place.y0, 0.86 * place.width, place.height))
    side = drawn.figure.add_axes((place.x0 + 0.89 * place.width, place.y0, 0.022 * place.width, place.height))
    bar = drawn.figure.colorbar(dots, cax=side)
    bar.set_label("regret of its optimum")
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    for axis in (axes.xaxis, axes.yaxis, side.yaxis):
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    heading(
        drawn.figure, "Speed against accuracy", f"{found.problem.title}; joined are those that none beats in both.", [],
        f"Errors under {LEAST_ERROR:g} and regrets under {LEAST_REGRET:g} are drawn there. Computed with Laufruhe.",
    )  # fmt: skip
    return drawn.figure


def _front(rows: tuple[Row, ...]) -> list[Row]:
    """Rows that no other beats in time and error, in the order of time."""
    front: list[Row] = []
    for row in sorted(rows, key=lambda r: (r.evaluation, r.error)):
        if not front or row.error < front[-1].error:
            front.append(row)
    return front


def _name(axes: Axes, rows: tuple[Row, ...], times: Array, errors: Array) -> None:
    """Names beside the dots, moved apart where two would cover each other."""
    taken: list[tuple[float, float]] = []
    for k in np.argsort(-errors):
        x, y = math.log10(times[k]), math.log10(errors[k])
        shift = 0.0
        while any(abs(y + shift - v) < 0.2 and abs(x - u) < 0.6 for u, v in taken):
            shift -= 0.07
        taken.append((x, y + shift))
        axes.annotate(
            rows[k].name, (times[k], errors[k]), xytext=(times[k] * 1.09, errors[k] * 10**shift), fontsize=7,
            va="center", color=INK,
        )  # fmt: skip
