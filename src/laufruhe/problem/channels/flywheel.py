"""Channels of the flywheel and of the evenness of the crank's speed (T2-T7)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from laufruhe.machine import Flywheel
from laufruhe.physics.irregularity import Swing, swing_of
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.problem.channels.kinds import Need, Needs, NumberChannel, OfWheel
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery


@dataclass(frozen=True, eq=False)
class FlywheelChannel(NumberChannel):
    """Number that is monotone in every number of the flywheel."""

    of_loads: bool = False


def _of_wheel(
    name: str, unit: str, number: Callable[[Flywheel, Swing], float], keys: tuple[str, ...] = (),
    needs: Need = Needs.FLYWHEEL, of_torque: bool = False,
) -> FlywheelChannel:  # fmt: skip
    """Return the channel of the largest value of a number over the operating points that count."""

    def of_wheel(measure: MeasureQuery, evaluation: EvaluatedDesign) -> OfWheel:
        counted = [loads.point for loads in evaluation.loads if measure.counts_point(loads.point)]
        swings = [swing_of(evaluation.engine, point, evaluation.fidelity) for point in counted]
        return lambda wheel: max((number(wheel, swing) for swing in swings), default=0.0)

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        inertia, wheel = turning_inertia(evaluation.engine, evaluation.fidelity), evaluation.engine.flywheel
        # an uneven speed needs an inertia only
        return () if inertia is None else (of_wheel(measure, evaluation)(wheel or Flywheel(inertia)),)

    return FlywheelChannel(name, unit, keys, needs, values=values, of_wheel=of_wheel, of_torque=of_torque)


AT = ("operating_points",)
IRREGULARITY = _of_wheel(
    "degree of irregularity", "", lambda wheel, swing: swing.irregularity(wheel.inertia), AT, of_torque=True
)
FLYWHEEL_INERTIA = _of_wheel("flywheel inertia", "kg m^2", lambda wheel, _: wheel.inertia)
FLYWHEEL_MASS = _of_wheel("flywheel mass", "kg", lambda wheel, _: wheel.ring.whole * wheel.ring.mass, needs=Needs.RIM)
RIM_STRESS = _of_wheel("rim stress", "Pa", lambda wheel, swing: wheel.ring.stress(swing.speed), AT, Needs.RIM)
ARM_STRESS = _of_wheel(
    "arm stress", "Pa", lambda wheel, swing: wheel.ring.arm_stress(swing.speed, swing.torque), AT, Needs.ARMS
)  # fmt: skip
OF_FLYWHEEL = (IRREGULARITY, FLYWHEEL_INERTIA, FLYWHEEL_MASS, RIM_STRESS, ARM_STRESS)
