"""Channels: quantities of a design that measures are taken of (M1-M5, E6-E15).

A channel of a load is a function from the loads at an operating point to a signal, one of a block on its mounts a
function to numbers. Each channel has the keys that narrow it and the sides that may be limited.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from laufruhe.extension import extended
from laufruhe.machine import Engine, OperatingPoint, Role
from laufruhe.machine.clearances import Span, distances, reaches
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.bearing_loads import (
    bearing_factors,
    crank_pin_factors,
    drag_factors,
    hammer_blows,
    main_bearing_forces,
    pin_forces,
    piston_pin_forces,
)
from laufruhe.physics.crank_torque import crank_torque
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.channels.flywheel import FLYWHEEL_INERTIA, IRREGULARITY, OF_FLYWHEEL
from laufruhe.problem.channels.inside import (
    AT_EACH_BEARING,
    AT_EACH_CRANK_PIN,
    IN_EACH_CYLINDER,
    OF_EACH_BEARING,
    Where,
    inside,
)
from laufruhe.problem.channels.kinds import (
    AT_MOUNTS,
    OF_MOUNTS,
    ON_BLOCK,
    Channel,
    LoadChannel,
    MassChannel,
    MountChannel,
    Need,
    Needs,
    NumberChannel,
    PlaceChannel,
    SizeChannel,
)
from laufruhe.problem.channels.mounting import (
    DECOUPLING,
    DECOUPLING_SHORTFALL,
    FREQUENCIES,
    OF_MOUNTING,
    RAW_TORQUE_ROLL,
    SAG,
    STATIC_FORCE,
    STATIC_TRAVEL,
    TORQUE_ROLL,
    TOTAL_STIFFNESS,
    TRANSMISSIBILITY,
    counted_cases,
    motion_indices,
    mounting_in,
)
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads

__all__ = [
    "AT_EACH_MOUNT",
    "DECOUPLING",
    "DECOUPLING_SHORTFALL",
    "FLYWHEEL_INERTIA",
    "FREQUENCIES",
    "IRREGULARITY",
    "MOUNT_FORCE",
    "MOUNT_TRAVEL",
    "OF_BLOCK",
    "OF_FLYWHEEL",
    "OF_MOUNTING",
    "OF_MOUNTS",
    "OF_SHAFT_PLACES",
    "ON_BLOCK",
    "RAW_TORQUE_ROLL",
    "SAG",
    "STATIC_FORCE",
    "STATIC_TRAVEL",
    "STORED_WORK",
    "TORQUE_ROLL",
    "TOTAL_STIFFNESS",
    "TRANSMISSIBILITY",
    "Channel",
    "LoadChannel",
    "MassChannel",
    "MountChannel",
    "Needs",
    "NumberChannel",
    "PlaceChannel",
    "SizeChannel",
    "counted_cases",
    "is_at_mounts",
    "motion_indices",
    "mounting_in",
]


def _on_block(name: str, unit: str, part: slice, feels_gas: bool = False) -> LoadChannel:
    def signal(loads: PointLoads) -> Spectrum:
        return loads.wrench.each(lambda wrench: wrench[:, None, part])

    return LoadChannel(name, unit, signal=signal, part=part, feels_gas=feels_gas, of_wrench=True)


def _on_mounts(name: str, unit: str, needs: Need, signal: Callable[[PointLoads], Spectrum | None]) -> LoadChannel:
    def known(loads: PointLoads) -> Spectrum:
        spectrum = signal(loads)
        if spectrum is None:
            raise ValueError(f"this mounting has no {name}")
        return spectrum

    return LoadChannel(name, unit, AT_MOUNTS, needs, signal=known, places=_names_of_mounts, of_wrench=True)


def _resultant(loads: PointLoads) -> Spectrum:
    if loads.mount_forces is None:
        raise ValueError("this mounting has no resultant mount force")
    return loads.mount_forces.each(lambda values: values.sum(axis=1, keepdims=True))


_ON_CRANK: Where = (ON_BLOCK, Needs.NOTHING, lambda _: ("crankshaft",))


def _crank_torque(moving: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return crank_torque(moving, point, fidelity).each(lambda values: values[:, None, None])


def _side_forces(moving: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return piston_pin_forces(moving, point, fidelity).each(lambda values: values[..., 1:])


def _names_of_mounts(engine: Engine) -> Sequence[str]:
    return [mount.name for mount in engine.mounts]


def _of_places(
    name: str, sides: tuple[str, ...], span: Callable[[MeasureQuery, Engine, Engine], Sequence[Span]]
) -> Channel:
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        return [lower for lower, _ in span(measure, evaluation.engine, evaluation.engine)]

    return PlaceChannel(name, "m", sides=sides, values=values, span=span)


MOUNT_FORCE = _on_mounts("mount force", "N", Needs.MOUNTS, lambda loads: loads.mount_forces)
RESULTANT_MOUNT_FORCE = LoadChannel("resultant mount force", "N", ON_BLOCK, Needs.MOUNTS, signal=_resultant)
MOUNT_TRAVEL = _on_mounts("mount travel", "m", Needs.ELASTIC, lambda loads: loads.mount_travel)
AT_EACH_MOUNT = frozenset({MOUNT_FORCE, MOUNT_TRAVEL})
"""Loads for which bounds of mounts have formulas."""
SHAKING_FORCE = _on_block("shaking force", "N", slice(0, 3))
ROCKING_COUPLE = _on_block("rocking couple", "N m", slice(4, 6))
ROLL_MOMENT = _on_block("roll moment", "N m", slice(3, 4), feels_gas=True)
SURGING_FORCE = _on_block("surging force", "N", slice(1, 2))
SWAYING_COUPLE = _on_block("swaying couple", "N m", slice(5, 6))
OF_BLOCK = (SHAKING_FORCE, ROCKING_COUPLE, ROLL_MOMENT, SURGING_FORCE, SWAYING_COUPLE)
MAIN_BEARING_FORCE = inside("main-bearing force", "N", AT_EACH_BEARING, main_bearing_forces)
MAIN_BEARING_PRESSURE = inside("main-bearing pressure", "Pa", AT_EACH_BEARING, main_bearing_forces, bearing_factors)
HAMMER_BLOW = inside("hammer blow", "N", OF_EACH_BEARING, hammer_blows)
CRANK_TORQUE = inside("crank torque", "N m", _ON_CRANK, _crank_torque)
STORED_WORK = inside("stored work", "J", _ON_CRANK, lambda *at: _crank_torque(*at).integral)
CRANK_PIN_FORCE = inside("crank-pin force", "N", AT_EACH_CRANK_PIN, pin_forces)
CRANK_PIN_PRESSURE = inside("crank-pin pressure", "Pa", AT_EACH_CRANK_PIN, pin_forces, crank_pin_factors)
SIDE_FORCE = inside("side force", "N", IN_EACH_CYLINDER, _side_forces)
ROD_FORCE = inside("rod force", "N", IN_EACH_CYLINDER, piston_pin_forces)
FRICTION_POWER = replace(
    inside("friction power", "W", OF_EACH_BEARING, main_bearing_forces, drag_factors),
    adds_up=True, keys=("operating_points", "orders", "bearings"),
)  # fmt: skip

COUNTERWEIGHT_MASS = MassChannel("counterweight mass", "kg", roles=(Role.COUNTERWEIGHT,))
BALANCER_MASS = MassChannel("balancer mass", "kg", roles=(Role.BALANCER,))
ADDED_MASS = MassChannel("added mass", "kg", roles=(Role.COUNTERWEIGHT, Role.BALANCER))

SHAFT_DISTANCE = _of_places("shaft distance", ("min", "max"), lambda m, a, b: distances(m.rotors, a, b, False))
SHAFT_CLEARANCE = _of_places("shaft clearance", ("min",), lambda m, a, b: distances(m.rotors, a, b, True))
ENVELOPE_RADIUS = _of_places("envelope radius", ("max",), lambda m, a, b: reaches(m.rotors, a, b))
OF_SHAFT_PLACES = frozenset({SHAFT_DISTANCE, SHAFT_CLEARANCE, ENVELOPE_RADIUS})


def is_at_mounts(channel: Channel) -> bool:
    """Return True for the force and the travel of each mount."""
    return channel in AT_EACH_MOUNT


CHANNELS: Mapping[str, Channel] = extended("channels", Channel, (
    MOUNT_FORCE, RESULTANT_MOUNT_FORCE, MOUNT_TRAVEL, *OF_BLOCK,
    HAMMER_BLOW, MAIN_BEARING_FORCE, MAIN_BEARING_PRESSURE, CRANK_PIN_FORCE, CRANK_PIN_PRESSURE, ROD_FORCE,
    SIDE_FORCE, FRICTION_POWER, CRANK_TORQUE, STORED_WORK, *OF_FLYWHEEL, COUNTERWEIGHT_MASS, BALANCER_MASS,
    ADDED_MASS, *OF_MOUNTING, SHAFT_DISTANCE, SHAFT_CLEARANCE, ENVELOPE_RADIUS,
))  # fmt: skip
