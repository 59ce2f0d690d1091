"""Polar load diagrams of the main bearings, seen from the block and from the crankshaft, with where they wear (B4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from laufruhe.extensions.bearing_loads.channels import MAIN_BEARING_FORCE
from laufruhe.extensions.bearing_loads.physics import wear_of
from laufruhe.extensions.bearing_loads.section import as_crank_turns, bearing_paths, has_bearings
from laufruhe.plots.style import (
    ORANGE,
    Series,
    axis_end,
    entry_of_dots,
    finish_page,
    page,
    point_name,
    series_of,
    styled,
)
from laufruhe.plots.words import FAINT, INK, SMALL, fit_line, in_thousands, round_ticks
from laufruhe.present.measures import evaluations_with_loads
from laufruhe.present.pictures import rows_of
from laufruhe.solvers.result import Result

MAX_BEARINGS, MAX_COLUMNS, PANEL, STEPS = 6, 4, 1.95, 180
# fractions of a panel: radius and thickness of the wear ring, extent of the paths
RING, THICK, FILLED = 0.86, 0.12, 0.80
Plane = NDArray[np.complex128]
applies = has_bearings


@styled()
def figure(result: Result) -> Figure:
    """Draw main bearing forces over a cycle, a column per bearing: on the block above, on the crankshaft below."""
    first = evaluations_with_loads(result)[0]
    # the operating point with the largest force on a bearing
    k = int(np.argmax([np.abs(bearing_paths(first, j)).max() for j in range(len(first.loads))]))
    series = series_of(result, loads=True)
    planes = [bearing_paths(item.design, k) for item in series]
    names = MAIN_BEARING_FORCE.places(result.final.engine)
    sizes = np.abs(planes[-1]).max(axis=0)
    chosen = sorted(np.argsort(-sizes, kind="stable")[:MAX_BEARINGS].tolist())
    largest = axis_end(float(np.abs(plane[:, chosen]).max()) for plane in planes)
    factor, unit = in_thousands(largest, "N")
    turned = as_crank_turns(result.final, len(planes[0]))
    rows, side = rows_of(len(chosen), MAX_COLUMNS)
    chunks = [[chosen[k] for k in row] for row in rows]
    drawn = page(2 * len(chunks), side, (PANEL, PANEL), gap=0.55, lead=0.16, across=0.3)
    for r, (chunk, on_crank) in enumerate((chunk, on_crank) for chunk in chunks for on_crank in (False, True)):
        for column, axes in enumerate(drawn.panels[r * side : (r + 1) * side]):
            if column >= len(chunk):
                axes.remove()
                continue
            m, turn = chunk[column], turned if on_crank else 1.0
            _draw(axes, [factor * plane[:, m] * turn for plane in planes], series, factor * largest / FILLED)
            # the lower panel belongs to the bearing above it
            name = "on the crankshaft" if on_crank else f"bearing {names[m]}"
            axes.set_title(fit_line(name, PANEL + 0.2), loc="left", size=SMALL, color=INK)
            across, up = ("across", "along") if on_crank else ("lateral", "vertical")
            axes.set(xlabel=f"{across} [{unit}]", ylabel="" if column else f"{up} [{unit}]")
            axes.tick_params(labelleft=column == 0, length=2)
    selection = f"The {len(chosen)} most loaded of {len(names)} bearings. " if len(chosen) < len(names) else ""
    lines = f"Force of the crankshaft at {point_name(result, k)}, seen from the front; its axes stand upright at 0°."
    dot = entry_of_dots("at 0°", color=INK, markersize=4.0)
    wear: Artist = Patch(color=ORANGE, alpha=0.6, label="wear" + (", final design" if len(series) > 1 else ""))
    legend = [*(item.entry() for item in series), dot, wear]
    return finish_page(drawn, result, "Main-bearing loads over one working cycle", lines, legend, selection)


def _draw(axes: Axes, paths: Sequence[Plane], series: Sequence[Series], size: float) -> None:
    axes.set(xlim=(-size, size), ylim=(-size, size), aspect="equal")
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    for direction in (axes.xaxis, axes.yaxis):
        round_ticks(direction, 4, symmetric=True)
    for path, item in zip(paths, series, strict=True):
        closed = np.append(path, path[0])
        axes.plot(closed.imag, closed.real, color=item.colour, linewidth=1.5, solid_joinstyle="round")
        axes.plot(path[:1].imag, path[:1].real, "o", color=item.colour, markersize=4.0)
    angles = math.tau * np.arange(STEPS + 1) / STEPS
    inner = RING * size * np.exp(1j * angles)
    outer = inner * (1.0 + THICK / RING * wear_of(paths[-1], angles))
    ring = np.concatenate([outer, inner[::-1]])
    axes.fill(ring.imag, ring.real, color=ORANGE, alpha=0.6, linewidth=0.0)
    axes.plot(inner.imag, inner.real, color=FAINT, linewidth=0.5)
