"""Shaking loads of an engine on its block, order by order (L1-L6).

The loads of one cylinder, times the phase and geometry of each: identical cylinders
share their order coefficients, and the sum over the star is taken with exact turns, so
what the star cancels is zero and not a rounding.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import chain
from typing import TypeAlias

import numpy as np

from laufruhe.machine import Cycle, Engine, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.numerics.exact_angles import cancelling_sums
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import forget_gas, gas_loads
from laufruhe.physics.geared_inertia import geared_moment
from laufruhe.physics.load_torque import with_machines
from laufruhe.physics.mechanism import effects_of
from laufruhe.physics.rigid_body import plane_parts
from laufruhe.physics.star_loads import order_index, star_loads
from laufruhe.physics.torque import excess_torque
from laufruhe.physics.uneven_speed import uneven_geared_loads, uneven_loads, uneven_rotor_loads

_Parts: TypeAlias = tuple[complex, ...]


def shaking_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the wrench (Fx, Fy, Fz, Mx, My, Mz) on the block from gas and moving masses, (n, 6) [N, N m] (C7).

    It is about the origin of C2.

    Raises
    ------
    ModelError
        If the gas model cannot be met, or a gas-loaded cylinder has no bore.
    """
    if fidelity.has_uneven_speed:
        return uneven_loads(engine, point, fidelity)
    gas, cycle, square = fidelity.gas_of(point), engine.cycle, point.speed**2
    total = _moving_loads(cycle, engine.slider_cranks, fidelity).mapped(lambda loads: square * loads)
    total += rotor_loads((*engine.pins, *engine.rotors), point.speed, cycle)
    total = with_machines(total, engine, point)
    if gas is not None:
        total += fidelity.truncated(gas_loads(engine, gas, fidelity, point.fmep))
    return total + added_geared_loads(engine, point, fidelity) if engine.geared else total


@lru_cache(maxsize=64)
def _moving_loads(cycle: Cycle, parts: tuple[SliderCrank, ...], fidelity: Fidelity) -> Spectrum:
    # pistons and rods at unit speed
    return fidelity.truncated(star_loads(cycle, parts, 1.0, lambda part: chain(*effects_of(part, fidelity))))


def forget() -> None:
    """Clear the caches of loads, for timing."""
    _moving_loads.cache_clear()
    forget_gas()


def reciprocating_loads(engine: Engine, speed: float, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the inertia loads of reciprocating masses: F = -m s'' and its roll moment (L2, L3, L7)."""
    return star_loads(engine.cycle, engine.slider_cranks, speed, lambda part: effects_of(part, fidelity)[0])


def rotor_loads(rotors: Iterable[Rotor], speed: float, cycle: Cycle) -> Spectrum:
    """Return F = U (n w)^2 e^{i n phi} of the rotors with its moments, shape (n, 6) [N, N m] (L1).

    It is linear in the unbalances and their conjugates.
    """
    turning = tuple(rotors)
    if not turning:
        return Spectrum(cycle.base_order, np.zeros((1, 6), dtype=complex))
    wrenches = np.array([_wrench(rotor, speed) for rotor in turning], dtype=complex)
    indices = tuple(order_index(cycle, abs(rotor.shaft.ratio)) for rotor in turning)
    return Spectrum(cycle.base_order, cancelling_sums(wrenches, indices))


def added_geared_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the loads of the geared inertia of an engine, at even or uneven speed (L8, F5)."""
    if fidelity.has_uneven_speed:
        return uneven_geared_loads(engine, point, fidelity)
    return geared_moment(engine, excess_torque(engine, point, fidelity))


def added_rotor_loads(
    rotors: Sequence[Rotor], engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT
) -> Spectrum:
    """Return the loads that rotors add to an engine at an operating point, at even or uneven speed (L1, F5)."""
    if fidelity.has_uneven_speed:
        return uneven_rotor_loads(rotors, engine, point, fidelity)
    return rotor_loads(rotors, point.speed, engine.cycle)


def rotor_wrench(rotor: Rotor, speed: float) -> ComplexArray:
    """Return the coefficient of order |n| of one rotor's wrench, shape (6,) (L1)."""
    return np.array(_wrench(rotor, speed), dtype=complex)


def _wrench(rotor: Rotor, speed: float) -> _Parts:
    shaft, forward = rotor.shaft, rotor.shaft.ratio > 0.0
    force = (shaft.ratio * speed) ** 2 * (rotor.unbalance if forward else rotor.unbalance.conjugate())
    return plane_parts(force * (-1j if forward else 1j), force, rotor.x, shaft)
