"""Indicator diagrams of steam cylinders and pumps, and the force on each rod (Roetscher, Figs. 1051 to 1065)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.extensions.chambers.diagram import indicator_of, points_with_chambers
from laufruhe.extensions.chambers.gas import Chambers
from laufruhe.machine import OperatingPoint, SliderCrank
from laufruhe.machine.gas.charge import dead_centres
from laufruhe.plots.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, entry, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK
from laufruhe.solvers.result import Result

STEPS, MAX_ROWS = 1440, 6
WIDE, HIGH = 3.6, 2.2
COLOURS = (ORANGE, BLUE, GREEN, PURPLE, VERMILION, SKY)
BAR, KILO = 1e-5, 1e-3


def applies(result: Result) -> bool:
    """Return True if a load has chambers."""
    return bool(points_with_chambers(result))


@styled()
def figure(result: Result) -> Figure:
    """Draw the indicator diagrams of a cylinder on the left and the force on its rod on the right."""
    point, gas = points_with_chambers(result)[0]
    parts = [part for part in result.final.engine.slider_cranks if gas.of(part)][:MAX_ROWS]
    # names of chambers stand above their diagram, two a row
    lead = 0.12 + 0.17 * max(-(-len(gas.of(part)) // 2) for part in parts)
    drawn = page(len(parts), 2, (WIDE, HIGH), gap=0.3, lead=lead, across=0.75)
    for k, part in enumerate(parts):
        left, right = drawn.panels[2 * k], drawn.panels[2 * k + 1]
        drawn_part = indicator_of(gas, part, point, np.linspace(0.0, math.tau, STEPS + 1))
        for j, (name, pressure) in enumerate(drawn_part.pressures.items()):
            left.plot(drawn_part.travel, BAR * pressure, color=COLOURS[j % len(COLOURS)], linewidth=1.2, label=name)
        left.set_ylim(bottom=0.0)
        left.legend(
            frameon=False, handlelength=1.2, borderpad=0.0, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2
        )
        _force(right, gas, part, point)
        for axes in (left, right):
            axes.set(
                xlim=(0.0, 1.0), ylabel=f"{part.name}\npressure [bar]" if axes is left else "force on the rod [kN]"
            )
            axes.set_xlabel("part of the stroke from the head end" if part is parts[-1] else "")
    lines = "Left: absolute pressure in every chamber. Right: force towards the crank, on the way out and back."
    legend = [entry("force of the chambers", color=INK, linewidth=1.4)]
    legend += [entry("force that accelerates the rod", color=FAINT, linestyle=(0, (4, 1.6)))]
    return finish_page(drawn, result, f"Indicator diagrams at {point.name}", lines, legend)


def _force(axes: Axes, gas: Chambers, part: SliderCrank, point: OperatingPoint) -> None:
    top, bottom = dead_centres(part)
    for begin, end in ((top, bottom), (bottom, top + math.tau)):
        drawn = indicator_of(gas, part, point, np.linspace(begin, end, STEPS // 2 + 1)[1:-1])
        axes.plot(drawn.travel, KILO * drawn.force, color=INK, linewidth=1.4)
        axes.plot(drawn.travel, KILO * drawn.needed, color=FAINT, linewidth=1.0, linestyle=(0, (4, 1.6)))
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
