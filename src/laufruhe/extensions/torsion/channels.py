"""Channels of torsional vibration: twist, torque and stress of shafts, frequencies, heat of absorbers (V4-V12)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from laufruhe.extensions.torsion import physics
from laufruhe.extensions.torsion.machine import Torsion
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.channels import ON_BLOCK, Channel, Display, LoadChannel, Need, NumberChannel, crankcase_signal
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads

Resonances: TypeAlias = Callable[[MeasureQuery, EvaluatedDesign], Sequence[physics.Resonance]]
CHAIN = Need(lambda e: e.extra(Torsion), "the discs and shafts of the crankshaft", "add [torsion]")
DIAMETERS = Need(
    lambda e: (chain := e.extra(Torsion)) and any(section.diameter is not None for section in chain.sections),
    "the diameter of a shaft",
    "give one in [torsion]",
)
HIGHEST = 12.0
"""Highest main order that counts if a measure names no orders."""


def _of_shafts(
    name: str, unit: str, signal: Callable[[Engine, OperatingPoint, Fidelity], Spectrum], title: str = "",
    needs: Need = CHAIN,
) -> LoadChannel:  # fmt: skip
    def places(engine: Engine) -> Sequence[str]:
        sections = physics.chain_of(engine).sections
        return [section.name for section in sections if needs is CHAIN or section.diameter is not None]

    of_sections = crankcase_signal(
        name, lambda moving, at: signal(moving, at.point, at.fidelity).mapped(lambda values: values[:, :, None])
    )
    return LoadChannel(
        name, unit, (*ON_BLOCK, "sections"), needs, signal=of_sections, places=places, depends_on_unbalances=False,
        display=Display(title, "section"),
    )  # fmt: skip


def _points(measure: MeasureQuery, evaluation: EvaluatedDesign) -> list[PointLoads]:
    return [at for at in evaluation.loads if measure.points is None or at.point.name in measure.points]


def _at_speeds(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[physics.Resonance]:
    speeds = dict.fromkeys(at.point.speed for at in _points(measure, evaluation))
    return [physics.AtSpeed(speed) for speed in speeds]


def _in_orders(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[physics.Resonance]:
    orders = measure.orders or physics.main_orders(evaluation.engine, HIGHEST)
    return [physics.InOrder(order) for order in orders if order > 0.0]


def _of_modes(name: str, unit: str, keys: tuple[str, ...], resonances: Resonances) -> NumberChannel:
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        chain = physics.chain_of(evaluation.engine)
        return [float(x) for resonance in resonances(measure, evaluation) for x in resonance.numbers(chain)]

    sides = ("min", "max", "outside")
    return NumberChannel(name, unit, keys, CHAIN, sides, minimised=False, values=values, depends_on_loads=False)


def _heat(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
    heats = [physics.absorber_heat(evaluation.engine, at.point, at.fidelity) for at in _points(measure, evaluation)]
    return (max((float(heat) for absorbers in heats for heat in absorbers), default=0.0),)


SHAFT_TWIST = _of_shafts("shaft twist", "rad", physics.twist)
SHAFT_TORQUE = _of_shafts("shaft torque", "N m", physics.shaft_torque, "Torque in the crankshaft")
SHAFT_STRESS = _of_shafts("shaft stress", "Pa", physics.shaft_stress, "Shear stress of the crankshaft", DIAMETERS)
TORSIONAL_FREQUENCIES = _of_modes("torsional frequencies", "Hz", ("operating_points",), _at_speeds)
CRITICAL_SPEEDS = _of_modes("critical speeds", "rad/s", ("operating_points", "orders"), _in_orders)
ABSORBER_HEAT = NumberChannel("absorber heat", "W", ("operating_points",), CHAIN, minimised=False, values=_heat)

FACTORS: Mapping[Channel, physics.Factors] = {
    SHAFT_TWIST: physics.unit_factors,
    SHAFT_TORQUE: physics.section_stiffness,
    SHAFT_STRESS: physics.stress_factors,
}
"""Factors from the twist of a section to the load at each place."""
RESONANCES: Mapping[Channel, Resonances] = {TORSIONAL_FREQUENCIES: _at_speeds, CRITICAL_SPEEDS: _in_orders}
"""Functions that return the crank speeds or orders at which natural modes are computed, by channel."""
