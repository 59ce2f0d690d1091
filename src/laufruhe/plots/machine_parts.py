"""Parts of an engine drawn to scale at a crank angle: pistons, rods, webs, bodies that turn, weights and boxes."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from laufruhe.machine.bodies import Outline
from laufruhe.plots.style import GREY
from laufruhe.plots.words import FAINT, INK
from laufruhe.present.poses import Pose

METAL, IRON = "#d5dade", "#b4bcc4"
PISTON: Any = {"facecolor": "white", "edgecolor": INK}
MM = 1e3


def slot(axes: Axes, pose: Pose, bore: float, order: float) -> None:
    """Draw the slot of a Scotch yoke, from the front."""
    if math.isfinite(pose.part.rod_length):
        return
    across = 1j * pose.part.crank_radius * cmath.exp(1j * pose.part.bank)
    ends = (pose.foot - across, 0.16 * bore), (pose.foot + across, 0.16 * bore)
    bar(axes, *ends, order, facecolor=METAL, edgecolor=INK)


def heights_of(radius: float, along: float) -> tuple[float, float]:
    """Return the lowest and highest point of a half disc about its centre [m]."""
    up, across = math.cos(along), radius * abs(math.sin(along))
    return (-radius if up < 0.0 else -across), (radius if up > 0.0 else across)


def at(place: complex) -> tuple[float, float]:
    """Return the coordinates of a point in the view from the front [mm]."""
    return MM * place.imag, MM * place.real


def bar(axes: Axes, one: tuple[complex, float], other: tuple[complex, float], order: float, **look: Any) -> None:
    """Draw a rod or a web as two circles and the area between them."""
    (first, wide), (second, narrow) = one, other
    along = cmath.phase(second - first)
    turns = np.linspace(0.5 * math.pi, 1.5 * math.pi, 13)
    corners = [first + wide * cmath.exp(1j * (along + turn)) for turn in turns]
    corners += [second + narrow * cmath.exp(1j * (along + turn + math.pi)) for turn in turns]
    axes.add_patch(Polygon([at(corner) for corner in corners], closed=True, linewidth=0.8, zorder=order, **look))


def box(axes: Axes, xs: tuple[float, float], levels: tuple[float, float], order: float, **look: Any) -> None:
    """Draw a part from the side: x in metres, levels in millimetres."""
    low, high = min(levels), max(levels)
    style = {"edgecolor": INK, "linewidth": 0.7, **look}
    axes.add_patch(Rectangle((MM * min(xs), low), MM * abs(xs[1] - xs[0]), high - low, zorder=order, **style))


def look_of(body: Outline) -> dict[str, Any]:
    """Return the style of a turning body or of its housing."""
    if body.moves:
        return {**PISTON, "zorder": 2.2}
    return {"fill": False, "edgecolor": GREY, "linewidth": 1.4, "zorder": 1.8}


def bodies(axes: Axes, pose: Pose) -> None:
    """Draw rotating bodies that stand in place of a piston, from the front."""
    for body in pose.bodies:
        axes.add_patch(Polygon([at(place) for place in body.points], closed=True, **look_of(body)))


def cylinder(axes: Axes, pose: Pose, bore: float) -> complex:
    """Draw the walls of a cylinder between its dead centres, and return a point beside them."""
    turn = cmath.exp(1j * pose.part.bank)
    along = complex((pose.piston - pose.crank) / turn)
    ends = [Pose.of(pose.part, phi).piston for phi in np.linspace(0.0, math.tau / abs(pose.part.shaft.ratio), 13)]
    heights = [complex((end - pose.crank) / turn).real for end in ends]
    for side in (-0.5, 0.5):
        walls = [pose.crank + turn * complex(height, along.imag + side * bore) for height in
                 (min(heights) - 0.25 * bore, max(heights) + 0.3 * bore)]  # fmt: skip
        axes.plot(*zip(*map(at, walls), strict=True), color=FAINT, linewidth=0.8, zorder=2.0)
    return pose.crank + turn * complex(max(heights) + 0.1 * bore, along.imag + 0.72 * bore)


def piston_at(axes: Axes, pose: Pose, bore: float, order: float, **look: Any) -> None:
    """Draw a piston and its rings, from the front."""
    turn = cmath.exp(1j * pose.part.bank)

    def corner(up: float, side: float) -> tuple[float, float]:
        return at(pose.piston + turn * bore * complex(up, side))

    corners = [corner(*place) for place in ((-0.25, -0.48), (-0.25, 0.48), (0.25, 0.48), (0.25, -0.48))]
    axes.add_patch(Polygon(corners, closed=True, zorder=order - 0.01, linewidth=0.9, **look))
    for ring in (0.12, 0.19):
        ends = zip(corner(ring, -0.48), corner(ring, 0.48), strict=True)
        axes.plot(*ends, color=FAINT, linewidth=0.6, zorder=order - 0.005)
