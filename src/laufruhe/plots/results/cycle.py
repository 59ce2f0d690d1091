"""Forces and moments over the crank angle of a cycle, initial and final."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.plots.style import Series, entry, finish_page, page, series_of, styled
from laufruhe.plots.words import (
    FAINT,
    INK,
    align_labels,
    empty,
    fit_line,
    in_thousands,
    omitted_words,
    round_ticks,
    width_of,
)
from laufruhe.present.measures import firing_words, hardest_point, has_loads
from laufruhe.problem.evaluation import with_common_base
from laufruhe.solvers.result import Result

STEPS, MAX_POINTS, MAX_MOUNTS = 1440, 3, 6
# width of one panel and of several side by side, height, gaps [inch]
ALONE, PAIRED, NARROW, HIGH, GAP, ACROSS = 6.8, 4.0, 2.7, 1.1, 0.2, 0.25
# a wide line stays visible under an equal decided one
WIDTHS = (2.4, 1.4)
# distance between two numbers [inch]
DIGIT = 0.085
# relative size below which a component of a row is a rounding
SHARE = 1e-6
applies = has_loads
STYLES = ("-", (0, (4, 1.6)), (0, (1.2, 1.2)))


_LEGEND: Any = {"facecolor": "white", "edgecolor": "none", "framealpha": 0.85}


@dataclass(frozen=True)
class Row:
    """Content of one panel: curves by name, shape (designs, angles), and the ends of its axis.

    `left_out` states the size of a load that is too small to draw.
    """

    label: str
    unit: str
    curves: Mapping[str, Array]
    ends: tuple[float, float]
    left_out: str = ""


@styled()
def figure(result: Result) -> Figure:
    """Draw the loads over the crank angle: a column per operating point, a row per load and mount."""
    points, mounts, series = _points(result), _mounts(result), series_of(result, loads=True)
    width = {1: ALONE, 2: PAIRED}.get(len(points), NARROW)
    degrees = np.linspace(0.0, math.degrees(result.final.engine.cycle.angle), STEPS + 1)
    columns = [list(_rows(series, k, mounts)) for k in points]
    all_rows = list(zip(*columns, strict=True))
    rows = [row for row in all_rows if any(panel.curves for panel in row)]
    balanced = [row for row in all_rows if not any(panel.curves for panel in row)]
    drawn = page(len(rows), len(points), (width, HIGH), gap=GAP, lead=0.1, across=ACROSS)
    for j, row in enumerate(rows):
        panels = drawn.panels[j * len(points) : (j + 1) * len(points)]
        _draw_row(panels, row, degrees, [item.colour for item in series])
        for axes in panels:
            axes.tick_params(labelbottom=j == len(rows) - 1, length=2)
    for column, k in enumerate(points):
        panels = drawn.panels[column :: len(points)]
        _mark_firings(panels, result.final.engine, width)
        panels[-1].set_xlabel("crank angle [°]")
        if len(points) > 1:
            name = fit_line(result.problem.points[k].name, width, 10)
            panels[0].annotate(name, (0, 1), (0, 20), "axes fraction", "offset points", size=10)
    align_labels(drawn.panels[:: len(points)])
    at = "" if len(result.problem.points) > 1 else f" at {result.problem.points[0].name}"
    what = "Loads on the block and forces on the mounts" if mounts else "Loads on the block"
    largest = [max(row, key=lambda panel: panel.ends[1]) for row in balanced]
    none = "".join(f" {row.label.capitalize()}: {row.left_out}." for row in largest)
    firings, mark = firing_words(result)
    lines = f"{what}{at}; above, the {firings} by cylinder.{none}"
    firing = entry(mark, color=FAINT, linewidth=0.8, linestyle=STYLES[2])
    legend = [*(item.entry() for item in series), firing]
    every_point, every_mount = len(result.problem.points), len(result.final.mount_names)
    note = f"{len(points)} of {every_point} operating points. " if len(points) < every_point else ""
    note += f"The {len(mounts)} most loaded of {every_mount} mounts. " if len(mounts) < every_mount else ""
    return finish_page(drawn, result, "Forces and moments over one working cycle", lines, legend, note)


def _draw_row(panels: Sequence[Axes], row: Sequence[Row], degrees: Array, colours: Sequence[str]) -> None:
    """Draw one quantity at every operating point, to one scale."""
    ends = (min(panel.ends[0] for panel in row), max(panel.ends[1] for panel in row))
    factor, unit = in_thousands(max(map(abs, ends)), row[0].unit)
    richest = max(row, key=lambda panel: len(panel.curves))
    for axes, panel in zip(panels, row, strict=True):
        _draw(axes, replace(panel, ends=ends), degrees, colours, factor)
        axes.tick_params(labelleft=axes is panels[0])
        if panel is richest and len(richest.curves) > 1:
            axes.legend(loc="upper right", ncols=3, borderaxespad=0.0, borderpad=0.1, **_LEGEND)
            axes.set_ylim(top=axes.get_ylim()[1] + 0.3 * (axes.get_ylim()[1] - axes.get_ylim()[0]))
    for axes in panels:
        axes.set_ylim(top=max(other_axes.get_ylim()[1] for other_axes in panels))
    only = next(iter(richest.curves)) if len(richest.curves) == 1 else ""
    words = f"{only} {richest.label.split()[-1]}" if only else richest.label
    panels[0].set_ylabel(f"{fit_line(words, HIGH + 0.1)}\n[{unit}]", va="center")


def _points(result: Result) -> list[int]:
    points = result.problem.points
    if len(points) <= MAX_POINTS:
        return list(range(len(points)))
    first, *others, last = sorted(range(len(points)), key=lambda k: points[k].speed)
    hardest = hardest_point(result)
    return sorted({first, hardest if hardest in others else others[len(others) // 2], last})


def _mounts(result: Result) -> list[int]:
    forces = result.final.loads[hardest_point(result)].mount_forces
    if forces is None:
        return []
    size = np.abs(forces.coefficients).sum(axis=(0, 2))
    return sorted(np.argsort(-size, kind="stable")[:MAX_MOUNTS].tolist())


def _rows(series: Sequence[Series], k: int, mounts: Sequence[int]) -> Iterator[Row]:
    """Yield shaking force and moments about the origin (C2, C7), and the magnitude of every mount's force."""
    loads = [one.design.loads[k] for one in series]
    base = series[0].design.engine.cycle.base_order
    x, y, z, roll, pitch, yaw = np.moveaxis(np.stack([_closed(load.wrench, base) for load in loads]), -1, 0)
    maximum = max(float(np.abs(load.wrench.coefficients).max(initial=0.0)) for load in loads)
    yield _row("shaking force", "N", {"vertical": z, "lateral": y, "longitudinal": x}, maximum)
    yield _row("roll moment", "N m", {"": roll}, maximum)
    yield _row("rocking couple", "N m", {"pitch": pitch, "yaw": yaw}, maximum)
    forces = [_closed(load.mount_forces, base) for load in loads if load.mount_forces is not None]
    sizes = [np.linalg.norm(np.stack([force[:, m] for force in forces]), axis=-1) for m in mounts]
    # one scale makes mounts comparable
    top = max((float(size.max()) for size in sizes), default=0.0)
    for m, size in zip(mounts, sizes, strict=True):
        yield Row(series[0].design.mount_names[m], "N", {"": size}, (0.0, top))


