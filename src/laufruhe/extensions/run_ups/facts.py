"""Run-up and shut-down that tables, files and pictures show."""

from __future__ import annotations

from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import RunUp, point_of, runs_of
from laufruhe.machine import OperatingPoint
from laufruhe.present.mounting import critical_speed, excited_frequencies, facts_of, is_elastic, main_order
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

SECONDS = 3.0
# criticals beyond this many times the highest speed are left out
REACH_OVER, BEYOND = 5.0, 1.5


def runs_up(result: Result) -> bool:
    """Return whether there is a run to show: elastic mounts whose stiffness has a law in time."""
    return is_elastic(result) and mounting_in(result.final.engine).dynamic.has_law


def run_of(result: Result) -> Run:
    """Return the run of the problem, else one of three seconds past every critical speed near the operating points."""
    run = result.problem.engine.extra(Run)
    if run is not None:
        return run
    facts = facts_of(result.final)
    top = max(point.speed for point in result.problem.points)
    critical = [critical_speed(frequency, main_order(facts)) for frequency in excited_frequencies(facts)]
    last = BEYOND * max((speed for speed in critical if speed <= REACH_OVER * top), default=top)
    return Run(last, SECONDS, SECONDS)


def run_point(result: Result) -> OperatingPoint:
    """The operating point whose gas drives the engine meanwhile."""
    return point_of(run_of(result), result.problem.points)


def runs_of_design(result: Result, design: Evaluation) -> tuple[RunUp, RunUp]:
    """Up and down, of one of the designs of a result."""
    return runs_of(design.engine, run_point(result), design.fidelity, run_of(result))
