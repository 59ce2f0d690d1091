"""Crank stars in end and side view, and the firings of a cycle (C3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from laufruhe.plots.style import AFTER, BEFORE, FAINT, INK, heading, page, source_line
from laufruhe.present.numbers import number
from laufruhe.solvers.ranking import PhasingResult, RankedStar
from laufruhe.solvers.result import Result

SHOWN = 3
FIRINGS_SHOWN = 6
SAME = math.radians(1.0)


def figure(result: Result) -> Figure:
    """The best stars: end view from the front, side view with every throw at its height."""
    phasing = _details(result)
    stars = phasing.ranking[:SHOWN]
    side = min(max(4.0, 0.5 * len(phasing.places)), 6.0)
    drawn = page(len(stars), 2, (side, 2.4), lead=0.3, gap=0.3)
    for k, star in enumerate(stars):
        end, along = drawn.panels[2 * k], drawn.panels[2 * k + 1]
        colour = AFTER if k == 0 else BEFORE
        _end_view(end, star, colour)
        _side_view(along, star, phasing.places, colour)
        end.set_title(_title(result, star, k), loc="left", size=9.5, parse_math=False)
        along.set_title(_balance(star), loc="left", size=8, color=FAINT, parse_math=False)
    legend = [
        Line2D([], [], color=AFTER, marker="o", label="best star"),
        Line2D([], [], color=BEFORE, marker="o", label="next in the ranking"),
    ]
    lines = "From the front, turning clockwise; and from the left: full pins point to you, crossed ones away."
    heading(drawn.figure, "Crank stars", lines, legend[: min(len(stars), 2)], source_line(result))
    return drawn.figure


def _details(result: Result) -> PhasingResult:
    if result.phasing is None:
        raise ValueError("a result without phasing has no star")
    return result.phasing


def _title(result: Result, star: RankedStar, k: int) -> str:
    unit = result.objective.unit if result.objective else ""
    scale = result.objective.initial if result.objective else 0.0
    built = f", with {', '.join(star.shafts)}" if star.shafts else ""
    return f"{k + 1}. {number(star.value, scale=scale)} {unit}{built}"


def _balance(star: RankedStar) -> str:
    shown = ", ".join(
        f"{h}: {number(force, 2, 1.0)} / {number(couple, 2, 1.0)}"
        for h, force, couple in zip(star.orders, star.forces, star.couples, strict=True)
    )
    return f"free force / couple of order {shown}"


def _end_view(axes: Axes, star: RankedStar, colour: str) -> None:
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(xlim=(-1.75, 1.75), ylim=(-1.4, 1.4))
    axes.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=FAINT, linewidth=0.7, linestyle=(0, (2, 3))))
    axes.add_patch(Circle((0, 0), 0.1, facecolor=INK, edgecolor="none", zorder=4))
    for angle, throws in _together(star.throws):
        y, z = math.sin(angle), math.cos(angle)
        axes.plot([0, y], [0, z], color=colour, linewidth=2.4, solid_capstyle="round", zorder=2)
        axes.add_patch(Circle((y, z), 0.1, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=3))
        text = ", ".join(str(k + 1) for k in throws)
        reach = 1.28 + 0.05 * abs(y) * max(len(text) - 1, 0)
        axes.text(reach * y, 1.24 * z, text, ha="center", va="center", size=8.5, color=INK)


def _together(throws: Sequence[float]) -> list[tuple[float, list[int]]]:
    """Throws that stand on one angle, to a degree."""
    out: list[tuple[float, list[int]]] = []
    for k, angle in enumerate(throws):
        for other, members in out:
            if abs(math.remainder(angle - other, math.tau)) < SAME:
                members.append(k)
                break
        else:
            out.append((angle, [k]))
    return out


def _side_view(axes: Axes, star: RankedStar, places: Sequence[float], colour: str) -> None:
    """Main journals on the axis, webs and pins at the height z = cos theta; a pin that points away is open."""
    axes.axis("off")
    count = len(places)
    x = np.arange(count, dtype=float)
    axes.set(xlim=(-0.9, count - 0.1), ylim=(-1.4, 1.4))
    axes.axhline(0.0, color=FAINT, linewidth=0.6, linestyle=(0, (6, 2, 1, 2)))
    line = [(-0.75, 0.0)]
    for k, angle in enumerate(star.throws):
        height = math.cos(angle)
        line += [(x[k] - 0.28, 0.0), (x[k] - 0.28, height), (x[k] + 0.28, height), (x[k] + 0.28, 0.0)]
    line.append((count - 0.25, 0.0))
    axes.plot(*zip(*line, strict=True), color=colour, linewidth=2.2, solid_joinstyle="round")
    for k, angle in enumerate(star.throws):
        height, depth = math.cos(angle), math.sin(angle)
        towards = abs(depth) > 1e-6 and depth > 0.0
        away = abs(depth) > 1e-6 and depth < 0.0
        face = colour if towards else "white"
        axes.plot(x[k], height, "o", markersize=6.5, markerfacecolor=face, markeredgecolor=colour, zorder=3)
        if away:
            axes.plot(x[k], height, "x", markersize=3.6, color=colour, zorder=4)
        beside = 1.0 if height >= -1e-9 else -1.0
        axes.text(x[k], height + 0.24 * beside, str(k + 1), ha="center", va="center", size=8, color=INK)


def firings(result: Result) -> Figure:
    """Firing orders as bars over one working cycle, a segment from each firing to the next."""
    phasing = _details(result)
    rows = [(k, order) for k, star in enumerate(phasing.ranking) for order in star.firing_orders]
    own = [row for row in rows if row[0] == 0][: FIRINGS_SHOWN // 2 + 1]
    shown = (own + [row for row in rows if row[0] != 0 and row[1] == phasing.ranking[row[0]].firing_orders[0]])[
        :FIRINGS_SHOWN
    ]
    cycle = math.degrees(sum(shown[0][1].intervals))
    wide = min(max(6.4, 0.42 * len(shown[0][1].order) * 1.3), 13.0)
    drawn = page(1, 1, (wide, 0.3 + 0.52 * len(shown)))
    axes = drawn.panels[0]
    for row, (k, order) in enumerate(shown):
        start, even = 0.0, cycle / len(order.order)
        for number_of, interval in zip(order.order, order.intervals, strict=True):
            width = math.degrees(interval)
            shade = AFTER if k == 0 else BEFORE
            strong = 0.85 if len(order.order) % 2 == 0 and order.order.index(number_of) % 2 == 0 else 0.6
            axes.barh(-row, width, 0.62, left=start, color=shade, alpha=strong, edgecolor="white", linewidth=1.0)
            uneven = abs(width - even) > 1e-6 * even
            lift = 0.1 if uneven else 0.0
            axes.text(
                start + 0.5 * width, lift - row, str(number_of), ha="center", va="center", size=8.5, color="white"
            )
            if uneven:
                axes.text(
                    start + 0.5 * width, -row - 0.17, f"{width:.1f}", ha="center", va="center", size=6, color="white"
                )
            start += width
    axes.set_yticks([-row for row in range(len(shown))], [f"star {k + 1}" for k, _ in shown])
    axes.set(xlim=(0.0, cycle), ylim=(0.5 - len(shown), 0.5), xlabel="crank angle [deg]")
    axes.set_xticks(np.linspace(0.0, cycle, 9 if cycle > 400 else 5))
    axes.grid(axis="y", visible=False)
    legend = [Patch(color=AFTER, label="best star"), Patch(color=BEFORE, label="next in the ranking")]
    uneven = any(max(o.intervals) - min(o.intervals) > 1e-6 for _, o in shown)
    lines = "Cylinder that fires, and the crank angle to the next firing" + (
        " [deg]." if uneven else f", {cycle / len(shown[0][1].order):g} deg for all."
    )
    heading(drawn.figure, "Firing orders", lines, legend[: 1 + any(k for k, _ in shown)], source_line(result))
    return drawn.figure


def trade(result: Result) -> Figure:
    """Objective against the largest deviation from even firing (Pareto)."""
    phasing = _details(result)
    drawn = page(1, 1, (6.4, 3.4))
    axes = drawn.panels[0]
    # more freedom that buys nothing is no new design
    pairs = zip((None, *phasing.trade), phasing.trade, strict=False)
    points = [p for before, p in pairs if before is None or p.value < before.value]
    x = [math.degrees(p.deviation) for p in points]
    y = [p.value for p in points]
    axes.plot(x, y, color=AFTER, linewidth=1.6, zorder=2)
    axes.plot(x, y, "o", color=AFTER, markersize=5, zorder=3)
    shown = [number(value, 3, max(y)) for value in y]
    for k, (deviation, value) in enumerate(zip(x, y, strict=True)):
        if k and shown[k] == shown[k - 1]:
            continue
        axes.annotate(
            shown[k],
            (deviation, value),
            xytext=(5, 6),
            textcoords="offset points",
            size=7.5,
            color=FAINT,
        )
    # what holds with more freedom holds with less: a step reaches back to the point before
    freedom = [math.degrees(p.allowed) for p in phasing.trade]
    bounds = [p.lower_bound for p in phasing.trade]
    axes.plot(freedom, bounds, color=BEFORE, linewidth=1.2, linestyle=(0, (4, 2)), drawstyle="steps-pre", zorder=1)
    name = result.objective.name if result.objective else ""
    unit = result.objective.unit if result.objective else ""
    axes.set(
        xlim=(-0.03 * freedom[-1], 1.08 * freedom[-1]),
        ylim=(-0.03 * max(*y, 1e-300), 1.15 * max(*y, 1e-300)),
        xlabel="largest deviation of a firing interval from even [deg]",
        ylabel=f"{name} [{unit}]" if len(name) < 42 else f"objective [{unit}]",
    )
    legend = [
        Line2D([], [], color=AFTER, marker="o", label="best local optimum found"),
        Line2D([], [], color=BEFORE, linestyle=(0, (4, 2)), label="proven: no design below"),
    ]
    lines = "What slightly uneven crank angles buy; each point is a design, evaluated by the exact model."
    heading(drawn.figure, "Balance against even firing", lines, legend, source_line(result))
    return drawn.figure
