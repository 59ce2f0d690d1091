"""The firings of a cycle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.plots.style import AFTER, BEFORE, PALE, WIDEST, finish_page, page, styled
from laufruhe.plots.words import SMALL, ink_on, width_of
from laufruhe.present.measures import has_firing, has_ranking, ranking_of
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import RankedOrder

MAX_ORDERS = 6
# two shades distinguish neighbouring firings
BEST, NEXT = (AFTER, PALE), (BEFORE, "#d4d4d4")
applies = has_ranking


@styled()
def figure(result: Result) -> Figure:
    """Draw firing orders as bars over one working cycle, a segment between two firings."""
    ranking = ranking_of(result).ranking
    orders = [(0, order) for order in ranking[0].firing_orders][: MAX_ORDERS // 2 + 1]
    orders += [(k, star.firing_orders[0]) for k, star in enumerate(ranking) if k and star.firing_orders]
    orders = orders[:MAX_ORDERS]
    count = len(orders[0][1].order)
    cycle = math.degrees(sum(orders[0][1].intervals))
    uneven = any(max(o.intervals) - min(o.intervals) > 1e-6 for _, o in orders)
    width = min(max(6.0, count * (0.5 if uneven else 0.4)), WIDEST - 1.4)
    drawn = page(1, 1, (width, 0.1 + (0.52 if uneven else 0.42) * len(orders)))
    axes = drawn.panels[0]
    for row, (k, order) in enumerate(orders):
        _bar(axes, row, order, uneven, BEST if k == 0 else NEXT)
    axes.set_yticks([-row for row in range(len(orders))], [f"star {k + 1}" for k, _ in orders])
    axes.set(xlim=(0.0, cycle), ylim=(0.5 - len(orders), 0.5), xlabel="crank angle [°]")
    axes.set_xticks(np.linspace(0.0, cycle, 9 if cycle > 400 else 5))
    axes.grid(axis="y", visible=False)
    legend = [Patch(color=BEST[0], label="best star"), Patch(color=NEXT[0], label="next in the ranking")]
    intervals = ", in degrees." if uneven else f", {cycle / count:g}° for all."
    fires, dead_centres = ("Firing orders", "Cylinder that fires"), ("Orders of dead centres", "Piston at the head end")
    title, who = fires if has_firing(result) else dead_centres
    lines = f"{who}, and the crank angle to the next{intervals}"
    return finish_page(drawn, result, title, lines, legend[: 1 + any(k for k, _ in orders)])


def _bar(axes: Axes, row: int, order: RankedOrder, uneven: bool, shades: tuple[str, str]) -> None:
    start, count = 0.0, len(order.order)
    letters = axes.bbox.width / axes.figure.dpi / count
    for k, (cylinder, interval) in enumerate(zip(order.order, order.intervals, strict=True)):
        width = math.degrees(interval)
        shade = shades[k % 2]
        axes.barh(-row, width, 0.78, left=start, color=shade, edgecolor="white", linewidth=1.0)
        words: Any = {"ha": "center", "va": "center", "color": ink_on(shade), "size": SMALL}
        text = f"{width:.1f}" if uneven else ""
        if width_of(text) > letters - 0.04:
            text = f"{width:.0f}"
        up = 0.19 if text else 0.0
        axes.text(start + 0.5 * width, up - row, f"{cylinder}", weight="bold", **words)
        if text:
            axes.text(start + 0.5 * width, -up - row, text, **words)
        start += width
