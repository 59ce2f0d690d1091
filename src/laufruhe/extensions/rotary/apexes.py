"""Apex speed and acceleration of rotors, from shape and crank speed (Y5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from laufruhe.extensions.rotary.unit import RotaryUnit
from laufruhe.problem.channels import Need, NumberChannel
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery

ROTORS = Need(
    lambda engine: any(not part.has_rod for part in engine.slider_cranks),
    "the rotors of a rotary engine",
    'take layout = "rotary"',
)


def _maximum(name: str, unit: str, power: int, number: Callable[[RotaryUnit], float]) -> NumberChannel:
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        speeds = [
            at.point.speed for at in evaluation.loads if measure.points is None or at.point.name in measure.points
        ]
        rotors = [part for part in evaluation.engine.slider_cranks if isinstance(part, RotaryUnit)]
        return [max((number(part) * speed**power for part in rotors for speed in speeds), default=0.0)]

    return NumberChannel(
        name, unit, ("operating_points",), ROTORS, minimised=False, depends_on_loads=False, values=values
    )


APEX_SPEED = _maximum("apex speed", "m/s", 1, lambda part: part.apex_speed)
APEX_ACCELERATION = _maximum("apex acceleration", "m/s^2", 2, lambda part: part.apex_acceleration)
