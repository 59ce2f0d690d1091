"""The engine to scale, with optimised parts marked."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from laufruhe.plots.machine_view import EngineView, draw_views, legend_of, planes_of, views
from laufruhe.plots.style import finish_page, styled
from laufruhe.present.measures import has_firing
from laufruhe.present.poses import THICKNESS
from laufruhe.solvers.result import Result


def applies(result: Result) -> bool:
    """Return True for an engine with slider-cranks."""
    return bool(result.final.engine.slider_cranks)


@styled()
def figure(result: Result) -> Figure:
    """Draw the engine to scale from the front and from the side, at a crank angle of zero."""
    view = EngineView.from_result(result)
    drawn = views(view)
    draw_views(drawn, view)
    weights = f" Weights as half discs of steel, {1e3 * THICKNESS:g} mm thick, of the same unbalance."
    if any(len(planes_of(view, rotor)) > 1 for rotor in view.weights):
        weights += " A weight in the plane of a rod is drawn in halves on both webs."
    cycle = view.engine.cycle.angle
    fires = [part.name for part in view.engine.cylinders if abs(math.remainder(part.firing_angle, cycle)) < 1e-9]
    firing = "firing " if has_firing(result) else ""
    centre = f", the {firing}dead centre of {' and '.join(fires)}" if fires else ""
    lines = f"To scale, at a crank angle of 0°{centre}.{weights if view.weights else ''}"
    return finish_page(drawn, result, "The engine", lines, legend_of(view))
