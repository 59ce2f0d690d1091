"""What a run-up and a shut-down through resonance reach (E28)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from laufruhe.numerics.arrays import Array
from laufruhe.physics.linear_run import Response
from laufruhe.physics.run_up import RunUp
from laufruhe.physics.runs import point_of, runs_of
from laufruhe.problem.asking import Answered, Asked
from laufruhe.problem.channels.kinds import Need, Needs, NumberChannel


@dataclass(frozen=True, eq=False)
class RunChannel(NumberChannel):
    """The most of a number in run-up and shut-down, integrated in time."""

    needs: Need = Needs.RUN
    of_loads: bool = False
    is_checked: ClassVar[bool] = True


def _most(name: str, unit: str, number: Callable[[RunUp], float], part: Callable[[Response], Array]) -> RunChannel:
    def values(_: Asked, evaluation: Answered) -> Sequence[float]:
        run = evaluation.engine.run
        if run is None or not evaluation.loads:
            return (0.0,)
        point = point_of(run, [loads.point for loads in evaluation.loads])
        return (max(map(number, runs_of(evaluation.engine, point, evaluation.fidelity, run))),)

    return RunChannel(name, unit, values=values, of_run=part)


RUN_FORCE = _most("run-up force", "N", lambda run: run.worst_force, lambda response: response.force)
RUN_TRAVEL = _most("run-up travel", "m", lambda run: run.worst_travel, lambda response: response.travel)
RUN_TWIST = _most("run-up twist", "rad", lambda run: run.worst_twist, lambda response: response.twist)
OF_RUNS = (RUN_FORCE, RUN_TRAVEL, RUN_TWIST)
