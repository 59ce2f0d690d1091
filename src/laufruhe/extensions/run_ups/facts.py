"""Run-up and shut-down for tables, files and pictures."""

from __future__ import annotations

from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import RunUp, point_of, runs_of
from laufruhe.machine import OperatingPoint
from laufruhe.present.mounting import critical_speed, excited_frequencies, facts_of, is_elastic, main_order
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

SECONDS = 3.0
"""Default time of run-up and of shut-down [s]."""
# largest critical speed in a run, over the highest operating speed; end speed of a run, over its last critical speed
REACH_OVER, BEYOND = 5.0, 1.5


def runs_up(result: Result) -> bool:
    """Return True if the design has elastic mounts with a time model, so that it can run up."""
    return is_elastic(result) and mounting_in(result.final.engine).dynamic.has_law


def run_of(result: Result) -> Run:
    """Return the run of the problem; by default one of SECONDS each way, beyond all critical speeds near the points."""
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
