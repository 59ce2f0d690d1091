"""What pictures over crank speed share: the end of the axis, orders, operating points and limits."""

from __future__ import annotations

from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes

from laufruhe.plots.style import VERMILION, entry
from laufruhe.plots.words import FAINT, SMALL
from laufruhe.present.mounting import MountingFacts
from laufruhe.problem.channels import Channel
from laufruhe.problem.measure import Limit
from laufruhe.solvers.result import Result
from laufruhe.units import readable

RPM = readable("rad/s")[1]
LIMIT = VERMILION
# styles tell orders apart in print as well
STYLES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)))


def order_entries(facts: MountingFacts, colour: str) -> list[Artist]:
    """Of a legend."""
    return [entry(f"order {o:g}", color=colour, linestyle=STYLES[k]) for k, o in enumerate(facts.orders)]


def limits_on(result: Result, channel: Channel) -> list[Limit]:
    """Limits of the problem on one channel."""
    return [limit for limit in result.problem.limits if limit.measure.channel is channel]


def mark_points(axes: Axes, result: Result, share: float) -> None:
    """Operating points as thin lines; names where they do not crowd, at a share of the height."""
    points = result.problem.points
    words: Any = {"size": SMALL, "color": FAINT, "ha": "right", "rotation": 90, "zorder": 4}
    words |= {"va": "top" if share > 0.5 else "bottom", "transform": axes.get_xaxis_transform()}
    for k, point in enumerate(points):
        axes.axvline(point.speed * RPM, color=FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=0.6)
        if len(points) <= 5 or k in (0, len(points) - 1):
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.5}
            axes.text(point.speed * RPM, share, point.name, bbox=box, **words)
