"""Report section and picture of run-up and shut-down: largest force, travel and roll."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import RunUp, point_of, runs_of
from laufruhe.machine import OperatingPoint
from laufruhe.present.measures import designs_with_loads, has_loads
from laufruhe.present.mounting import critical_speed, excited_frequencies, facts_of, is_elastic, main_order
from laufruhe.present.numbers import RPM, figure
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result
from laufruhe.units import quantity_text

SECONDS = 3.0
"""Default time of run-up and of shut-down [s]."""
# largest critical speed in a run, over the highest operating speed; end speed of a run, over its last critical speed
REACH_OVER, BEYOND = 5.0, 1.5
HEAD = ("", "time", "largest force", "largest travel", "largest roll")


def runs_up(result: Result) -> bool:
    """Return True if the design has elastic mounts with a time model, so that it can run up."""
    return is_elastic(result) and mounting_in(result.final.engine).dynamic.has_law


def run_of(result: Result) -> Run:
    """Return the run-up and shut-down of the problem.

    The default takes SECONDS each way, beyond all critical speeds that are near the operating points.
    """
    run = result.problem.engine.extra(Run)
    if run is not None:
        return run
    facts = facts_of(result.final)
    highest_speed = max(point.speed for point in result.problem.points)
    critical = [critical_speed(frequency, main_order(facts)) for frequency in excited_frequencies(facts)]
    end_speed = BEYOND * max(
        (speed for speed in critical if speed <= REACH_OVER * highest_speed), default=highest_speed
    )
    return Run(end_speed, SECONDS, SECONDS)


def run_point(result: Result) -> OperatingPoint:
    """Return the operating point whose gas drives the run."""
    return point_of(run_of(result), result.problem.points)


def runs_of_design(result: Result, design: Evaluation) -> tuple[RunUp, RunUp]:
    """Return run-up and shut-down of a design of a result."""
    return runs_of(design.engine, run_point(result), design.fidelity, run_of(result))


def _tables(result: Result) -> list[Table]:
    # a table only if the problem sets the run
    if result.problem.engine.extra(Run) is None:
        return []
    run, (up, down) = run_of(result), runs_of_design(result, result.final)
    rows = tuple(
        (name, f"{time:g} s", *map(figure, envelope.worst, ("N", "m", "rad")))
        for name, time, envelope in (("run-up", run.up, up), ("shut-down", run.down, down))
    )
    note = (
        f"On any mount, between rest and {quantity_text(run.speed, 'rad/s')}, with the gas of {run_point(result).name}."
    )
    return [Table(HEAD, rows, title="Through resonance", note=note, file="through-resonance")]


def _record(result: Result) -> dict[str, Any]:
    run = run_of(result)
    runs = zip(("up", "down"), (run.up, run.down), runs_of_design(result, result.final), strict=True)
    records = {
        direction: dict(zip(("time", "force", "travel", "twist"), (time, *envelope.worst), strict=True))
        for direction, time, envelope in runs
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
PICTURE = ResultPicture(
    "run_up",
    "Largest force and travel on any mount, and roll, while the engine runs up and is shut down.",
    "laufruhe.extensions.run_ups.picture",
)
