"""Response over speed ranges with its limit, and orders against critical frequencies, coloured by amplitude."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.extensions.speed_ranges.peaks import Response
from laufruhe.extensions.speed_ranges.section import designs_of, has_ranges, responses_of
from laufruhe.plots.speed_axis import LIMIT, STYLES
from laufruhe.plots.style import AFTER, BEFORE, axis_end, entry, entry_of_dots, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import RPM
from laufruhe.problem.measure import Measure
from laufruhe.solvers.result import Result
from laufruhe.units import readable, usual_unit

applies = has_ranges
MAX_RANGES, MAX_NAMES, SPEEDS = 2, 8, 120
VISIBLE = 0.01
"""Share of the largest amplitude from which an order is drawn."""
COLOURS = "YlOrRd"


@styled()
def figure(result: Result) -> Figure:
    """Draw the response over each range with its limit, and below the frequencies of orders, coloured by amplitude."""
    details = responses_of(result)
    count = min(len(details.final), MAX_RANGES)
    drawn = page(2, count, (6.4 if count == 1 else 4.3, 2.5), gap=0.75, across=0.9)
    kinds: dict[str, Any] = {}
    for k, one in enumerate(details.final[:count]):
        designs = [(name, response) for name, response in designs_of(result) if response.span is one.span]
        _draw_response(drawn.panels[k], designs)
        kinds |= _draw_orders(drawn.panels[count + k], one)
    changed = is_changed(result)
    legend: list[Artist] = [entry("initial", color=BEFORE, linewidth=2.0)] if changed else []
    legend += [entry("final" if changed else "initial", color=AFTER, linewidth=2.0)]
    legend += [entry_of_dots("worst", color=INK, markersize=4.5)]
    limited = any(one.span.limit is not None for one in details.final)
    legend += [entry("limit", color=LIMIT, linewidth=1.6, linestyle=STYLES[1])] if limited else []
    legend += [entry(kind, **look) for kind, look in kinds.items()]
    text = (
        "Above: value at each speed. Below: frequency of each order over speed, dark where its amplitude at the "
        "receiver or mount is large, and critical frequencies."
    )
    note = "" if count == len(details.final) else f"{len(details.final) - count} more ranges are in the table. "
    return finish_page(drawn, result, "Over ranges of speed", text, legend, note)


def _draw_response(axes: Axes, designs: list[tuple[str, Response]]) -> None:
    one = designs[-1][1]
    unit, factor = readable(one.measure.unit, usual_unit(float(one.values.max()), one.measure.unit))
    tops = []
    for k, (_, response) in enumerate(designs):
        colour = AFTER if k == len(designs) - 1 else BEFORE
        axes.plot(RPM * response.speeds, factor * response.values, color=colour, linewidth=1.6)
        top = response.worst
        axes.plot(RPM * response.speeds[top], factor * response.values[top], "o", color=colour, markersize=4.5)
        tops.append(float(factor * response.values[top]))
    if one.span.limit is not None:
        axes.plot(RPM * one.speeds, factor * one.limits, color=LIMIT, linewidth=1.6, linestyle=STYLES[1])
        tops.append(float(factor * one.limits.max()))
    axes.set(xlim=(RPM * one.span.low, RPM * one.span.high), ylim=(0.0, 1.1 * axis_end(tops)))
    # the table has orders, places and weights of the measure
    name = Measure(one.measure.channel, one.measure.norm).name
    axes.set(xlabel="crank speed [rpm]", ylabel=f"{name} [{unit}]", title=one.span.name)


def _draw_orders(axes: Axes, one: Response) -> dict[str, Any]:
    """Draw the orders of a design over speed and critical frequencies; return the look of each kind of these."""
    speeds = np.linspace(one.span.low, one.span.high, SPEEDS)
    orders, amplitudes = one.amplitudes(speeds)
    largest = amplitudes.max(axis=0)
    top = axis_end([float(largest.max())])
    visible = (largest > VISIBLE * top) & (orders > 0.0)
    orders, amplitudes, largest = orders[visible], amplitudes[:, visible], largest[visible]
    scale = LogNorm(0.3 * VISIBLE * top, top, clip=True)
    reach = 1.08 * max((float(orders[k]) for k in np.argsort(-largest)[:MAX_NAMES]), default=1.0)
    reach *= one.span.high / math.tau
    for order, sizes in zip(orders.tolist(), amplitudes.T, strict=True):
        points = np.column_stack([RPM * speeds, order * speeds / math.tau])
        colours = 0.5 * (sizes[:-1] + sizes[1:])
        line = LineCollection(list(pairwise(points)), cmap=COLOURS, norm=scale, linewidths=2.2)
        line.set_array(colours)
        axes.add_collection(line)
        if points[-1, 1] <= reach:
            place = (1.01, points[-1, 1])
            axes.annotate(f"{order:g}", place, xycoords=("axes fraction", "data"), size=SMALL, va="center",
                          annotation_clip=False)  # fmt: skip
    lowest, kinds = 0.7 * float(orders.min(initial=1.0)) * one.span.low / math.tau, dict[str, Any]()
    for style, (kind, values) in zip((*STYLES, (0, (6, 2, 1, 2))), one.frequencies.items(), strict=False):
        for value in values:
            if lowest < value < reach:
                kinds[kind] = {"color": FAINT, "linestyle": style, "linewidth": 0.9}
                axes.axhline(value, zorder=1, **kinds[kind])
    axes.set(xlim=(RPM * one.span.low, RPM * one.span.high), yscale="log", ylim=(lowest, reach))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    axes.set(xlabel="crank speed [rpm]", ylabel="frequency [Hz]")
    return kinds
