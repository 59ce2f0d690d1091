"""Torque in the sections of the crankshaft over its speed, and where a limit bars it (V8)."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from laufruhe.extensions.torsion.facts import barred_ranges, is_twisted, speed_range, speeds_between, torque_over_speed
from laufruhe.extensions.torsion.physics import chain_of
from laufruhe.plots.speed_axis import LIMIT, mark_points
from laufruhe.plots.style import entry, finish_page, page, series_of, styled
from laufruhe.plots.words import FAINT
from laufruhe.present.numbers import RPM, number
from laufruhe.solvers.result import Result

applies = is_twisted
# heights beyond this many times the median peak are cut off: resonances that hardly anything damps
MAX_FACTOR = 40.0


@styled()
def figure(result: Result) -> Figure:
    """Draw half of the peak to peak shaft torque over speed: thick for the largest, thin for each shaft section."""
    low, high = speed_range(result)
    speeds = speeds_between(result.final, low, high)
    drawn = page(1, 1, (7.6, 3.6))
    (axes,) = drawn.panels
    series = series_of(result)
    torques = [torque_over_speed(item.design, speeds) for item in series]
    for curve in torques[-1].T:
        axes.plot(speeds * RPM, curve, color=FAINT, linewidth=0.6, alpha=0.7, zorder=1.5)
    legend: list[Artist] = []
    names = [section.name for section in chain_of(result.final.engine).sections]
    for item, torque in zip(series, torques, strict=True):
        largest = torque.max(axis=1)
        axes.plot(speeds * RPM, largest, color=item.colour, linewidth=1.8)
        k = int(np.argmax(np.where(np.isfinite(largest), largest, 0.0)))
        worst = f": at most {number(float(largest[k]), 3)} N m at {number(speeds[k] * RPM, 3)} rpm"
        legend.append(item.entry(f"{worst}, {names[int(np.argmax(torque[k]))]}"))
    legend.append(entry("each section, last design" if len(series) > 1 else "each section", color=FAINT, linewidth=0.6))
    bars = barred_ranges(result, result.final)
    for curve in bars:
        axes.axvspan(curve.lowest * RPM, curve.highest * RPM, color=LIMIT, alpha=0.13, linewidth=0)
    legend += [Patch(facecolor=LIMIT, alpha=0.13, label="speeds barred by a limit")] if bars else []
    envelope = np.concatenate([torque.max(axis=1) for torque in torques])
    finite = envelope[np.isfinite(envelope)]
    top = min(float(finite.max(initial=1.0)), MAX_FACTOR * float(np.median(finite)) if len(finite) else 1.0)
    axes.set(xlim=(low * RPM, high * RPM), ylim=(0.0, 1.1 * top), xlabel="crank speed [rpm]",
             ylabel="alternating torque [N m]")  # fmt: skip
    mark_points(axes, result)
    text = "Half of the peak to peak torque in the most loaded section, in steady state at every speed."
    return finish_page(drawn, result, "Torque in the crankshaft over speed", text, legend)
