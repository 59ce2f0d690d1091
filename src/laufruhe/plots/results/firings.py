"""The firings of a cycle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.plots.style import AFTER, BEFORE, headed, page, styled
from laufruhe.present.measures import has_ranking, ranking_of
from laufruhe.solvers.ranking import PhasingResult, RankedOrder
from laufruhe.solvers.result import Result

SHOWN = 6
applies = has_ranking


@styled()
def figure(result: Result) -> Figure:
    """Firing orders as bars over one working cycle, a segment from each firing to the next."""
    shown = _shown(ranking_of(result))
    count = len(shown[0][1].order)
    cycle = math.degrees(sum(shown[0][1].intervals))
    drawn = page(1, 1, (min(max(6.4, 0.42 * count * 1.3), 13.0), 0.3 + 0.52 * len(shown)))
    axes = drawn.panels[0]
    for row, (k, order) in enumerate(shown):
        _bar(axes, row, order, cycle / count, AFTER if k == 0 else BEFORE)
    axes.set_yticks([-row for row in range(len(shown))], [f"star {k + 1}" for k, _ in shown])
    axes.set(xlim=(0.0, cycle), ylim=(0.5 - len(shown), 0.5), xlabel="crank angle [deg]")
    axes.set_xticks(np.linspace(0.0, cycle, 9 if cycle > 400 else 5))
    axes.grid(axis="y", visible=False)
    legend = [Patch(color=AFTER, label="best star"), Patch(color=BEFORE, label="next in the ranking")]
    uneven = any(max(o.intervals) - min(o.intervals) > 1e-6 for _, o in shown)
    intervals = " [deg]." if uneven else f", {cycle / count:g} deg for all."
    lines = f"Cylinder that fires, and the crank angle to the next firing{intervals}"
    return headed(drawn, result, "Firing orders", lines, legend[: 1 + any(k for k, _ in shown)])


def _shown(phasing: PhasingResult) -> list[tuple[int, RankedOrder]]:
    """Several orders of the best star, one of each other, with the rank of the star."""
    own = [(0, order) for order in phasing.ranking[0].firing_orders][: SHOWN // 2 + 1]
    others = [
        (k, order) for k, star in enumerate(phasing.ranking) for order in star.firing_orders
        if k and order == star.firing_orders[0]
    ]  # fmt: skip
    return (own + others)[:SHOWN]


def _bar(axes: Axes, row: int, order: RankedOrder, even: float, shade: str) -> None:
    start = 0.0
    words: Any = {"ha": "center", "va": "center", "color": "white"}
    for k, (cylinder, interval) in enumerate(zip(order.order, order.intervals, strict=True)):
        width = math.degrees(interval)
        strong = 0.85 if len(order.order) % 2 == 0 and k % 2 == 0 else 0.6
        axes.barh(-row, width, 0.62, left=start, color=shade, alpha=strong, edgecolor="white", linewidth=1.0)
        uneven = abs(width - even) > 1e-6 * even
        axes.text(start + 0.5 * width, 0.1 * uneven - row, str(cylinder), size=8.5, **words)
        if uneven:
            axes.text(start + 0.5 * width, -row - 0.17, f"{width:.1f}", size=6, **words)
        start += width
