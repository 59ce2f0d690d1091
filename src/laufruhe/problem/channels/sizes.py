"""What sizes of the running gear have to bear: stresses, pressures, deflections, and room along the shaft (Z1-Z11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import strength
from laufruhe.physics.bearing_loads import main_bearing_forces, piston_pin_forces
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.asking import Answered, Asked
from laufruhe.problem.channels.kinds import (
    AT_BEARINGS,
    AT_CYLINDERS,
    AT_WEBS,
    IN_CYLINDERS,
    LoadChannel,
    Needs,
    SizeChannel,
    of_what_moves,
)
from laufruhe.problem.loads import PointLoads


def names_of_bearings(engine: Engine) -> Sequence[str]:
    """Of every main bearing."""
    return [bearing.name for bearing in engine.bearings]


def names_of_cylinders(engine: Engine) -> Sequence[str]:
    """Of every cylinder."""
    return [part.name for part in engine.slider_cranks]


def _names_of_sides(engine: Engine) -> Sequence[str]:
    """Of what stands before the pin of every cylinder, and behind."""
    return [f"{part.name} {side}" for part in engine.slider_cranks for side in ("front", "rear")]


def sized(
    name: str, unit: str, keys: tuple[str, ...], needs: Needs, places: Callable[[Engine], Sequence[str]],
    load: Callable[[Engine, OperatingPoint, Fidelity], Spectrum], factor: strength.Factor,
) -> LoadChannel:  # fmt: skip
    """A load of every place, times a factor of its sizes."""

    def signal(moving: Engine, at: PointLoads) -> Spectrum:
        factors = factor(moving, at.point)
        by = factors if factors.ndim > 1 else factors[:, None]
        return load(moving, at.point, at.fidelity).each(lambda values: values * by)

    found = of_what_moves(name, signal)
    return LoadChannel(name, unit, keys, needs, signal=found, places=places, is_inside=True, of_sizes=factor)


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return strength.journal_torques(engine, point, fidelity).each(lambda values: values[..., None])


def _number(
    name: str, unit: str, needs: Needs, sides: tuple[str, ...], of_engine: Callable[[Engine], float]
) -> SizeChannel:
    def values(_: Asked, evaluation: Answered) -> Sequence[float]:
        return (of_engine(evaluation.engine),)

    minimised = sides == ("max",)
    return SizeChannel(
        name, unit, (), needs, sides=sides, minimised=minimised, values=values, of_engine=of_engine
    )  # fmt: skip


CRANK_PIN_STRESS = sized(
    "crank-pin bending stress", "Pa", AT_CYLINDERS, Needs.BEARINGS, names_of_cylinders,
    strength.pin_moments, strength.big_end_factors,
)  # fmt: skip
WEB_STRESS = sized(
    "web stress", "Pa", AT_WEBS, Needs.BEARINGS, _names_of_sides, strength.side_forces, strength.web_factors
)
JOURNAL_TORSION = sized(
    "journal torsion stress", "Pa", AT_BEARINGS, Needs.BEARINGS, names_of_bearings, _torques, strength.journal_factors
)
JOURNAL_STRESS = sized(
    "journal stress", "Pa", AT_WEBS, Needs.BEARINGS, _names_of_sides, strength.side_loads, strength.side_factors
)
MAIN_BEARING_PV = sized(
    "main-bearing pressure times speed", "W/m^2", AT_BEARINGS, Needs.BEARINGS, names_of_bearings,
    main_bearing_forces, strength.journal_speeds,
)  # fmt: skip
ROD_STRESS = sized(
    "rod stress", "Pa", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.rod_stress_factors,
)  # fmt: skip
ROD_BUCKLING = sized(
    "share of the buckling load", "", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.buckling_factors,
)  # fmt: skip
BOLT_STRESS = sized(
    "bolt stress", "Pa", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders, strength.cap_forces, strength.bolt_factors
)
PIN_PRESSURE = sized(
    "piston-pin pressure", "Pa", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.boss_factors,
)  # fmt: skip
PIN_STRESS = sized(
    "piston-pin bending stress", "Pa", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.pin_bending_factors,
)  # fmt: skip
PIN_DEFLECTION = sized(
    "piston-pin deflection", "m", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.deflection_factors,
)  # fmt: skip
PIN_OVALITY = sized(
    "piston-pin ovality", "m", IN_CYLINDERS, Needs.NOTHING, names_of_cylinders,
    piston_pin_forces, strength.ovality_factors,
)  # fmt: skip
THROW_CLEARANCE = _number("throw clearance", "m", Needs.BEARINGS, ("min",), strength.throw_clearance)
GEAR_MASS = _number("running-gear mass", "kg", Needs.NOTHING, ("max",), strength.gear_mass)
OF_SIZES = (
    CRANK_PIN_STRESS, WEB_STRESS, JOURNAL_TORSION, JOURNAL_STRESS, MAIN_BEARING_PV, ROD_STRESS, ROD_BUCKLING,
    BOLT_STRESS, PIN_PRESSURE, PIN_STRESS, PIN_DEFLECTION, PIN_OVALITY, THROW_CLEARANCE, GEAR_MASS,
)  # fmt: skip
