"""Picture of run-up and shut-down through resonance."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from laufruhe.extensions.run_ups.channels import FORCE, TRAVEL, TWIST
from laufruhe.extensions.run_ups.section import run_of, run_point, runs_of_design, runs_up
from laufruhe.plots.speed_axis import LIMIT, limits_on
from laufruhe.plots.style import entry, finish_page, page, series_of, styled
from laufruhe.plots.words import INK
from laufruhe.present.numbers import RPM
from laufruhe.present.numbers import figure as words
from laufruhe.solvers.result import Result
from laufruhe.units import readable

_RUNS: tuple[tuple[Any, str], ...] = (("-", "run-up"), ((0, (4, 1.5)), "shut-down"))
_ROWS = (("largest force [N]", FORCE), ("largest travel [mm]", TRAVEL), ("largest roll [°]", TWIST))
applies = runs_up


@styled()
def figure(result: Result) -> Figure:
    """Draw the largest mount force, mount travel and roll angle in a run-up over crank speed."""
    layout = page(3, 1, (6.8, 1.5), gap=0.22)
    run, factors = run_of(result), [readable(channel.unit)[1] for _, channel in _ROWS]
    maximum, legend = [0.0] * len(_ROWS), []
    for series in series_of(result):
        runs = runs_of_design(result, series.design)
        for envelope, (style, _) in zip(runs, _RUNS, strict=True):
            for k, values in enumerate((envelope.force, envelope.travel, envelope.twist)):
                layout.panels[k].plot(
                    envelope.speeds * RPM, factors[k] * values, color=series.colour, linestyle=style, linewidth=1.4
                )
                maximum[k] = max(maximum[k], factors[k] * float(values.max(initial=0.0)))
        force, travel, _ = np.max([envelope.worst for envelope in runs], axis=0).tolist()
        legend.append(series.entry(f": at most {words(force, 'N', 3)}, {words(travel, 'm', 3)}"))
    for axes, (label, channel), factor, panel_maximum in zip(layout.panels, _ROWS, factors, maximum, strict=True):
        limits = [factor * limit.maximum for limit in limits_on(result, channel)]
        for limit in limits:
            axes.axhline(limit, color=LIMIT, linewidth=1.0)
        axes.set(xlim=(0.0, run.speed * RPM), ylim=(0.0, 1.1 * max([panel_maximum, *limits]) or 1.0), ylabel=label)
        axes.tick_params(labelbottom=axes is layout.panels[-1])
    layout.panels[-1].set_xlabel("crank speed [rpm]")
    if any(limits_on(result, channel) for _, channel in _ROWS):
        legend.append(entry("limit", color=LIMIT))
    legend += [entry(name, color=INK, linestyle=style) for style, name in _RUNS]
    times = f"{run.up:g} s" if run.up == run.down else f"{run.up:g} s up and {run.down:g} s down"
    lines = f"On any mount, in {times} at constant acceleration; loads of {run_point(result).name}."
    return finish_page(layout, result, "Through resonance", lines, legend)
