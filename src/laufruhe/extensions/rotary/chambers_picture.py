"""Chambers of a rotary engine over the three turns in which each works once: volume, pressure and torque (Y3, Y4)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from laufruhe.extensions.rotary.chambers import rotor_chambers, rotors_of
from laufruhe.plots.style import GREEN, ORANGE, SKY, entry, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, align_labels
from laufruhe.present.measures import hardest_point
from laufruhe.solvers.result import Result

STEPS, COLOURS = 2161, (ORANGE, SKY, GREEN)
WIDE, HIGH = 6.8, 1.65


def applies(result: Result) -> bool:
    """Return True for an engine with rotors and operating points."""
    return bool(rotors_of(result.final.engine)) and bool(result.problem.points)


@styled()
def figure(result: Result) -> Figure:
    """Draw volume, pressure and torque of each chamber of rotor 1, and their total torque."""
    part, point = rotors_of(result.final.engine)[0], result.problem.points[hardest_point(result)]
    angles, values = rotor_chambers(result.problem, part, point, STEPS)
    degrees = np.degrees(angles)
    drawn = page(len(values), 1, (WIDE, HIGH), gap=0.35)
    for axes, factor, of_chambers in zip(drawn.panels, (1e6, 1e-5, 1.0), values, strict=False):
        for row, colour in zip(of_chambers, COLOURS, strict=False):
            axes.plot(degrees, factor * row, color=colour, linewidth=1.2)
    has_gas = len(values) > 1
    if has_gas:
        drawn.panels[2].plot(degrees, values[2].sum(axis=0), color=INK, linewidth=1.6)
    words = ("volume above\nminimum [cm³]", "gauge\npressure [bar]", "torque [N m]")
    for axes, label in zip(drawn.panels, words, strict=False):
        axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
        axes.set(xlim=(0.0, degrees[-1]), ylabel=label)
        axes.xaxis.set_major_locator(MultipleLocator(180.0))
        axes.tick_params(labelbottom=axes is drawn.panels[-1], length=2)
    align_labels(drawn.panels)
    drawn.panels[-1].set_xlabel("angle of the eccentric shaft [°]")
    legend = [entry(f"chamber {k + 1}", color=colour, linewidth=2.0) for k, colour in enumerate(COLOURS)]
    legend += [entry("all", color=INK, linewidth=2.0)] if has_gas else []
    lines = f"{part.name[:1].upper()}{part.name[1:]} at {point.name}; the chambers fire one turn after another."
    return finish_page(drawn, result, "Chambers of a rotor", lines, legend)
