"""Channels of the largest force, travel and twist in run-up and shut-down (E28)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import missed_share, point_of, runs_of
from laufruhe.machine import Engine
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

    The signal, shape (times, places, d), is the attribute `part` of a response; the channel is its largest length.
    """

    needs: Need = RUN
    depends_on_loads: bool = False
    simulation: str = "laufruhe.extensions.run_ups.boxes"
    peak_error: Callable[[Engine], float] = _peak_error
    part: str = field(kw_only=True)


def _run_channel(part: str, unit: str) -> RunChannel:
    def values(_: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        run = evaluation.engine.extra(Run)
        if run is None or not evaluation.loads:
            return (0.0,)
        point = point_of(run, [loads.point for loads in evaluation.loads])
        runs = runs_of(evaluation.engine, point, evaluation.fidelity, run)
        return (max(float(getattr(envelope, part).max()) for envelope in runs),)

    return RunChannel(f"run-up {part}", unit, values=values, part=part)


FORCE, TRAVEL, TWIST = _run_channel("force", "N"), _run_channel("travel", "m"), _run_channel("twist", "rad")
