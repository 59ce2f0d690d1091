"""Time against error of every fidelity, its regret as colour."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from laufruhe.plots.style import FAINT, INK, heading, page
from laufruhe.studies.trade import Row, Trade

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
    axes.plot(
        [1e6 * r.evaluation for r in front], [max(r.error, LEAST_ERROR) for r in front], color=FAINT, lw=0.9, zorder=1
    )
    dots = axes.scatter(
        times, errors, c=regrets, cmap="viridis_r", norm=LogNorm(LEAST_REGRET, 1.0), s=55, zorder=3,
        edgecolors=INK, linewidths=0.5,
    )  # fmt: skip
    _name(axes, rows, times, errors)
    axes.set(xscale="log", yscale="log", xlabel="time of another design [µs]", ylabel="relative error of the objective")
    axes.set_xlim(0.75 * times.min(), 3.2 * times.max())
    axes.set_ylim(0.4 * LEAST_ERROR, 3.0 * errors.max())
    bar = drawn.figure.colorbar(dots, ax=axes, fraction=0.04, pad=0.02)
    bar.set_label("regret of its optimum", fontsize=8)
    bar.ax.tick_params(labelsize=8)
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


def _name(axes: object, rows: tuple[Row, ...], times: np.ndarray, errors: np.ndarray) -> None:  # type: ignore[type-arg]
    """Names beside the dots, moved apart where two would cover each other."""
    taken: list[tuple[float, float]] = []
    for k in np.argsort(-errors):
        x, y = math.log10(times[k]), math.log10(errors[k])
        shift = 0.0
        while any(abs(y + shift - v) < 0.26 and abs(x - u) < 0.75 for u, v in taken):
            shift -= 0.07
        taken.append((x, y + shift))
        axes.annotate(  # type: ignore[attr-defined]
            rows[k].name, (times[k], errors[k]), xytext=(times[k] * 1.09, errors[k] * 10**shift), fontsize=7,
            va="center", color=INK,
        )  # fmt: skip
