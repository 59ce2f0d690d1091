"""The engine to scale, what was decided of it marked."""

from __future__ import annotations

from matplotlib.figure import Figure

from laufruhe.plots.machine_view import THICKNESS, Scene, framed, front_view, legend_of, reaches, side_view
from laufruhe.plots.style import headed, page, styled
from laufruhe.solvers.result import Result


def applies(result: Result) -> bool:
    """Every engine has a shape."""
    return bool(result.final.engine.slider_cranks)


@styled()
def figure(result: Result) -> Figure:
    """End and side view of the design at the firing dead centre of cylinder 1."""
    scene = Scene.of(result)
    drawn = page(1, 2, (5.2, 4.6), across=0.75)
    front, side = drawn.panels
    front_view(front, scene)
    side_view(side, scene)
    ahead, beside = reaches(scene)
    framed(front, ahead)
    framed(side, beside, backwards=True, down=scene.is_flat)
    for axes, title in ((front, "from the front, turning clockwise"), (side, scene.beside)):
        axes.set_title(title, loc="left", size=9)
    weights = f" Weights as half discs of steel, {1e3 * THICKNESS:g} mm thick, of the same unbalance."
    first = scene.engine.slider_cranks[0].name
    lines = f"To scale, at the firing dead centre of {first}.{weights if scene.weights else ''}"
    return headed(drawn, result, "The engine", lines, legend_of(scene))
