"""Run-up and shut-down through resonance."""

from __future__ import annotations

from typing import Any, Literal

from matplotlib.figure import Figure

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.run_up import RunUp, run_through
from laufruhe.physics.speed_map import split_loads
from laufruhe.plots.speed_axis import RPM, driven, main_order
from laufruhe.plots.style import INK, entry, headed, page, series_of
from laufruhe.present.mounting import critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import figure as words
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

SECONDS = 3.0
MOST_SWINGS = 2e3
# criticals beyond this many times the highest speed are left out
REACH_OVER = 5.0
_RUNS: tuple[tuple[Any, str], ...] = (("-", "run-up"), ((0, (4, 1.5)), "shut-down"))
applies = is_elastic


def figure(result: Result) -> Figure:
    """Envelope of force and travel over speed."""
    drawn = page(2, 1, (6.8, 2.0), gap=0.35)
    last = _last(result)
    point = min(result.problem.points, key=lambda p: p.speed)
    most, legend = [0.0, 0.0], []
    for one in series_of(result):
        loads = split_loads(one.design.engine, point, one.design.fidelity)
        runs = [_run(one.design, *loads, *ends) for ends in ((0.0, last), (last, 0.0))]
        for run, (style, _) in zip(runs, _RUNS, strict=True):
            for k, (axes, values) in enumerate(zip(drawn.panels, (run.force, 1e3 * run.travel), strict=True)):
                axes.plot(run.speeds * RPM, values, color=one.colour, linestyle=style, linewidth=1.4)
                most[k] = max(most[k], float(values.max(initial=0.0)))
        force, travel = max(run.worst_force for run in runs), max(run.worst_travel for run in runs)
        legend.append(one.entry(f": at most {words(force, 'N', 3)}, {words(travel, 'm', 3)}"))
    for axes, label, top in zip(drawn.panels, ("largest force [N]", "largest travel [mm]"), most, strict=True):
        axes.set(xlim=(0.0, last * RPM), ylim=(0.0, 1.1 * top or 1.0), ylabel=label)
    drawn.panels[0].tick_params(labelbottom=False)
    drawn.panels[1].set_xlabel("crank speed [rpm]")
    legend += [entry(name, color=INK, linestyle=style) for style, name in _RUNS]
    lines = f"On any mount, in {SECONDS:g} s at constant acceleration; loads of {point.name}."
    return headed(drawn, result, "Through resonance", lines, legend)


def _last(result: Result) -> float:
    """End of the runs: past every critical speed that is not far from the operating points [rad/s]."""
    facts = facts_of(result.final)
    top = max(point.speed for point in result.problem.points)
    critical = [critical_speed(frequency, main_order(facts)) for frequency in driven(facts)]
    return 1.5 * max((speed for speed in critical if speed <= REACH_OVER * top), default=top)


def _run(design: Evaluation, inertia: Spectrum, gas: Spectrum | None, first: float, last: float) -> RunUp:
    # gas torque orders beyond these shake the block by less than a line's width
    kept = None if gas is None else gas.kept(12.0)
    mounting = mounting_in(design.engine)
    # a mode that swings a million times in a run is followed, not resolved
    stiff = SECONDS * mounting.modes.frequencies[-1] > MOST_SWINGS
    method: Literal["RK45", "Radau"] = "Radau" if stiff else "RK45"
    return run_through(mounting, inertia.kept(12.0), kept, first, last, SECONDS, 60, method, 1e-4)
