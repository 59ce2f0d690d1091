"""Channels of the running gear: stresses, pressures, deflections, clearance along the shaft, and mass (Z1-Z11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from laufruhe.extensions.bearing_loads.channels import AT_EACH_BEARING, BEARINGS
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces, piston_pin_forces
from laufruhe.extensions.sizes import strength
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.channels import (
    AT_CYLINDERS,
    AT_WEBS,
    IN_EACH_CYLINDER,
    Need,
    Needs,
    NumberChannel,
    PlaceSpec,
    crankcase_channel,
    names_of_cylinders,
)
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery


def _names_of_sides(engine: Engine) -> Sequence[str]:
    return [f"{part.name} {side}" for part in engine.slider_cranks for side in ("front", "rear")]


_AT_EACH_PIN: PlaceSpec = (AT_CYLINDERS, BEARINGS, names_of_cylinders)
_AT_EACH_WEB: PlaceSpec = (AT_WEBS, BEARINGS, _names_of_sides)


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return strength.journal_torques(engine, point, fidelity).mapped(lambda values: values[..., None])


def _size_channel(
    name: str, unit: str, needs: Need, sides: tuple[str, ...], size_value: Callable[[Engine], float]
) -> NumberChannel:
    def values(_: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        return (size_value(evaluation.engine),)

    minimised = sides == ("max",)
    return NumberChannel(
        name, unit, (), needs, sides, minimised, depends_on_loads=False, values=values, size_value=size_value
    )  # fmt: skip


CRANK_PIN_STRESS = crankcase_channel(
    "crank-pin bending stress", "Pa", _AT_EACH_PIN, strength.pin_moments, strength.big_end_factors
)
WEB_STRESS = crankcase_channel("web stress", "Pa", _AT_EACH_WEB, strength.side_forces, strength.web_factors)
JOURNAL_TORSION = crankcase_channel("journal torsion stress", "Pa", AT_EACH_BEARING, _torques, strength.journal_factors)
JOURNAL_STRESS = crankcase_channel("journal stress", "Pa", _AT_EACH_WEB, strength.side_loads, strength.side_factors)
MAIN_BEARING_PV = crankcase_channel(
    "main-bearing pressure times speed", "W/m^2", AT_EACH_BEARING, main_bearing_forces, strength.journal_speeds
)
ROD_STRESS = crankcase_channel("rod stress", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.rod_stress_factors)
ROD_BUCKLING = crankcase_channel(
    "share of the buckling load", "", IN_EACH_CYLINDER, piston_pin_forces, strength.buckling_factors
)
BOLT_STRESS = crankcase_channel("bolt stress", "Pa", IN_EACH_CYLINDER, strength.cap_forces, strength.bolt_factors)
PIN_PRESSURE = crankcase_channel(
    "piston-pin pressure", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.boss_factors
)
PIN_STRESS = crankcase_channel(
    "piston-pin bending stress", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.pin_bending_factors
)
PIN_DEFLECTION = crankcase_channel(
    "piston-pin deflection", "m", IN_EACH_CYLINDER, piston_pin_forces, strength.deflection_factors
)
PIN_OVALITY = crankcase_channel(
    "piston-pin ovality", "m", IN_EACH_CYLINDER, piston_pin_forces, strength.ovality_factors
)
THROW_CLEARANCE = _size_channel("throw clearance", "m", BEARINGS, ("min",), strength.throw_clearance)
GEAR_MASS = _size_channel("running-gear mass", "kg", Needs.UNCONDITIONAL, ("max",), strength.running_gear_mass)
