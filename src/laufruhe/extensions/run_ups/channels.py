"""Channels of the largest force, travel and twist in run-up and shut-down (E28)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from laufruhe.extensions.run_ups.linear_run import RunResponse
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import RunUp, missed_share, point_of, runs_of
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import Need, NumberChannel
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery

RUN = Need(
    lambda engine: engine.extra(Run),
    "elastic mounts that an engine is run up on",
    "add [run_up] and [mounts] of kind elastic",
)


def _peak_error(engine: Engine) -> float:
    run = engine.extra(Run)
    return 0.0 if run is None else missed_share(run)


@dataclass(frozen=True, eq=False)
class RunChannel(NumberChannel):
    """Largest value of a signal in run-up and shut-down, integrated in time.

    Attributes
    ----------
    part
        Return the signal, shape (times, places, d), from the response; the channel is its largest length.
    """

    needs: Need = RUN
    depends_on_loads: bool = False
    simulation: str = "laufruhe.extensions.run_ups.simulation"
    peak_error: Callable[[Engine], float] = _peak_error
    part: Callable[[RunResponse], Array] = field(kw_only=True)


def _run_channel(
    name: str, unit: str, number: Callable[[RunUp], float], part: Callable[[RunResponse], Array]
) -> RunChannel:
    def values(_: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        run = evaluation.engine.extra(Run)
        if run is None or not evaluation.loads:
            return (0.0,)
        point = point_of(run, [loads.point for loads in evaluation.loads])
        return (max(map(number, runs_of(evaluation.engine, point, evaluation.fidelity, run))),)

    return RunChannel(name, unit, values=values, part=part)


FORCE = _run_channel("run-up force", "N", lambda run: run.worst_force, lambda response: response.force)
TRAVEL = _run_channel("run-up travel", "m", lambda run: run.worst_travel, lambda response: response.travel)
TWIST = _run_channel("run-up twist", "rad", lambda run: run.worst_twist, lambda response: response.twist)
