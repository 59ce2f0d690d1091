"""Channels of the motion of pistons: the largest value of any piston at any operating point (K19-K21)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from laufruhe.extensions.bearing_loads.channels import SIDE_FORCE
from laufruhe.extensions.piston_motion.motion import Extreme, PistonMotion, piston_motion, pistons_of, reversals
from laufruhe.machine import Engine
from laufruhe.problem.channels import Need, NumberChannel, names_of_cylinders
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads

PISTONS = Need(pistons_of, "pistons", "choose another quantity; apexes of rotors have an apex speed")
RODS = Need(
    lambda engine: pistons_of(engine) and all(part.has_rod and part.has_pin_loads for part in engine.slider_cranks),
    "connecting rods", "choose another quantity, such as piston speed",
)  # fmt: skip


def _channel(
    name: str, unit: str, needs: Need, numbers: Callable[[Engine, PointLoads], Sequence[float]],
    sides: tuple[str, ...] = ("max",), depends_on_loads: bool = False,
) -> NumberChannel:  # fmt: skip
    """Return the channel of a number of each cylinder at each operating point, the largest first."""

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        engine = evaluation.engine
        counted = measure.places(names_of_cylinders(engine))
        points = (loads for loads in evaluation.loads if measure.includes_point(loads.point))
        rows = [numbers(engine, loads) for loads in points]
        return sorted((row[k] for row in rows for k in counted), reverse=True)

    return NumberChannel(
        name, unit, ("operating_points", "cylinders"), needs, sides, values=values,
        depends_on_loads=depends_on_loads, places=names_of_cylinders,
    )  # fmt: skip


def _of_motion(number: Callable[[PistonMotion], float]) -> Callable[[Engine, PointLoads], Sequence[float]]:
    return lambda engine, loads: [number(piston_motion(part, loads.point.speed)) for part in engine.slider_cranks]


def reversals_at(engine: Engine, loads: PointLoads) -> list[list[Extreme]]:
    """Return the reversals of the side force of every cylinder at an operating point (K21)."""
    return reversals(SIDE_FORCE.signal(loads), engine.slider_cranks, loads.point)


def _fastest_reversals(engine: Engine, loads: PointLoads) -> Sequence[float]:
    return [max((reversal.value for reversal in reversals), default=0.0) for reversals in reversals_at(engine, loads)]


TRAVEL = _channel("piston travel", "m", PISTONS, _of_motion(lambda motion: motion.stroke), ("min", "max"))
MEAN_SPEED = _channel("mean piston speed", "m/s", PISTONS, _of_motion(lambda motion: motion.mean_speed))
SPEED = _channel("piston speed", "m/s", PISTONS, _of_motion(lambda motion: motion.speed.value))
ACCELERATION = _channel("piston acceleration", "m/s^2", PISTONS, _of_motion(lambda motion: motion.acceleration))
ROD_ANGLE = _channel(
    "rod angle", "rad", RODS, _of_motion(lambda motion: motion.rod_angle.value if motion.rod_angle else 0.0)
)
ROD_LENGTH = _channel(
    "rod length", "m", RODS, lambda engine, _: [part.rod_length for part in engine.slider_cranks], ("min", "max")
)
REVERSAL_RATE = _channel("side-force reversal rate", "N/s", RODS, _fastest_reversals, depends_on_loads=True)
