"""Report section of run-up and shut-down: largest force, travel and roll."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from laufruhe.extensions.run_ups.facts import run_of, run_point, runs_of_design, runs_up
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.present.measures import designs_with_loads, has_loads
from laufruhe.present.numbers import RPM, figure
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result
from laufruhe.units import quantity_text

HEAD = ("", "time", "largest force", "largest travel", "largest roll")


def _tables(result: Result) -> list[Table]:
    # a table only if the problem sets the run
    if result.problem.engine.extra(Run) is None:
        return []
    run, (up, down) = run_of(result), runs_of_design(result, result.final)
    rows = tuple(
        (name, f"{time:g} s", figure(envelope.worst_force, "N"), figure(envelope.worst_travel, "m"),
         figure(envelope.worst_twist, "rad"))
        for name, time, envelope in (("run-up", run.up, up), ("shut-down", run.down, down))
    )  # fmt: skip
    note = (
        f"On any mount, between rest and {quantity_text(run.speed, 'rad/s')}, with the gas of {run_point(result).name}."
    )
    return [Table(HEAD, rows, title="Through resonance", note=note, file="through-resonance")]


def _record(result: Result) -> dict[str, Any]:
    run = run_of(result)
    records = {
        direction: {
            "time": time,
            "force": envelope.worst_force,
            "travel": envelope.worst_travel,
            "twist": envelope.worst_twist,
        }
        for direction, time, envelope in zip(
            ("up", "down"), (run.up, run.down), runs_of_design(result, result.final), strict=True
        )
    }
    return {"up_to": run.speed, "point": run_point(result).name, **records}


def _over_speed(result: Result) -> Table:
    rows = [
        [design, direction, RPM * speed, force, travel, math.degrees(twist)]
        for design, evaluation in designs_with_loads(result).items()
        for direction, run in zip(("run-up", "shut-down"), runs_of_design(result, evaluation), strict=True)
        for speed, force, travel, twist in np.column_stack([run.speeds, run.force, run.travel, run.twist]).tolist()
    ]
    return Table(
        ["design", "way", "speed [rpm]", "largest mount force [N]", "largest mount travel [m]", "largest roll [deg]"],
        rows,
    )


SECTION = Section(
    "run_up", runs_up, _tables, _record, ("through-resonance",),
    {"run-up": (lambda result: runs_up(result) and has_loads(result), _over_speed)},
)  # fmt: skip
