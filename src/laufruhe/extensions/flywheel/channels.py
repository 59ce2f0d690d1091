"""Channels of the flywheel and of the crank's speed: the largest value over operating points (T3-T8)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from laufruhe.extensions.flywheel.machine import Flywheel
from laufruhe.extensions.flywheel.torque import Swing, swing_of
from laufruhe.physics.torque import turning_inertia
from laufruhe.problem.channels import Need, NumberChannel
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery


@dataclass(frozen=True, eq=False)
class FlywheelChannel(NumberChannel):
    """Number of a flywheel, monotone in each number that may be open.

    Attributes
    ----------
    flywheel_value
        Function of measure and design that returns the number as a function of the flywheel.
    """

    flywheel_value: Callable[[MeasureQuery, EvaluatedDesign], Callable[[Flywheel], float]] = field(kw_only=True)


_TURNING = Need(
    lambda engine: engine.turning_inertia is not None, "a flywheel",
    "add [flywheel] with an inertia or a rim, [torsion], or fidelity.crank_inertia",
)  # fmt: skip
_RIM = Need(
    lambda engine: (wheel := engine.extra(Flywheel)) and wheel.rim, "the rim of a flywheel", "add [flywheel.rim]"
)
_ARMS = Need(
    lambda engine: (wheel := engine.extra(Flywheel)) and wheel.rim and wheel.rim.arms,
    "the arms of a flywheel",
    "add [flywheel.rim.arms]",
)


def _channel(
    name: str, unit: str, number: Callable[[Flywheel, Swing], float], keys: tuple[str, ...] = (),
    needs: Need = _TURNING, depends_on_gas: bool = False, depends_on_torque: bool = False,
) -> FlywheelChannel:  # fmt: skip
    def flywheel_value(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Callable[[Flywheel], float]:
        counted = [loads.point for loads in evaluation.loads if measure.includes_point(loads.point)]
        swings = [swing_of(evaluation.engine, point, evaluation.fidelity) for point in counted]
        return lambda wheel: max((number(wheel, swing) for swing in swings), default=0.0)

    def inertia_value(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Callable[[float], float]:
        value = flywheel_value(measure, evaluation)
        return lambda inertia: value(Flywheel(inertia))

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        inertia, wheel = turning_inertia(evaluation.engine, evaluation.fidelity), evaluation.engine.extra(Flywheel)
        # without a flywheel the turning inertia alone gives the speed variation
        return () if inertia is None else (flywheel_value(measure, evaluation)(wheel or Flywheel(inertia)),)

    return FlywheelChannel(
        name, unit, keys, needs, values=values, flywheel_value=flywheel_value,
        inertia_value=inertia_value if needs is _TURNING else None, depends_on_gas=depends_on_gas,
        depends_on_torque=depends_on_torque, depends_on_loads=False,
    )  # fmt: skip


_AT_POINTS = ("operating_points",)
IRREGULARITY = _channel(
    "degree of irregularity", "", lambda wheel, swing: swing.irregularity(wheel.inertia), _AT_POINTS,
    depends_on_gas=True, depends_on_torque=True,
)  # fmt: skip
FLYWHEEL_INERTIA = _channel("flywheel inertia", "kg m^2", lambda wheel, _: wheel.inertia)
FLYWHEEL_MASS = _channel("flywheel mass", "kg", lambda wheel, _: wheel.ring.mass_ratio * wheel.ring.mass, needs=_RIM)
RIM_STRESS = _channel("rim stress", "Pa", lambda wheel, swing: wheel.ring.stress(swing.speed), _AT_POINTS, _RIM)
ARM_STRESS = _channel(
    "arm stress", "Pa", lambda wheel, swing: wheel.ring.arm_stress(swing.speed, swing.torque), _AT_POINTS, _ARMS,
    depends_on_gas=True,
)  # fmt: skip
OF_FLYWHEEL = (IRREGULARITY, FLYWHEEL_INERTIA, FLYWHEEL_MASS, RIM_STRESS, ARM_STRESS)
