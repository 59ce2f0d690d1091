"""What is asked of the flywheel, and of how evenly it lets the crank turn (T2-T7)."""

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
    """A number that goes one way with every number of the flywheel."""

    of_loads: bool = False


def _found(
    name: str, unit: str, number: Callable[[Flywheel, Swing], float], keys: tuple[str, ...] = (),
    needs: Need = Needs.FLYWHEEL, rises: bool = True, of_torque: bool = False,
) -> FlywheelChannel:  # fmt: skip
    """The largest of a number of the flywheel over the operating points that count."""

    def of_wheel(measure: MeasureQuery, evaluation: EvaluatedDesign) -> OfWheel:
        counted = [at.point for at in evaluation.loads if measure.points is None or at.point.name in measure.points]
        swings = [swing_of(evaluation.engine, point, evaluation.fidelity) for point in counted]
        return lambda wheel: max((number(wheel, swing) for swing in swings), default=0.0)

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        inertia, wheel = turning_inertia(evaluation.engine, evaluation.fidelity), evaluation.engine.flywheel
        # an uneven speed is reckoned with an inertia alone
        return () if inertia is None else (of_wheel(measure, evaluation)(wheel or Flywheel(inertia)),)

    return FlywheelChannel(
        name, unit, keys, needs, values=values, of_wheel=of_wheel, rises=rises, of_torque=of_torque,
    )  # fmt: skip


AT = ("operating_points",)
IRREGULARITY = _found(
    "degree of irregularity", "", lambda wheel, swing: swing.irregularity(wheel.inertia), AT,
    rises=False, of_torque=True,
)  # fmt: skip
FLYWHEEL_INERTIA = _found("flywheel inertia", "kg m^2", lambda wheel, _: wheel.inertia)
FLYWHEEL_MASS = _found("flywheel mass", "kg", lambda wheel, _: wheel.ring.whole * wheel.ring.mass, needs=Needs.RIM)
RIM_STRESS = _found("rim stress", "Pa", lambda wheel, swing: wheel.ring.stress(swing.speed), AT, Needs.RIM)
ARM_STRESS = _found(
    "arm stress", "Pa", lambda wheel, swing: wheel.ring.arm_stress(swing.speed, swing.torque), AT, Needs.ARMS
)  # fmt: skip
OF_FLYWHEEL = (IRREGULARITY, FLYWHEEL_INERTIA, FLYWHEEL_MASS, RIM_STRESS, ARM_STRESS)