def _closed(signal: Spectrum, base: Fraction) -> Array:
    samples = with_common_base(base, [signal])[0].sample(STEPS)
    return np.concatenate([samples, samples[:1]])


def _row(label: str, unit: str, curves: Mapping[str, Array], maximum: float) -> Row:
    size = {name: float(np.abs(curve).max()) for name, curve in curves.items()}
    top = max(size.values())
    if words := omitted_words(top, maximum, unit):
        return Row(label, unit, {}, (0.0, top), words)
    minimum = SHARE * top
    visible = {name: curve for name, curve in curves.items() if size[name] > minimum}
    ends = [float(end) for curve in visible.values() for end in (curve.min(), curve.max())]
    return Row(label, unit, visible, (min(ends, default=0.0), max(ends, default=0.0)))


def _draw(axes: Axes, row: Row, degrees: Array, colours: Sequence[str], factor: float) -> None:
    for (name, designs), style in zip(row.curves.items(), STYLES, strict=False):
        for curve, colour, width in zip(designs, colours, WIDTHS[-len(colours) :], strict=True):
            axes.plot(degrees, factor * curve, color=colour, linestyle=style, linewidth=width)
        axes.plot([], [], color=INK, linestyle=style, linewidth=WIDTHS[-1], label=name)
    low, high = (factor * end for end in row.ends)
    room = 0.06 * (high - low) or 1.0
    axes.set(xlim=(0.0, degrees[-1]), ylim=(low - room if low else 0.0, high + room))
    axes.xaxis.set_major_locator(MultipleLocator(90.0 if axes.bbox.width > PAIRED * axes.figure.dpi else 180.0))
    round_ticks(axes.yaxis, 4)
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
    if not row.curves:
        empty(axes, row.left_out)


def _mark_firings(panels: Sequence[Axes], engine: Engine, width: float) -> None:
    """Draw a line per firing, and cylinder numbers above the first panel if there is room."""
    cycle, firings = math.degrees(engine.cycle.angle), dict[float, list[int]]()
    for part in engine.cylinders:
        number = 1 + engine.slider_cranks.index(part)
        firings.setdefault(round(math.degrees(part.firing_angle), 6) % cycle, []).append(number)
    for axes in panels:
        for angle in firings:
            axes.axvline(angle, color=FAINT, linewidth=0.8, linestyle=STYLES[2], zorder=0.6)
    texts = {angle: ",".join(map(str, numbers)) for angle, numbers in firings.items()}
    if sum(width_of(text) + DIGIT for text in texts.values()) <= width:
        for angle, text in texts.items():
            place: Any = {"textcoords": "offset points", "xycoords": panels[0].get_xaxis_transform()}
            panels[0].annotate(text, (angle, 1.0), (0, 3), ha="center", size=9, color=FAINT, **place)
