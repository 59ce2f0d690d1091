"""What mounts and block go through between rest and speed."""

from __future__ import annotations

from laufruhe.present.mounting import is_elastic
from laufruhe.present.numbers import figure
from laufruhe.present.run_up import run_of, run_point, shown_runs
from laufruhe.report.grid import Grid
from laufruhe.solvers.result import Result
from laufruhe.units import shown

HEAD = ("", "time", "largest force", "largest travel", "largest roll")


def tables(result: Result) -> list[Grid]:
    """Run-up and shut-down, where the problem says how these go."""
    if not is_elastic(result) or result.problem.engine.run is None:
        return []
    run, (up, down) = run_of(result), shown_runs(result, result.final)
    rows = tuple(
        (name, f"{time:g} s", figure(found.worst_force, "N"), figure(found.worst_travel, "m"),
         figure(found.worst_twist, "rad"))
        for name, time, found in (("run-up", run.up, up), ("shut-down", run.down, down))
    )  # fmt: skip
    note = f"On any mount, between rest and {shown(run.speed, 'rad/s')}, with the gas of {run_point(result).name}."
    return [Grid("Through resonance", HEAD, rows, note=note, sheet="through-resonance")]
