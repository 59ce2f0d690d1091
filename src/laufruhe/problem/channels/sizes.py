"""What sizes of the running gear have to bear: stresses, pressures, deflections, and room along the shaft (Z1-Z11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import strength
from laufruhe.physics.bearing_loads import main_bearing_forces, piston_pin_forces
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.channels.kinds import (
    AT_BEARINGS,
    AT_CYLINDERS,
    AT_WEBS,
    IN_CYLINDERS,
    OF_BEARINGS,
    LoadChannel,
    Need,
    Needs,
    SizeChannel,
    of_what_moves,
)
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads


def _names_of_bearings(engine: Engine) -> Sequence[str]:
    return [bearing.name for bearing in engine.bearings]


def _names_of_cylinders(engine: Engine) -> Sequence[str]:
    return [part.name for part in engine.slider_cranks]


def _names_of_sides(engine: Engine) -> Sequence[str]:
    return [f"{part.name} {side}" for part in engine.slider_cranks for side in ("front", "rear")]


Where: TypeAlias = tuple[tuple[str, ...], Need, Callable[[Engine], Sequence[str]]]
"""Keys that narrow a load, what it needs, and the names of its places."""
IN_EACH_CYLINDER: Where = (IN_CYLINDERS, Needs.NOTHING, _names_of_cylinders)
AT_EACH_CRANK_PIN: Where = (AT_CYLINDERS, Needs.NOTHING, _names_of_cylinders)
AT_EACH_BEARING: Where = (AT_BEARINGS, Needs.BEARINGS, _names_of_bearings)
OF_EACH_BEARING: Where = (OF_BEARINGS, Needs.BEARINGS, _names_of_bearings)
_BETWEEN_BEARINGS: Where = (AT_CYLINDERS, Needs.BEARINGS, _names_of_cylinders)
_AT_EACH_WEB: Where = (AT_WEBS, Needs.BEARINGS, _names_of_sides)
Load: TypeAlias = Callable[[Engine, OperatingPoint, Fidelity], Spectrum]


def inside(name: str, unit: str, where: Where, load: Load, factor: strength.Factor | None = None) -> LoadChannel:
    """A load inside the crankcase, of every place, times a factor of its sizes where one is given."""

    def signal(moving: Engine, at: PointLoads) -> Spectrum:
        found = load(moving, at.point, at.fidelity)
        if factor is None:
            return found
        factors = factor(moving, at.point)
        by = factors if factors.ndim > 1 else factors[:, None]
        return found.each(lambda values: values * by)

    keys, needs, places = where
    told = of_what_moves(name, signal)
    return LoadChannel(name, unit, keys, needs, signal=told, places=places, of_sizes=factor)


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return strength.journal_torques(engine, point, fidelity).each(lambda values: values[..., None])


def _number(
    name: str, unit: str, needs: Need, sides: tuple[str, ...], of_engine: Callable[[Engine], float]
) -> SizeChannel:
    def values(_: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        return (of_engine(evaluation.engine),)

    minimised = sides == ("max",)
    return SizeChannel(
        name, unit, (), needs, sides=sides, minimised=minimised, values=values, of_engine=of_engine
    )  # fmt: skip


CRANK_PIN_STRESS = inside(
    "crank-pin bending stress", "Pa", _BETWEEN_BEARINGS, strength.pin_moments, strength.big_end_factors
)
WEB_STRESS = inside("web stress", "Pa", _AT_EACH_WEB, strength.side_forces, strength.web_factors)
JOURNAL_TORSION = inside("journal torsion stress", "Pa", AT_EACH_BEARING, _torques, strength.journal_factors)
JOURNAL_STRESS = inside("journal stress", "Pa", _AT_EACH_WEB, strength.side_loads, strength.side_factors)
MAIN_BEARING_PV = inside(
    "main-bearing pressure times speed", "W/m^2", AT_EACH_BEARING, main_bearing_forces, strength.journal_speeds
)
ROD_STRESS = inside("rod stress", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.rod_stress_factors)
ROD_BUCKLING = inside("share of the buckling load", "", IN_EACH_CYLINDER, piston_pin_forces, strength.buckling_factors)
BOLT_STRESS = inside("bolt stress", "Pa", IN_EACH_CYLINDER, strength.cap_forces, strength.bolt_factors)
PIN_PRESSURE = inside("piston-pin pressure", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.boss_factors)
PIN_STRESS = inside(
    "piston-pin bending stress", "Pa", IN_EACH_CYLINDER, piston_pin_forces, strength.pin_bending_factors
)
PIN_DEFLECTION = inside("piston-pin deflection", "m", IN_EACH_CYLINDER, piston_pin_forces, strength.deflection_factors)
PIN_OVALITY = inside("piston-pin ovality", "m", IN_EACH_CYLINDER, piston_pin_forces, strength.ovality_factors)
THROW_CLEARANCE = _number("throw clearance", "m", Needs.BEARINGS, ("min",), strength.throw_clearance)
GEAR_MASS = _number("running-gear mass", "kg", Needs.NOTHING, ("max",), strength.gear_mass)
OF_SIZES = (
    CRANK_PIN_STRESS, WEB_STRESS, JOURNAL_TORSION, JOURNAL_STRESS, MAIN_BEARING_PV, ROD_STRESS, ROD_BUCKLING,
    BOLT_STRESS, PIN_PRESSURE, PIN_STRESS, PIN_DEFLECTION, PIN_OVALITY, THROW_CLEARANCE, GEAR_MASS,
)  # fmt: skip
