"""Pictures of a block on elastic mounts: transmissibility (Hasselgruber, Fig. 31), Campbell, modes, run-up."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.spectrum import Spectrum, orders_equal
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.run_up import RunUp, run_through
from laufruhe.physics.speed_map import SpeedMap, speed_map, split_loads
from laufruhe.plots.style import AFTER, FAINT, INK, VERMILION, colours_of, heading, names_of, page, source_line
from laufruhe.present.measures import changed, hardest_point, load_designs
from laufruhe.present.mounting import MountingFacts, critical_speed, facts_of
from laufruhe.present.numbers import figure, number
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.mount_design import MountMeasure, mounting_in
from laufruhe.solvers.result import Result
from laufruhe.units import readable

Array = NDArray[np.float64]

SPEEDS = 400
REACH = 1.25
LIMIT = VERMILION
# styles tell orders apart in print as well
_STYLES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)))
_RUNS: tuple[tuple[Any, str], ...] = (("-", "run-up"), ((0, (4, 1.5)), "shut-down"))
_RPM = readable("rad/s")[1]
RUN_SECONDS = 3.0
MOST_SWINGS = 2e3
# criticals beyond this many times the highest speed are left out
REACH_OVER = 5.0


def _designs(result: Result) -> list[Evaluation]:
    return [result.initial, result.final] if changed(result) else [result.final]


def _fastest(result: Result, facts: MountingFacts) -> float:
    """End of the speed axis: past the highest operating point and the isolation of the strongest order."""
    highest = max(point.speed for point in result.problem.points)
    order = facts.orders[0] if facts.orders else 1.0
    driven = [facts.modes.frequencies[j] for j in facts.excited] or [facts.modes.frequencies[-1]]
    return REACH * max(highest, 2.0 * critical_speed(max(driven), order))


def _loaded_point(result: Result) -> OperatingPoint:
    return result.problem.points[hardest_point(result)]


def _map_of(design: Evaluation, result: Result, speeds: Array) -> SpeedMap | None:
    point = _loaded_point(result)
    try:
        return speed_map(mounting_in(design.engine), *split_loads(design.engine, point, design.fidelity), speeds)
    except ModelError:
        # an undamped resonance has no height to draw
        return None


def transmissibility(result: Result) -> Figure:
    """Foundation over exciting force by order and speed, with limits and operating points."""
    designs = load_designs(result)
    facts = facts_of(result.final)
    top = _fastest(result, facts)
    speeds = np.linspace(top / SPEEDS, top, SPEEDS)
    drawn = page(1, 1, (6.8, 4.0))
    axes = drawn.panels[0]
    highest, legend = 1.0, list[Artist]()
    for design, colour in zip(designs, colours_of(result, loads=True), strict=True):
        field = _map_of(design, result, speeds)
        if field is None:
            continue
        for k, order in enumerate(facts.orders):
            column = np.flatnonzero(orders_equal(field.orders, order))
            if len(column):
                curve = field.transmissibility[:, column[0]]
                highest = max(highest, float(curve.max(initial=0.0)))
                axes.plot(speeds * _RPM, curve, color=colour, linestyle=_STYLES[k], linewidth=1.6)
    for colour, name in zip(colours_of(result, loads=True), names_of(result, loads=True), strict=True):
        legend.append(Line2D([], [], color=colour, linewidth=2.0, label=name))
    legend += [
        Line2D([], [], color=INK, linestyle=_STYLES[k], label=f"order {o:g}") for k, o in enumerate(facts.orders)
    ]
    legend += _limits(axes, result, top)
    axes.axhline(1.0, color=FAINT, linewidth=0.8)
    _points(axes, result, 0.98)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0), numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.set(xlim=(0.0, top * _RPM), ylim=(1e-2, 1.6 * highest), xlabel="crank speed [rpm]", ylabel="transmissibility")
    lines = f"Force on the mounts over that on mounts that give no way; loads of {_loaded_point(result).name}."
    heading(drawn.figure, "Transmissibility over speed", lines, legend, source_line(result))
    return drawn.figure


def _order_lines(facts: MountingFacts, colour: str) -> list[Artist]:
    return [
        Line2D([], [], color=colour, linestyle=_STYLES[k], label=f"order {order:g}")
        for k, order in enumerate(facts.orders)
    ]


def _limits(axes: Axes, result: Result, top: float) -> list[Artist]:
    """Limits of the problem, over the speeds that they hold at."""
    found = False
    for limit in result.problem.mount_design.limits:
        if limit.quantity.measure is not MountMeasure.TRANSMISSIBILITY or limit.maximum is None:
            continue
        points = [p for p in result.problem.points if limit.quantity.points is None or p.name in limit.quantity.points]
        low, high = min(p.speed for p in points) * _RPM, max(p.speed for p in points) * _RPM
        if high - low < 0.02 * top * _RPM:
            low, high = low - 0.02 * top * _RPM, high + 0.02 * top * _RPM
        axes.plot([low, high], [limit.maximum] * 2, color=LIMIT, linewidth=2.4, solid_capstyle="butt", zorder=4)
        found = True
    return [Line2D([], [], color=LIMIT, linewidth=2.4, label="limit")] if found else []


def _points(axes: Axes, result: Result, share: float) -> None:
    """Operating points as thin lines; names where they do not crowd."""
    points = result.problem.points
    for k, point in enumerate(points):
        axes.axvline(point.speed * _RPM, color=FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=0.6)
        if len(points) <= 5 or k in (0, len(points) - 1):
            side = "top" if share > 0.5 else "bottom"
            words: Any = {"size": 7.5, "color": FAINT, "va": side, "ha": "right", "rotation": 90, "zorder": 4}
            words["bbox"] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.5}
            axes.text(point.speed * _RPM, share, point.name, transform=axes.get_xaxis_transform(), **words)


def campbell(result: Result) -> Figure:
    """Orders of crank speed against natural frequencies."""
    facts = facts_of(result.final)
    top = _fastest(result, facts)
    drawn = page(1, 1, (6.2, 4.2))
    axes = drawn.panels[0]
    frequencies = facts.modes.frequencies
    reach = 1.1 * max(float(frequencies.max(initial=0.0)), *_edges(result), 1e-9)
    bands = _bands(axes, result)
    for k, order in enumerate(facts.orders):
        axes.plot([0.0, top * _RPM], [0.0, order * top / math.tau], color=AFTER, linestyle=_STYLES[k], linewidth=1.4)
    labels: list[tuple[float, str]] = []
    for j, (name, frequency) in enumerate(zip(facts.modes.names, frequencies, strict=True)):
        driven = j in facts.excited
        axes.axhline(
            frequency, color=INK if driven else FAINT, linewidth=1.3 if driven else 0.7, alpha=1 if driven else 0.6
        )
        labels.append((frequency, f"{name}, {number(frequency, 3)} Hz" + ("" if driven else " (not excited)")))
        for order in facts.orders if driven else ():
            axes.plot(critical_speed(frequency, order) * _RPM, frequency, "o", color=AFTER, markersize=4.5, zorder=5)
    for height, (_, text) in zip(_apart([f for f, _ in labels], 0.038 * reach), labels, strict=True):
        axes.text(1.01, height / reach, text, size=7.5, color=INK, va="center", transform=axes.transAxes)
    _points(axes, result, 0.02)
    axes.set(xlim=(0.0, top * _RPM), ylim=(0.0, reach), xlabel="crank speed [rpm]", ylabel="frequency [Hz]")
    legend = _order_lines(facts, AFTER)
    legend.append(Line2D([], [], color=AFTER, marker="o", linestyle="none", markersize=4.5, label="critical speed"))
    figure = drawn.figure
    wide, high = figure.get_size_inches()
    # room for the names of the modes
    figure.set_size_inches(wide + 1.5, high)
    box = axes.get_position()
    axes.set_position((box.x0 * wide / (wide + 1.5), box.y0, box.width * wide / (wide + 1.5), box.height))
    lines = "Natural frequencies of the design as decided" if changed(result) else "Natural frequencies as given"
    heading(
        figure, "Critical speeds", f"{lines}, and the orders that load it most.", [*legend, *bands], source_line(result)
    )
    return figure


def _apart(heights: list[float], least: float) -> list[float]:
    """Heights of labels, moved up until none covers another."""
    out: list[float] = []
    for height in heights:
        out.append(max(height, out[-1] + least) if out else height)
    return out


def _edges(result: Result) -> list[float]:
    """Every frequency that a limit names."""
    limits = [m for m in result.problem.mount_design.limits if m.quantity.measure is MountMeasure.FREQUENCIES]
    return [0.0, *(e for m in limits for e in (m.minimum, m.maximum, *(m.outside or ())) if e is not None)]


def _bands(axes: Axes, result: Result) -> list[Artist]:
    """Bands that are to hold no natural frequency, and ends that none may pass."""
    limits = [m for m in result.problem.mount_design.limits if m.quantity.measure is MountMeasure.FREQUENCIES]
    bands = [limit.outside for limit in limits if limit.outside is not None]
    edges = [edge for limit in limits for edge in (limit.minimum, limit.maximum) if edge is not None]
    for band in bands:
        axes.axhspan(*band, color=LIMIT, alpha=0.13, linewidth=0)
    for edge in edges:
        axes.axhline(edge, color=LIMIT, linewidth=2.4, alpha=0.5, zorder=4)
    return [
        *([Line2D([], [], color=LIMIT, alpha=0.5, linewidth=2.4, label="limit")] if edges else []),
        *([Patch(facecolor=LIMIT, alpha=0.13, label="no natural frequency")] if bands else []),
    ]


def modes(result: Result) -> Figure:
    """Kinetic-energy share of every motion in every mode."""
    designs = _designs(result)
    drawn = page(1, len(designs), (3.4, 3.0), gap=1.0, lead=0.35)
    for axes, design, name in zip(drawn.panels, designs, names_of(result), strict=True):
        facts = facts_of(design)
        _shares(axes, facts)
        axes.set_title(name, loc="left", size=10, pad=8, parse_math=False)
    lines = "Percent of kinetic energy; a mode of its own has 100 in one row. Bold: excited."
    heading(drawn.figure, "Natural modes", lines, [Line2D([], [], linestyle="none", label="")], source_line(result))
    return drawn.figure


def _shares(axes: Axes, facts: MountingFacts) -> None:
    energy = 100.0 * facts.modes.energy
    axes.imshow(np.clip(energy, 0.0, 100.0), cmap="Blues", vmin=0.0, vmax=115.0, aspect="auto")
    for i in range(6):
        for j in range(6):
            if abs(energy[i, j]) >= 0.5:
                dark = energy[i, j] > 60.0
                axes.text(j, i, f"{energy[i, j]:.0f}", ha="center", va="center", size=8, color="white" if dark else INK)
    ticks = [f"{number(f, 3)}" for f in facts.modes.frequencies]
    axes.set_xticks(range(6), ticks)
    for j, label in enumerate(axes.get_xticklabels()):
        label.set_fontweight("bold" if j in facts.excited else "normal")
    axes.set_yticks(range(6), MOTIONS)
    axes.set_xlabel("natural frequency [Hz]")
    axes.grid(visible=False)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)


def run_up(result: Result) -> Figure:
    """Envelope of run-up and shut-down through resonance."""
    drawn = page(2, 1, (6.8, 2.0), gap=0.35)
    facts = facts_of(result.final)
    order = facts.orders[0] if facts.orders else 1.0
    driven = [facts.modes.frequencies[j] for j in facts.excited] or [facts.modes.frequencies[-1]]
    fastest = max(point.speed for point in result.problem.points)
    slow = [speed for f in driven if (speed := critical_speed(f, order)) <= REACH_OVER * fastest]
    last = 1.5 * max(slow, default=fastest)
    point = min(result.problem.points, key=lambda p: p.speed)
    most, worst = [0.0, 0.0], []
    for design, colour in zip(_designs(result), colours_of(result), strict=True):
        inertia, gas = split_loads(design.engine, point, design.fidelity)
        runs = []
        for (style, _), (first, end) in zip(_RUNS, ((0.0, last), (last, 0.0)), strict=True):
            run = _run(design, inertia, gas, first, end)
            runs.append(run)
            for k, (axes, values, factor) in enumerate(
                zip(drawn.panels, (run.force, run.travel), (1.0, 1e3), strict=True)
            ):
                axes.plot(run.speeds * _RPM, factor * values, color=colour, linestyle=style, linewidth=1.4)
                most[k] = max(most[k], factor * float(values.max(initial=0.0)))
        force, travel = max(run.worst_force for run in runs), max(run.worst_travel for run in runs)
        worst.append(f"at most {figure(force, 'N', 3)}, {figure(travel, 'm', 3)}")
    for axes, label, top in zip(drawn.panels, ("largest force [N]", "largest travel [mm]"), most, strict=True):
        axes.set(xlim=(0.0, last * _RPM), ylim=(0.0, 1.1 * top or 1.0), ylabel=label)
    drawn.panels[0].tick_params(labelbottom=False)
    drawn.panels[1].set_xlabel("crank speed [rpm]")
    legend: list[Artist] = [
        Line2D([], [], color=colour, linewidth=2.0, label=f"{name}: {text}")
        for colour, name, text in zip(colours_of(result), names_of(result), worst, strict=True)
    ]
    legend += [Line2D([], [], color=INK, linestyle=style, label=name) for style, name in _RUNS]
    lines = f"On any mount, in {RUN_SECONDS:g} s at constant acceleration; loads of {point.name}."
    heading(drawn.figure, "Through resonance", lines, legend, source_line(result))
    return drawn.figure


def _run(design: Evaluation, inertia: Spectrum, gas: Spectrum | None, first: float, last: float) -> RunUp:
    # gas torque orders beyond these shake the block by less than a line's width
    kept = None if gas is None else gas.kept(12.0)
    mounting = mounting_in(design.engine)
    # a mode that swings a million times in a run is followed, not resolved
    stiff = RUN_SECONDS * mounting.modes.frequencies[-1] > MOST_SWINGS
    method: Literal["RK45", "Radau"] = "Radau" if stiff else "RK45"
    return run_through(mounting, inertia.kept(12.0), kept, first, last, RUN_SECONDS, 60, method, 1e-4)


FIGURES: Mapping[str, Callable[[Result], Figure]] = {
    "transmissibility.png": transmissibility,
    "campbell.png": campbell,
    "modes.png": modes,
    "run_up.png": run_up,
}
