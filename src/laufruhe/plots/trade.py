"""Time against error of every fidelity, its regret as colour."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.numerics.arrays import Array
from laufruhe.plots.letters import prepare
from laufruhe.plots.style import Page, heading, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL, spread, typeset
from laufruhe.studies.trade import Trade, TradeRow

MIN_ERROR, MIN_REGRET = 1e-7, 1e-8
PANEL, DOT = (5.4, 4.4), 0.13
"""Width and height of the panel, and room of a dot [inch]."""
NAME_HEIGHT = 0.036
"""Height of a name relative to the panel."""
_NAMES = 1.03
"""Left end of the names relative to the panel."""
_FEW_DECADES = 30.0
_PLAIN = FuncFormatter(lambda value, _: _power(value))


def _power(value: float) -> str:
    exponent = round(math.log10(value)) if value > 0.0 else 0
    return typeset(f"10^{exponent}") if exponent < -3 and math.isclose(value, 10.0**exponent) else f"{value:g}"


def has_picture(trade: Trade) -> bool:
    """Return True if the fidelities differ in more than time."""
    return any(row.error > 0.0 for row in trade.rows)


def figure(trade: Trade) -> Figure:
    """Draw evaluation time against error, the Pareto front joined."""
    prepare([trade.problem.title])
    return _drawn(trade)


@styled()
def _drawn(trade: Trade) -> Figure:
    sheet = page(1, 1, PANEL)
    axes, rows = sheet.panels[0], trade.rows
    times = np.array([1e6 * row.evaluation for row in rows])
    axes.set(xscale="log", yscale="log", xlabel="time of another design [µs]", ylabel="relative error of the objective")
    axes.set_xlim(0.75 * times.min(), 1.4 * times.max())
    errors = _places(axes, np.array([row.error for row in rows]), times)
    front: list[TradeRow] = []
    for row in sorted(rows, key=lambda row: (row.evaluation, row.error)):
        if not front or row.error < front[-1].error:
            front.append(row)
    joined = sorted((times[k], errors[k]) for k, row in enumerate(rows) if row in front and row.error >= MIN_ERROR)
    axes.plot([time for time, _ in joined], [error for _, error in joined], color=FAINT, lw=1.1, zorder=2)
    decides = np.array([row.decides and not math.isnan(row.regret) for row in rows])
    axes.scatter(times[~decides], errors[~decides], s=55, zorder=3, facecolors="white", edgecolors=INK, linewidths=0.8)
    regrets = [max(row.regret, MIN_REGRET) for row, is_drawn in zip(rows, decides, strict=True) if is_drawn]
    dots = axes.scatter(
        times[decides], errors[decides], c=regrets, cmap="viridis_r", norm=LogNorm(MIN_REGRET, 1.0), s=55, zorder=3,
        edgecolors=INK, linewidths=0.5,
    )  # fmt: skip
    if times.max() < _FEW_DECADES * times.min():
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(_PLAIN)
    # the band under the axis has its own label
    minimum = 1.01 * MIN_ERROR if min(row.error for row in rows) < MIN_ERROR else 0.0
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _power(value) if value > minimum else ""))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    _name(axes, rows, times, errors)
    if regrets:
        _colour_bar(sheet, dots)
    hollow = "" if decides.all() else " Hollow: no design, or one beyond a limit."
    heading(
        sheet.figure, "Speed against accuracy", "Every fidelity: time of one evaluation against its error.", [],
        f"Line: fidelities that no other beats in time and error. Regrets below {_power(MIN_REGRET)} are drawn there."
        f"{hollow} Computed with Laufruhe.", trade.problem.title,
    )  # fmt: skip
    return sheet.figure


def _places(axes: Axes, errors: Array, times: Array) -> Array:
    """Return the drawn errors; very small errors are drawn in a band below the axis."""
    small = errors < MIN_ERROR
    width, height = PANEL
    low, end = np.log10(axes.get_xlim())
    across = width * (np.log10(times) - low) / (end - low)
    levels = np.zeros(len(errors), dtype=int)
    for j, k in enumerate(order := [k for k in np.argsort(times, kind="stable") if small[k]]):
        used = {levels[neighbour] for neighbour in order[:j] if across[k] - across[neighbour] < DOT}
        levels[k] = next(level for level in range(len(errors)) if level not in used)
    band = DOT * (levels.max(initial=0) + 1.5) if small.any() else 0.0
    minimum = MIN_ERROR if small.any() else 0.5 * errors.min()
    top = 2.0 * max(errors.max(), 2.0 * minimum)
    decades = (math.log10(top) - math.log10(minimum)) / max(height - band, 0.5 * height)
    axes.set_ylim(minimum * 10.0 ** (-decades * band), top)
    if small.any():
        axes.axhspan(axes.get_ylim()[0], minimum, color="#f0f2f4", linewidth=0.0, zorder=0.4)
        middle = math.sqrt(minimum * axes.get_ylim()[0])
        axes.text(-0.02, middle, f"under {_power(minimum)}", transform=axes.get_yaxis_transform(), ha="right",
                  va="center", color=FAINT, size=SMALL)  # fmt: skip
    return np.where(small, minimum * 10.0 ** (-decades * DOT * (levels + 0.75)), errors)


def _colour_bar(drawn: Page, dots: PathCollection) -> None:
    place, high = drawn.panels[0].get_position(), drawn.figure.get_size_inches()[1]
    above = drawn.figure.add_axes((place.x0 + 0.3 * place.width, place.y1 + 0.3 / high, 0.7 * place.width, 0.1 / high))
    bar = drawn.figure.colorbar(dots, cax=above, orientation="horizontal", format=_PLAIN)
    bar.ax.tick_params(labelsize=SMALL, which="major")
    bar.ax.minorticks_off()
    bar.ax.text(-0.02, 0.5, "regret of its optimum", transform=bar.ax.transAxes, ha="right", va="center", fontsize=9)


def _name(axes: Axes, rows: tuple[TradeRow, ...], times: Array, errors: Array) -> None:
    (left, right), (low, high) = (np.log10(side) for side in (axes.get_xlim(), axes.get_ylim()))
    # of dots at one height, the nearest to the names gets the lowest name, so that no line crosses another name
    heights = (np.log10(errors) - low) / (high - low) - 1e-6 * np.argsort(np.argsort(times))
    across = (np.log10(times) - left) / (right - left)
    for row, x, y, height in zip(rows, across, heights, spread(heights, NAME_HEIGHT), strict=True):
        axes.plot([x, _NAMES - 0.005], [y, height], transform=axes.transAxes, color="#c4c4c4", lw=0.6, zorder=1,
                  clip_on=False)  # fmt: skip
        axes.text(_NAMES, height, row.name, transform=axes.transAxes, size=SMALL, va="center", color=INK, zorder=1)
