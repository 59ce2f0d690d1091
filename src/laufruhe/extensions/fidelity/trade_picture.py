"""Time of the calls of users at every fidelity against regret and error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.extensions.fidelity.trade import DESIGNS, Trade
from laufruhe.numerics.arrays import Array
from laufruhe.plots.letters import prepare
from laufruhe.plots.style import BLUE, heading, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL, spread, typeset

MIN_ERROR = 1e-7
PANEL = (5.4, 4.4)
"""Width and height of the panel [inch]."""
NAME_HEIGHT = 0.036
"""Height of a name relative to the panel."""
_NAMES = 1.03
"""Left end of the names relative to the panel."""
_FEW_DECADES = 30.0
_PLAIN = FuncFormatter(lambda value, _: _power(value))


def _power(value: float) -> str:
    exponent = round(math.log10(value)) if value > 0.0 else 0
    return typeset(f"10^{exponent}") if exponent < -3 and math.isclose(value, 10.0**exponent) else f"{value:g}"


@dataclass(frozen=True)
class _Panel:
    """Times [s] of fidelities, what they are off by, and bounds of that, NaN where nothing is known."""

    x: str
    y: str
    names: tuple[str, ...]
    times: Array
    errors: Array
    bounds: Array


def _panels(trade: Trade) -> list[_Panel]:
    nan, rows = math.nan, trade.rows
    regrets = [(row.name, row.solve, row.regret if row.decides else nan, row.regret_bound) for row in rows]
    kinds = [("time of one solve [s]", "regret of the design", regrets)]
    values = [(row.name, row.evaluation, row.error, row.estimate) for row in rows]
    if all(math.isnan(regret) for *_, regret, _ in regrets):
        kinds = [("time of one evaluation [s]", "relative error of the objective", values)]
    batches = [(row.name, row.batch, row.batch_error, nan) for row in rows]
    kinds.append((f"time of {DESIGNS:,} designs [s]", "largest relative error of a design", batches))
    panels = []
    for x, y, numbers in kinds:
        known = [row for row in numbers if math.isfinite(row[1]) and math.isfinite(row[2])]
        if known:
            names, times, errors, bounds = zip(*known, strict=True)
            panels.append(_Panel(x, y, names, np.array(times), np.maximum(errors, 0.0), np.array(bounds)))
    return panels


def has_picture(trade: Trade) -> bool:
    """Return True if the fidelities differ in more than time."""
    return any(panel.errors.max() > 0.0 for panel in _panels(trade))


def figure(trade: Trade) -> Figure:
    """Draw the time of each call against what a fidelity is off by, the Pareto front joined."""
    prepare([trade.problem.title])
    return _drawn(trade)


@styled()
def _drawn(trade: Trade) -> Figure:
    panels = _panels(trade)
    sheet = page(len(panels), 1, PANEL, gap=0.9)
    for axes, panel in zip(sheet.panels, panels, strict=True):
        _draw(axes, panel)
    heading(
        sheet, "Speed against accuracy", "Every fidelity: processor time of the calls that users make.", [],
        "Line: fidelities that no other beats in both. Thin line upwards: bound that the call states. "
        "Computed with Laufruhe.", trade.problem.title,
    )  # fmt: skip
    return sheet.figure


def _draw(axes: Axes, panel: _Panel) -> None:
    times = panel.times
    axes.set(xscale="log", yscale="log", xlabel=panel.x, ylabel=panel.y)
    axes.set_xlim(0.75 * times.min(), 1.4 * times.max())
    errors = np.maximum(panel.errors, MIN_ERROR)
    axes.set_ylim(0.5 * errors.min(), 2.0 * max(errors.max(), 2.0 * MIN_ERROR))
    front: list[int] = []
    for k in np.lexsort((panel.errors, times)):
        if not front or panel.errors[k] < panel.errors[front[-1]]:
            front.append(int(k))
    joined = [k for k in front if panel.errors[k] >= MIN_ERROR]
    axes.plot(times[joined], errors[joined], color=FAINT, lw=1.1, zorder=2)
    axes.vlines(times, errors, np.fmax(errors, np.minimum(panel.bounds, axes.get_ylim()[1])), color=BLUE, lw=0.8)
    axes.scatter(times, errors, s=45, zorder=3, color=BLUE, edgecolors=INK, linewidths=0.5)
    if times.max() < _FEW_DECADES * times.min():
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(_PLAIN)
    # smaller errors are drawn here
    edge = f"under {_power(MIN_ERROR)}"
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _power(value) if value > 1.01 * MIN_ERROR else edge))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    _name(axes, panel.names, times, errors)


def _name(axes: Axes, names: tuple[str, ...], times: Array, errors: Array) -> None:
    (left, right), (low, high) = (np.log10(side) for side in (axes.get_xlim(), axes.get_ylim()))
    # of dots at one height, the nearest to the names gets the lowest name, so that no line crosses another name
    heights = (np.log10(errors) - low) / (high - low) - 1e-6 * np.argsort(np.argsort(times))
    across = (np.log10(times) - left) / (right - left)
    for name, x, y, height in zip(names, across, heights, spread(heights, NAME_HEIGHT), strict=True):
        axes.plot([x, _NAMES - 0.005], [y, height], transform=axes.transAxes, color="#c4c4c4", lw=0.6, zorder=1,
                  clip_on=False)  # fmt: skip
        axes.text(_NAMES, height, name, transform=axes.transAxes, size=SMALL, va="center", color=INK, zorder=1)
