"""Orders of crank speed against natural frequencies (Campbell)."""

from __future__ import annotations

import math
from itertools import chain
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.plots.speed_axis import LIMIT, STYLES, limits_on, mark_points, order_entries
from laufruhe.plots.style import AFTER, BEFORE, entry, entry_of_dots, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, label_lines
from laufruhe.present.curves import highest_speed
from laufruhe.present.measures import is_changed
from laufruhe.present.mounting import MountingFacts, critical_speed, facts_of, is_elastic, stiffness_sentence
from laufruhe.present.numbers import RPM, number
from laufruhe.problem import channels
from laufruhe.solvers.result import Result

applies = is_elastic


@styled()
def figure(result: Result) -> Figure:
    """Draw frequencies of orders over crank speed, and natural frequencies: critical speeds are their intersections."""
    facts, top = facts_of(result.final), highest_speed(result)
    drawn = page(1, 1, (6.2, 4.2))
    axes = drawn.panels[0]
    limits = limits_on(result, channels.FREQUENCIES)
    bands = [limit.outside for limit in limits if limit.outside is not None]
    edges = [edge for limit in limits for edge in (limit.minimum, limit.maximum) if math.isfinite(edge)]
    reach = 1.1 * float(max(*facts.modes.frequencies, *facts.with_fluid, *edges, *chain(*bands), 1e-9))
    legend: list[Artist] = order_entries(facts, AFTER)
    legend.append(entry_of_dots("critical speed", color=AFTER, markersize=4.5))
    for band in bands:
        axes.axhspan(*band, color=LIMIT, alpha=0.13, linewidth=0)
    for edge in edges:
        axes.axhline(edge, color=LIMIT, linewidth=2.4, alpha=0.5, zorder=4)
    legend += [entry("limit", color=LIMIT, alpha=0.5, linewidth=2.4)] if edges else []
    forbidden = "band that must have no natural frequency"
    legend += [Patch(facecolor=LIMIT, alpha=0.13, label=forbidden)] if bands else []
    for k, order in enumerate(facts.orders):
        axes.plot([0.0, top * RPM], [0.0, order * top / math.tau], color=AFTER, linestyle=STYLES[k], linewidth=1.4)
    axes.set(xlim=(0.0, top * RPM), ylim=(0.0, reach), xlabel="crank speed [rpm]", ylabel="frequency [Hz]")
    _modes(axes, facts)
    mark_points(axes, result)
    fluid: Any = {"color": BEFORE, "linewidth": 1.0, "linestyle": ":"}
    for frequency in facts.with_fluid:
        axes.axhline(frequency, zorder=1.5, **fluid)
    legend += [entry("block and fluid together, undamped", **fluid)] if facts.with_fluid else []
    which = "of the final design" if is_changed(result) else "of the initial design"
    lines = f"Natural frequencies {which}, and the orders that excite each most.{stiffness_sentence(facts)}"
    return finish_page(drawn, result, "Critical speeds", lines, legend)


def _modes(axes: Axes, facts: MountingFacts) -> None:
    names = []
    for j, (name, frequency) in enumerate(zip(facts.modes.names, facts.modes.frequencies, strict=True)):
        excited = j in facts.excited
        look: Any = {"color": INK, "linewidth": 1.3} if excited else {"color": FAINT, "linewidth": 0.7, "alpha": 0.6}
        axes.axhline(frequency, **look)
        names.append(f"{name}, {number(frequency, 3)} Hz" + ("" if excited else " (not excited)"))
        for order in facts.orders if excited else ():
            axes.plot(critical_speed(frequency, order) * RPM, frequency, "o", color=AFTER, markersize=4.5, zorder=5)
    label_lines(axes, facts.modes.frequencies.tolist(), names)
