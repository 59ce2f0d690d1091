"""Tangential-force diagram: torque of gas, pistons, rods and load, stored work, and crank speed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from laufruhe.extensions.flywheel.section import has_curves
from laufruhe.extensions.flywheel.torque import TorqueFacts, swing_of, torque_facts, torque_parts
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.torque import excess_torque, turning_inertia
from laufruhe.plots.style import (
    BLUE,
    GREEN,
    INDIGO,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILION,
    Series,
    entry,
    finish_page,
    page,
    series_of,
    styled,
)
from laufruhe.plots.words import FAINT, INK, SMALL, in_thousands, round_ticks
from laufruhe.present.numbers import RPM, number
from laufruhe.solvers.result import Result

Unit: TypeAlias = tuple[float, str]
STEPS, MAX_ORDERS = 1440, 12
WIDE, HIGH = 6.8, 1.65
COLOURS = {
    "gas": ORANGE, "pistons": SKY, "rods": GREEN, "all": INK, "load": PURPLE, "weights": VERMILION, "friction": INDIGO,
    "machines": BLUE,
}  # fmt: skip
applies = has_curves
# smallest drawn part, and smallest drawn order, relative to the largest
MIN_PART, MIN_ORDER = 1e-3, 1e-2
_MEAN: Any = {"color": FAINT, "linewidth": 1.0, "linestyle": (0, (4, 1.6)), "zorder": 1.5}


@styled()
def figure(result: Result) -> Figure:
    """Draw the crank torque of gas, pistons and rods, its work about the mean, its orders, and the crank speed."""
    engine, fidelity = result.final.engine, result.problem.fidelity
    facts = [torque_facts(engine, point, fidelity) for point in result.problem.points]
    points = result.problem.points
    fired = [j for j, point in enumerate(points) if fidelity.gas_of(point) is not None]
    k = max(fired or range(len(facts)), key=lambda j: facts[j].excursion)
    parts = torque_parts(engine, points[k], fidelity)
    largest = max(float(np.abs(part.sample(STEPS)).max()) for part in parts.values()) or 1.0
    visible = {name: part for name, part in parts.items() if np.abs(part.sample(STEPS)).max() > MIN_PART * largest}
    degrees = np.linspace(0.0, math.degrees(engine.cycle.angle), STEPS + 1)
    has_speed, turning = facts[k].irregularity is not None, list[Series]()
    drawn = page(3 + has_speed, 1, (WIDE, HIGH), gap=0.3, lead=0.0)
    # room for the label above the last panel
    box, high = drawn.panels[-1].get_position(), drawn.size[1]
    drawn.panels[-1].set_position((box.x0, box.y0 - 0.5 / high, box.width, box.height))
    unit = in_thousands(largest, "N m")
    _torque(drawn.panels[0], visible, degrees, facts[k].mean, unit)
    _work(drawn.panels[1], excess_torque(engine, points[k], fidelity), degrees, facts[k])
    if has_speed:
        turning = _speed(drawn.panels[2], result, k, degrees)
    for axes in drawn.panels[:-1]:
        axes.set(xlim=(0.0, degrees[-1]))
        axes.xaxis.set_major_locator(MultipleLocator(90.0))
        axes.tick_params(labelbottom=axes is drawn.panels[-2], length=2)
        round_ticks(axes.yaxis, 4)
    drawn.panels[-2].set_xlabel("crank angle [°]")
    _orders(drawn.panels[-1], visible, unit)
    radii = {part.crank_radius for part in engine.slider_cranks}
    radius = f"; over {1e3 * min(radii):.4g} mm, the tangential force" if len(radii) == 1 else ""
    lines = f"Torque on the crankshaft at {points[k].name}{radius}."
    # weights, a load and electric machines are no part of the torque of all pistons
    labels = {"all": "gas and pistons"} if {"weights", "load", "machines"} & visible.keys() else {}
    legend = [
        entry(labels.get(name, name), color=COLOURS[name], linewidth=2.6 - 1.2 * (name == "all")) for name in visible
    ]
    legend.append(entry(f"mean, {number(facts[k].mean, scale=largest)} N m", **_MEAN))
    legend += [entry(f"speed {item.name}", color=item.colour, linewidth=1.8) for item in turning]
    return finish_page(drawn, result, "Torque over one working cycle", lines, legend)


def _torque(axes: Axes, parts: Mapping[str, Spectrum], degrees: Array, mean: float, unit: Unit) -> None:
    factor = unit[0]
    for name, part in parts.items():
        width = 1.4 if name == "all" else 2.6
        axes.plot(degrees, factor * part.values(np.radians(degrees)), color=COLOURS[name], linewidth=width)
    axes.axhline(factor * mean, **_MEAN)
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.set_ylabel(f"torque [{unit[1]}]")


def _work(axes: Axes, torque: Spectrum, degrees: Array, facts: TorqueFacts) -> None:
    work = torque.integral.values(np.radians(degrees))
    work = work - work.min()
    factor, unit = in_thousands(facts.excursion, "J")
    axes.fill_between(degrees, 0.0, factor * work, color=PALE, linewidth=0)
    axes.plot(degrees, factor * work, color=INK, linewidth=1.4)
    axes.set(ylim=(0.0, 1.3 * factor * facts.excursion or 1.0), ylabel=f"work stored [{unit}]")
    axes.text(
        0.99, 0.94, f"at most {number(factor * facts.excursion)} {unit}", ha="right", va="top", size=SMALL,
        transform=axes.transAxes, color=INK,
    )  # fmt: skip


def _speed(axes: Axes, result: Result, k: int, degrees: Array) -> list[Series]:
    """Draw the speed of every design that keeps turning, and return the drawn series."""
    point, fidelity = result.problem.points[k], result.problem.fidelity
    text, drawn = "", []
    for item in series_of(result):
        inertia = turning_inertia(item.design.engine, fidelity)
        swing = swing_of(item.design.engine, point, fidelity)
        degree = swing.irregularity(inertia or 0.0)
        if inertia is None or (degree > 1.0 and item.design is not result.final):
            continue
        speeds = swing.speeds(inertia)[: len(swing.work)]
        angles = degrees[-1] * np.arange(len(speeds)) / len(speeds)
        axes.plot(angles, RPM * speeds, color=item.colour, linewidth=1.8)
        drawn.append(item)
        text = f"degree of irregularity {number(degree, 3)}" + (f" (1/{1.0 / degree:.4g})" if degree > 0.0 else "")
    axes.axhline(RPM * point.speed, **_MEAN)
    axes.set_ylabel("speed [rpm]")
    axes.margins(y=0.25)
    axes.text(0.99, 0.94, text, ha="right", va="top", size=SMALL, transform=axes.transAxes, color=INK)
    return drawn


def _orders(axes: Axes, parts: Mapping[str, Spectrum], unit: Unit) -> None:
    """Draw amplitudes of the strongest orders side by side."""
    factor, total = unit[0], parts.get("all", next(iter(parts.values())))
    orders, sizes = total.orders[1:], np.abs(total.coefficients[1:])
    top = float(sizes.max(initial=0.0))
    chosen = sorted(k for k in np.argsort(-sizes, kind="stable")[:MAX_ORDERS].tolist() if sizes[k] > MIN_ORDER * top)
    # drop parts without a visible bar
    parts = {
        name: part
        for name, part in parts.items()
        if max((abs(complex(part.at(float(orders[k])))) for k in chosen), default=0.0) > MIN_ORDER * top
    }
    width = 0.8 / max(len(parts), 1)
    for j, (name, part) in enumerate(parts.items()):
        heights = [factor * abs(complex(part.at(float(orders[k])))) for k in chosen]
        axes.bar(np.arange(len(chosen)) + (j + 0.5) * width - 0.4, heights, width, color=COLOURS[name])
    axes.set_xticks(range(len(chosen)), [f"{orders[k]:g}" for k in chosen])
    axes.set(xlabel="order of crank speed", ylabel=f"amplitude [{unit[1]}]")
    axes.grid(axis="x", visible=False)
