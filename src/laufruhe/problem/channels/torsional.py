"""What can be asked of the crankshaft's twist (V4-V12)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import torsion
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.asking import Answered, Asked
from laufruhe.problem.channels.kinds import Need, Needs, TorsionChannel, TwistChannel, of_what_moves
from laufruhe.problem.loads import PointLoads

HIGHEST = 12.0
"""Order up to which main orders count where none are named."""


def _names_of_sections(engine: Engine) -> Sequence[str]:
    return [section.name for section in torsion.chain_of(engine).sections]


def _names_of_stressed(engine: Engine) -> Sequence[str]:
    return [section.name for section in torsion.chain_of(engine).sections if section.diameter is not None]


def _of_shafts(
    name: str, unit: str, signal: Callable[[Engine, OperatingPoint, Fidelity], Spectrum], factors: torsion.Factors,
    places: Callable[[Engine], Sequence[str]] = _names_of_sections, needs: Need = Needs.TORSION,
) -> TwistChannel:  # fmt: skip
    found = of_what_moves(
        name, lambda moving, at: signal(moving, at.point, at.fidelity).each(lambda values: values[:, :, None])
    )
    return TwistChannel(name, unit, needs=needs, signal=found, places=places, factors=factors)


def _points(measure: Asked, evaluation: Answered) -> list[PointLoads]:
    return [at for at in evaluation.loads if measure.points is None or at.point.name in measure.points]


def _at_speeds(measure: Asked, evaluation: Answered) -> Sequence[torsion.Resonance]:
    """List the speeds that count: a pendulum has another spring at each."""
    speeds = dict.fromkeys(at.point.speed for at in _points(measure, evaluation))
    return [torsion.AtSpeed(speed) for speed in speeds]


def _in_orders(measure: Asked, evaluation: Answered) -> Sequence[torsion.Resonance]:
    """List the orders that count: a pendulum has another inertia in each."""
    orders = measure.orders or torsion.main_orders(evaluation.engine, HIGHEST)
    return [torsion.InOrder(order) for order in orders if order > 0.0]


def _of_modes(
    name: str, unit: str, keys: tuple[str, ...], resonances: Callable[[Asked, Answered], Sequence[torsion.Resonance]]
) -> TorsionChannel:
    """Return the channel of numbers that natural modes have."""

    def values(measure: Asked, evaluation: Answered) -> Sequence[float]:
        chain = torsion.chain_of(evaluation.engine)
        return [float(x) for own in resonances(measure, evaluation) for x in own.numbers(chain)]

    sides = ("min", "max", "outside")
    return TorsionChannel(name, unit, keys, sides=sides, values=values, of_modes=resonances, of_loads=False)


def _heat(measure: Asked, evaluation: Answered) -> Sequence[float]:
    """The most that any absorber has to give off at any point that counts."""
    found = [torsion.absorber_heat(evaluation.engine, at.point, at.fidelity) for at in _points(measure, evaluation)]
    return (max((float(heat) for each in found for heat in each), default=0.0),)


SHAFT_TWIST = _of_shafts("shaft twist", "rad", torsion.twist, torsion.unit_factors)
SHAFT_TORQUE = _of_shafts("shaft torque", "N m", torsion.shaft_torque, torsion.section_stiffness)
SHAFT_STRESS = _of_shafts(
    "shaft stress", "Pa", torsion.shaft_stress, torsion.stress_factors, _names_of_stressed, Needs.DIAMETERS
)
TORSIONAL_FREQUENCIES = _of_modes("torsional frequencies", "Hz", ("operating_points",), _at_speeds)
CRITICAL_SPEEDS = _of_modes("critical speeds", "rad/s", ("operating_points", "orders"), _in_orders)
ABSORBER_HEAT = TorsionChannel("absorber heat", "W", ("operating_points",), values=_heat)

TORSIONAL = (SHAFT_TWIST, SHAFT_TORQUE, SHAFT_STRESS, TORSIONAL_FREQUENCIES, CRITICAL_SPEEDS, ABSORBER_HEAT)
