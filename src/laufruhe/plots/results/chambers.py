"""Chambers of a rotary engine over the three turns in which each works once: volume, pressure and torque (Y3, Y4)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from laufruhe.physics.cylinder_volume import chamber_volume
from laufruhe.physics.gas_cycle import thrust_at
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.plots.style import GREEN, ORANGE, SKY, entry, headed, page, styled
from laufruhe.plots.words import FAINT, INK, aligned
from laufruhe.present.measures import hardest_point
from laufruhe.solvers.result import Result

STEPS, COLOURS = 2161, (ORANGE, SKY, GREEN)
WIDE, HIGH = 6.8, 1.65


def applies(result: Result) -> bool:
    """Whether chambers of one rotor work one after the other."""
    parts = result.final.engine.slider_cranks
    return any(len(part.swept.lags) > 1 for part in parts) and bool(result.problem.points)


@styled()
def figure(result: Result) -> Figure:
    """Each chamber of rotor 1, and the torque that they make together."""
    engine, fidelity = result.final.engine, result.problem.fidelity
    part = next(part for part in engine.slider_cranks if len(part.swept.lags) > 1)
    point = result.problem.points[hardest_point(result)]
    gas, lags = fidelity.gas_of(point), part.swept.lags
    turns = math.tau * len(lags)
    degrees = np.linspace(0.0, math.degrees(turns), STEPS)
    drawn = page(1 if gas is None else 3, 1, (WIDE, HIGH), gap=0.35)
    whole = np.zeros(STEPS)
    for k, (lag, colour) in enumerate(zip(lags, COLOURS, strict=False)):
        since = np.mod(np.radians(degrees) - lag, turns)
        _line(drawn.panels[0], degrees, 1e6 * chamber_volume(part, since), colour)
        if gas is None:
            continue
        thrust = thrust_at(gas, part, engine.cycle, since) / part.piston_area
        _line(drawn.panels[1], degrees, -1e-5 * thrust, colour)
        torque = chamber_torque(gas, part, engine.cycle, since)
        whole += torque
        _line(drawn.panels[2], degrees, torque, colour)
        if k == len(lags) - 1:
            _line(drawn.panels[2], degrees, whole, INK)
    words = ("volume over\nthe least [cm³]", "pressure over\nthe crankcase [bar]", "torque [N m]")
    for axes, label in zip(drawn.panels, words, strict=False):
        axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
        axes.set(xlim=(0.0, degrees[-1]), ylabel=label)
        axes.xaxis.set_major_locator(MultipleLocator(180.0))
        axes.tick_params(labelbottom=axes is drawn.panels[-1], length=2)
    aligned(drawn.panels)
    drawn.panels[-1].set_xlabel("angle of the eccentric shaft [°]")
    legend = [entry(f"chamber {k + 1}", color=colour, linewidth=2.0) for k, colour in enumerate(COLOURS)]
    legend += [] if gas is None else [entry("all", color=INK, linewidth=2.0)]
    lines = f"{part.name[:1].upper()}{part.name[1:]} at {point.name}; each chamber fires a turn after the one before."
    return headed(drawn, result, "Chambers of a rotor", lines, legend)


def _line(axes: Axes, degrees: np.ndarray, values: np.ndarray, colour: str) -> None:
    axes.plot(degrees, values, color=colour, linewidth=1.6 if colour == INK else 1.2)
