"""Objective against the largest deviation from even firing (Pareto)."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.figure import Figure

from laufruhe.plots.style import AFTER, BEFORE, entry, finish_page, page, styled
from laufruhe.plots.words import FAINT, SMALL, label_of
from laufruhe.present.measures import has_ranking, ranking_of
from laufruhe.present.numbers import number
from laufruhe.solvers.result import Result

HIGH = 3.4
_BOUND: Any = {"color": BEFORE, "linestyle": (0, (4, 2))}


def applies(result: Result) -> bool:
    """Return True for a trade between even firing and balance."""
    return has_ranking(result) and len(ranking_of(result).trade) > 1


@styled()
def figure(result: Result) -> Figure:
    """Draw the objective over the allowed deviation from even firing, with its lower bound."""
    trade = ranking_of(result).trade
    drawn = page(1, 1, (6.4, HIGH))
    axes = drawn.panels[0]
    # skip points without improvement
    points = [p for before, p in zip((None, *trade), trade, strict=False) if before is None or p.value < before.value]
    x = [math.degrees(p.deviation) for p in points]
    y = [p.value for p in points]
    axes.plot(x, y, color=AFTER, linewidth=1.6, zorder=2)
    axes.plot(x, y, "o", color=AFTER, markersize=5, zorder=3)
    texts = [number(value, 3, max(y)) for value in y]
    for k, place in enumerate(zip(x, y, strict=True)):
        if k == 0 or texts[k] != texts[k - 1]:
            axes.annotate(texts[k], place, xytext=(5, 6), textcoords="offset points", size=SMALL, color=FAINT)
    # a bound for a larger deviation holds for smaller ones, so its step extends to the point before
    freedom = [math.degrees(p.allowed) for p in trade]
    axes.plot(freedom, [p.lower_bound for p in trade], linewidth=1.2, drawstyle="steps-pre", zorder=1, **_BOUND)
    name, unit = (result.objective.name, result.objective.unit) if result.objective else ("", "")
    top = max(*y, 1e-300)
    axes.set(
        xlim=(-0.03 * freedom[-1], 1.08 * freedom[-1]), ylim=(-0.03 * top, 1.15 * top),
        xlabel="largest deviation of a firing interval from even [°]",
        ylabel=label_of(name, unit, HIGH),
    )  # fmt: skip
    legend = [entry("best local optimum found", color=AFTER, marker="o"), entry("lower bound", **_BOUND)]
    lines = "Each point is the best design found for its deviation, evaluated by the exact model."
    return finish_page(drawn, result, "Balance against even firing", lines, legend)
