"""Common parts of pictures over crank speed: orders, operating points and limits."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from laufruhe.plots.style import VERMILION, entry
from laufruhe.plots.words import FAINT, SMALL, fit_line, spread, width_of
from laufruhe.present.mounting import MountingFacts
from laufruhe.present.numbers import RPM
from laufruhe.problem.channels import Channel
from laufruhe.problem.measure import Limit
from laufruhe.solvers.result import Result

LIMIT = VERMILION
MAX_NAMES, _NAME_GAP = 5, 0.1
"""Operating points that are all named, and room between two names [inch]."""
# line styles distinguish orders in print
STYLES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)))


def order_entries(facts: MountingFacts, colour: str) -> list[Artist]:
    """Return legend entries of the orders."""
    return [entry(f"order {o:g}", color=colour, linestyle=STYLES[k]) for k, o in enumerate(facts.orders)]


def limits_on(result: Result, channel: Channel) -> list[Limit]:
    """Return the limits on one channel."""
    return [limit for limit in result.problem.limits if limit.measure.channel is channel]


def mark_points(axes: Axes, result: Result, lift: float = 0.06) -> None:
    """Mark operating points by thin lines, their names `lift` above the panel [inch]; set the axis ends before."""
    points = sorted(result.problem.points, key=lambda point: point.speed)
    for point in points:
        axes.axvline(point.speed * RPM, color=FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=0.6)
    named = points if len(points) <= MAX_NAMES else [points[0], points[-1]]
    width, height = axes.bbox.width / axes.figure.dpi, axes.bbox.height / axes.figure.dpi
    names = [fit_line(point.name, width / len(named) - _NAME_GAP) for point in named]
    (low, high), widest = axes.get_xlim(), max(map(width_of, names)) + _NAME_GAP
    shares = (np.array([point.speed * RPM for point in named]) - low) / (high - low)
    half = 0.5 * widest / width
    for name, place, label_place in zip(
        names, shares, spread(shares, 2.0 * half, half, max(1.0 - half, half)), strict=True
    ):
        leader = {"arrowstyle": "-", "color": FAINT, "lw": 0.6, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate(
            name, (place, 1.0), (label_place, 1.0 + lift / height), "axes fraction", "axes fraction", size=SMALL,
            color=FAINT, ha="center", va="bottom", annotation_clip=False, arrowprops=leader,
        )  # fmt: skip
