"""Animated GIF of the engine in motion, with shaking force and mount forces."""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from laufruhe.numerics.arrays import Array
from laufruhe.plots.machine_view import MM, EngineView, at, draw_views, legend_of, views
from laufruhe.plots.style import VERMILION, Page, entry_of_dots, finish_page, point_name, series_of, styled
from laufruhe.plots.words import in_thousands
from laufruhe.present.measures import hardest_point, has_loads
from laufruhe.present.numbers import number
from laufruhe.present.poses import Pose, bore_of
from laufruhe.problem.curves import forces_of
from laufruhe.solvers.result import Result

FRAMES = 48
"""Number of frames over the working cycle."""
SECONDS = 4.0
DPI, COLOURS = 80, 96
# length of the largest arrow relative to the picture's height
REACH = 0.35
LIT = math.radians(70.0)
"""Crank angle for which a firing is displayed [rad]."""


@styled()
def animate(result: Result, path: Path) -> None:
    """Write one working cycle as GIF: arrows are the shaking force and the mount forces, dots are firings."""
    from PIL import Image

    view = EngineView.from_result(result)
    k, series = hardest_point(result) if result.problem.points else 0, series_of(result, loads=True)
    loads = []
    for item in series if has_loads(result) else ():
        fields = forces_of({item.name: item.design}, FRAMES).fields
        forces = {field.name: field.values[0, k] for field in fields}
        shaking = forces["shaking_force"][:, None]
        loads.append(np.concatenate([shaking, forces["mount_force"]], axis=1) if "mount_force" in forces else shaking)
    largest = max((float(np.abs(item[:, :, 1:]).max()) for item in loads), default=0.0)
    frames, (factor, unit) = [], in_thousands(largest, "N")
    for step in range(FRAMES):
        drawn, phi = views(view), result.final.engine.cycle.angle * step / FRAMES
        draw_views(drawn, view, phi)
        _firings(drawn, view, phi)
        for item, cycle in zip(series, loads, strict=False):
            _arrows(drawn.panels[0], view, cycle[step], largest, item.colour)
        angle = f"{math.degrees(phi):.1f}° of crank angle"
        scale = f"; longest arrow {number(factor * largest, 3)} {unit}" if largest else ""
        where = f", at {point_name(result, k)}" if loads else ""
        fires = entry_of_dots("fires", color=VERMILION, markersize=7.0)
        legend = [*legend_of(view), fires, *(item.entry(": forces") for item in series[: len(loads)])]
        finish_page(drawn, result, f"The engine turning{where}", f"{angle}{scale}.", legend)
        drawn.figure.set_dpi(DPI)
        drawn.figure.canvas.draw()
        pixels = np.asarray(drawn.figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
        frames.append(Image.fromarray(pixels).convert("RGB"))
    # one palette for all frames avoids flicker
    sampled_frames = np.concatenate([np.asarray(frame) for frame in frames[:: max(FRAMES // 4, 1)]])
    colours = Image.fromarray(sampled_frames).quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    reduced = [frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames]
    reduced[0].save(path, save_all=True, append_images=reduced[1:], duration=int(1e3 * SECONDS / FRAMES), loop=0)


def _firings(drawn: Page, view: EngineView, phi: float) -> None:
    bore, cycle = bore_of(view.engine), view.engine.cycle.angle
    for part in view.engine.cylinders:
        pose = Pose.at_angle(part, phi)
        if (phi - part.firing_angle + 1e-9) % cycle > LIT or pose.bodies:
            continue
        place = pose.piston + 0.4 * bore * cmath.exp(1j * part.bank)
        side = (MM * part.x, MM * (place.imag if view.is_flat else place.real))
        for axes, (x, y) in zip(drawn.panels, (at(place), side), strict=True):
            axes.plot(x, y, "o", color=VERMILION, markersize=7.0, zorder=9.5)


def _arrows(axes: Axes, view: EngineView, forces: Array, largest: float, colour: str) -> None:
    if not largest:
        return
    low, high = axes.get_ylim()
    scale = REACH * (high - low) / largest
    places = [(0.0, 0.0), *((1e3 * mount.position[1], 1e3 * mount.position[2]) for mount in view.engine.mounts)]
    for (y, z), (_, across, up) in zip(places, forces, strict=False):
        look: Any = {"color": colour, "units": "inches", "width": 0.03, "scale": 1.0, "zorder": 10.0}
        axes.quiver(y, z, scale * across, scale * up, angles="xy", scale_units="xy", **look)
