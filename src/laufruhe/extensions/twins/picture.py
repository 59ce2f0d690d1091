"""Firings of a twin, and the parts of its first and second order that turn forward and backward."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.extensions.twins.turning import KINDS, ORDERS, Parts, is_twin, parts_of
from laufruhe.machine.crank_names import name_of_crank
from laufruhe.plots.style import BLUE, VERMILION, entry, finish_page, page, point_name, styled
from laufruhe.plots.words import FAINT, INK, SMALL, UNSEEN, in_thousands
from laufruhe.present.measures import firing_words, hardest_point
from laufruhe.present.numbers import number
from laufruhe.solvers.result import Result

FORWARD, BACKWARD = BLUE, VERMILION
TURN = np.linspace(0.0, math.tau, 361)
SIZE = 1.9

applies = is_twin


@styled()
def figure(result: Result) -> Figure:
    """Draw firings over the cycle, and force and couple of each order as two circles and the path of their sum."""
    engine, k = result.final.engine, hardest_point(result)
    drawn = page(2, 3, (SIZE, SIZE), gap=0.7, lead=0.3, across=0.72)
    _firings(drawn.panels[0], result)
    parts, initial = parts_of(result, engine, k), parts_of(result, result.initial.engine, k)
    maximum = max(_sizes(parts_of_design, kind) for parts_of_design in (parts, initial) for kind in KINDS)
    parts, initial = _visible(parts, maximum), _visible(initial, maximum)
    largest = {kind: max(_sizes(parts, kind), _sizes(initial, kind)) for kind in KINDS}
    _bars(drawn.panels[3], parts, largest)
    for row, kind in enumerate(KINDS):
        for column, (order, order_name) in enumerate(ORDERS.items()):
            axes = drawn.panels[3 * row + 1 + column]
            _circles(axes, *parts[kind, order], largest[kind], KINDS[kind][1])
            axes.set_title(f"{order_name} {kind}", loc="left", size=9)
    legend = [
        entry("turns with the crank", color=FORWARD, linewidth=1.4),
        entry("turns against it", color=BACKWARD, linewidth=1.4, linestyle=(0, (4, 1.6))),
        entry("sum", color=INK, linewidth=2.0),
    ]
    is_one_bank = len({part.bank for part in engine.slider_cranks}) == 1
    name = name_of_crank([part.throw for part in engine.slider_cranks]) if is_one_bank else ""
    lines = f"At {point_name(result, k)}, seen from the front{f'; crank {name}' if name else ''}."
    title = f"{firing_words(result)[0].capitalize()}, and forward and backward loads"
    return finish_page(drawn, result, title, lines, legend)


def _sizes(parts: Parts, kind: str) -> float:
    return max(
        abs(forward) + abs(backward) for (part_kind, _), (forward, backward) in parts.items() if part_kind == kind
    )


def _visible(parts: Parts, maximum: float) -> Parts:
    return {
        key: (ahead * (abs(ahead) > UNSEEN * maximum), back * (abs(back) > UNSEEN * maximum))
        for key, (ahead, back) in parts.items()
    }


def _firings(axes: Axes, result: Result) -> None:
    """Draw the firings of a cycle, and the angles between them."""
    engine = result.final.engine
    cycle = math.degrees(engine.cycle.angle)
    firings = sorted((math.degrees(part.firing_angle) % cycle, part.name.split()[-1]) for part in engine.cylinders)
    for (angle, name), (following, _) in zip(firings, [*firings[1:], (firings[0][0] + cycle, "")], strict=True):
        axes.plot([angle, angle], [0.0, 1.0], color=INK, linewidth=5.0, solid_capstyle="butt")
        axes.text(angle, 1.1, name, ha="center", size=SMALL)
        middle = 0.5 * (angle + following)
        axes.text(middle % cycle, 0.5, f"{following - angle:.3g}°", ha="center", va="center", size=SMALL, color=FAINT)
    axes.set(xlim=(-0.06 * cycle, 1.06 * cycle), ylim=(0.0, 1.6), xlabel="crank angle [°]", yticks=[])
    axes.set_xticks(np.linspace(0.0, cycle, 5))
    axes.set_title(firing_words(result)[0], loc="left", size=9)


def _circles(axes: Axes, forward: complex, backward: complex, largest: float, unit: str) -> None:
    factor, name = in_thousands(largest, unit)
    ahead, against = forward * np.exp(1j * TURN), backward * np.exp(-1j * TURN)
    styles: list[tuple[Any, dict[str, Any]]] = [
        (ahead, {"color": FORWARD, "linewidth": 1.2}),
        (against, {"color": BACKWARD, "linewidth": 1.2, "linestyle": (0, (4, 1.6))}),
        (ahead + against, {"color": INK, "linewidth": 2.0}),
    ]
    for path, style in styles:
        axes.plot(factor * path.imag, factor * path.real, **style)
    axes.plot(factor * (forward + backward).imag, factor * (forward + backward).real, "o", color=INK, markersize=5)
    reach = 1.1 * factor * (largest or 1.0)
    across, up = ("about y", "about z") if unit == "N m" else ("lateral", "vertical")
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel=f"{across} [{name}]")
    axes.set_ylabel(f"{up} [{name}]")
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)


def _bars(axes: Axes, parts: Parts, largest: Mapping[str, float]) -> None:
    """Draw forward and backward parts, forces and couples each relative to the largest of its kind."""
    names = []
    for row, ((kind, order), pair) in enumerate(parts.items()):
        maximum, (factor, unit) = largest[kind] or 1.0, in_thousands(largest[kind], KINDS[kind][1])
        for j, (part, colour) in enumerate(zip(pair, (FORWARD, BACKWARD), strict=True)):
            height = -row - 0.36 * j
            axes.barh(height, abs(part) / maximum, 0.32, color=colour)
            size = number(factor * abs(part), 3, scale=factor * maximum)
            axes.text(abs(part) / maximum + 0.03, height, f"{size} {unit}", va="center", size=SMALL)
        names.append(f"{ORDERS[order]}\n{kind}")
    axes.set_yticks([-row - 0.18 for row in range(len(parts))], names)
    axes.set(xlim=(0.0, 1.75), xticks=[])
    axes.grid(visible=False)
    axes.set_title("forward and backward part", loc="left", size=9)
