"""Transmissibility of elastic mounts over speed (Hasselgruber, Fig. 31)."""

from __future__ import annotations

import math

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.plots.speed_axis import LIMIT, STYLES, limits_on, mark_points, order_entries
from laufruhe.plots.style import entry, finish_page, page, series_of, styled
from laufruhe.plots.words import FAINT, INK
from laufruhe.present.curves import highest_speed, transmissibility_of, transmissibility_speeds
from laufruhe.present.measures import hardest_point
from laufruhe.present.mounting import facts_of, is_elastic
from laufruhe.present.numbers import RPM
from laufruhe.problem import channels
from laufruhe.solvers.result import Result

applies = is_elastic
SMALLEST = 1e-4
"""Smallest transmissibility that is shown."""


@styled()
def figure(result: Result) -> Figure:
    """Draw transmissibility by order and speed, with limits and operating points."""
    facts, series = facts_of(result.final), series_of(result, loads=True)
    point, top = result.problem.points[hardest_point(result)], highest_speed(result)
    speeds = transmissibility_speeds(result)
    drawn = page(1, 1, (6.8, 4.0))
    axes = drawn.panels[0]
    highest, lowest = 1.0, 1e-2
    for item in series:
        for k, curve in transmissibility_of(item.design, point, speeds, facts.orders):
            highest = max(highest, float(curve.max(initial=0.0)))
            lowest = min(lowest, float(curve.min(initial=lowest)))
            axes.plot(speeds * RPM, curve, color=item.colour, linestyle=STYLES[k], linewidth=1.6)
    legend = [*(item.entry() for item in series), *order_entries(facts, INK), *_limits(axes, result, top * RPM)]
    axes.axhline(1.0, color=FAINT, linewidth=0.8)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(10.0, (1.0,) if lowest < 1e-2 else (1.0, 2.0, 5.0), numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.set(
        xlim=(0.0, top * RPM),
        ylim=(max(SMALLEST, 10.0 ** math.floor(math.log10(max(lowest, SMALLEST)))), 1.6 * highest),
        xlabel="crank speed [rpm]",
        ylabel="transmissibility",
    )
    mark_points(axes, result)
    lines = f"Ratio to the force on rigid mounts; loads of {point.name}."
    return finish_page(drawn, result, "Transmissibility over speed", lines, legend)


def _limits(axes: Axes, result: Result, top: float) -> list[Artist]:
    # a limit is drawn over the speeds [rpm] at which it holds
    limits = limits_on(result, channels.TRANSMISSIBILITY)
    lines = [(limit.maximum, limit.measure.points) for limit in limits]
    for maximum, point_names in lines:
        speeds = [
            point.speed * RPM for point in result.problem.points if point_names is None or point.name in point_names
        ]
        low, high = min(speeds), max(speeds)
        if high - low < 0.02 * top:
            low, high = low - 0.02 * top, high + 0.02 * top
        axes.plot([low, high], [maximum] * 2, color=LIMIT, linewidth=2.4, solid_capstyle="butt", zorder=4)
    return [entry("limit", color=LIMIT, linewidth=2.4)] if lines else []
