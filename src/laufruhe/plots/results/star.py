"""Crank stars in end and side view (C3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from laufruhe.plots.style import AFTER, BEFORE, entry, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL
from laufruhe.present.measures import has_ranking, ranking_of
from laufruhe.present.numbers import figure as format_value
from laufruhe.present.numbers import number
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import RankedStar

MAX_STARS = 3
SAME = math.radians(1.0)
applies = has_ranking


@styled()
def figure(result: Result) -> Figure:
    """Draw the best crank stars: end view from the front, and side view with every throw at its height."""
    phasing = ranking_of(result)
    stars = phasing.ranking[:MAX_STARS]
    unit, scale = (result.objective.unit, result.objective.initial) if result.objective else ("", 0.0)
    side = min(max(4.0, 0.5 * len(phasing.places)), 4.7)
    drawn = page(len(stars), 2, (side, 2.1), lead=0.3, gap=0.1)
    for k, star in enumerate(stars):
        end, along = drawn.panels[2 * k], drawn.panels[2 * k + 1]
        colour = AFTER if k == 0 else BEFORE
        _end_view(end, star, colour)
        _side_view(along, star, phasing.places, colour)
        built = f", with {', '.join(star.shafts)}" if star.shafts else ""
        title = f"{k + 1}. {format_value(star.value, unit, scale=scale)}{built}"
        end.set_title(title, loc="left", size=10, parse_math=False)
        balance = ", ".join(
            f"{h}: {number(force, 2, 1.0)} / {number(couple, 2, 1.0)}"
            for h, force, couple in zip(star.orders, star.forces, star.couples, strict=True)
        )
        words = f"free force / couple of order {balance}"
        along.set_title(words, loc="left", size=SMALL, color=FAINT, parse_math=False)
    legend = [entry("best star", color=AFTER, marker="o"), entry("next in the ranking", color=BEFORE, marker="o")]
    lines = (
        "From the front, turning clockwise; and from the left: full pins point to you, crossed ones away. "
        "Free forces over that of one throw, couples over that times the spacing of throws."
    )
    return finish_page(drawn, result, "Crank stars", lines, legend[: min(len(stars), 2)])


def _end_view(axes: Axes, star: RankedStar, colour: str) -> None:
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(xlim=(-1.75, 1.75), ylim=(-1.4, 1.4))
    axes.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=FAINT, linewidth=0.7, linestyle=(0, (2, 3))))
    axes.add_patch(Circle((0, 0), 0.1, facecolor=INK, edgecolor="none", zorder=4))
    for angle, throws in _group_by_angle(star.throws):
        y, z = math.sin(angle), math.cos(angle)
        axes.plot([0, y], [0, z], color=colour, linewidth=2.4, solid_capstyle="round", zorder=2)
        axes.add_patch(Circle((y, z), 0.1, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=3))
        text = ", ".join(str(k + 1) for k in throws)
        reach = 1.28 + 0.05 * abs(y) * max(len(text) - 1, 0)
        axes.text(reach * y, 1.24 * z, text, ha="center", va="center", size=SMALL, color=INK)


def _group_by_angle(throws: Sequence[float]) -> list[tuple[float, list[int]]]:
    # throws at equal angles, to a degree
    groups: list[tuple[float, list[int]]] = []
    for k, angle in enumerate(throws):
        for group_angle, members in groups:
            if abs(math.remainder(angle - group_angle, math.tau)) < SAME:
                members.append(k)
                break
        else:
            groups.append((angle, [k]))
    return groups


def _side_view(axes: Axes, star: RankedStar, places: Sequence[float], colour: str) -> None:
    """Draw journals on the axis, webs and pins at the height z = cos theta; a pin that points away is open."""
    axes.axis("off")
    count = len(places)
    from_front = np.argsort(np.argsort(-np.array(places), kind="stable"))
    x = from_front.astype(float)
    axes.set(xlim=(-0.9, count - 0.1), ylim=(-1.4, 1.4))
    axes.axhline(0.0, color=FAINT, linewidth=0.6, linestyle=(0, (6, 2, 1, 2)))
    line = [(-0.75, 0.0)]
    for k in np.argsort(from_front):
        height = math.cos(star.throws[k])
        line += [(x[k] - 0.28, 0.0), (x[k] - 0.28, height), (x[k] + 0.28, height), (x[k] + 0.28, 0.0)]
    line.append((count - 0.25, 0.0))
    axes.plot(*zip(*line, strict=True), color=colour, linewidth=2.2, solid_joinstyle="round")
    for k, angle in enumerate(star.throws):
        height, depth = math.cos(angle), math.sin(angle)
        face = colour if depth > 1e-6 else "white"
        axes.plot(x[k], height, "o", markersize=6.5, markerfacecolor=face, markeredgecolor=colour, zorder=3)
        if depth < -1e-6:
            axes.plot(x[k], height, "x", markersize=3.6, color=colour, zorder=4)
        sign = 1.0 if height >= -1e-9 else -1.0
        axes.text(x[k], height + 0.28 * sign, str(k + 1), ha="center", va="center", size=SMALL, color=INK)
