"""The engine to scale, what was decided of it marked."""

from __future__ import annotations

from matplotlib.figure import Figure

from laufruhe.plots.machine_parts import THICKNESS
from laufruhe.plots.machine_view import Scene, draw_views, legend_of, views
from laufruhe.plots.style import headed, styled
from laufruhe.solvers.result import Result


def applies(result: Result) -> bool:
    """Every engine has a shape."""
    return bool(result.final.engine.slider_cranks)


@styled()
def figure(result: Result) -> Figure:
    """End and side view of the design at the firing dead centre of cylinder 1."""
    scene = Scene.of(result)
    drawn = views(scene)
    draw_views(drawn, scene)
    weights = f" Weights as half discs of steel, {1e3 * THICKNESS:g} mm thick, of the same unbalance."
    first = scene.engine.slider_cranks[0].name
    lines = f"To scale, at the firing dead centre of {first}.{weights if scene.weights else ''}"
    return headed(drawn, result, "The engine", lines, legend_of(scene))
