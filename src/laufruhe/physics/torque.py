"""Torque of the crankshaft over the cycle, and inertia of all that turns with it (T1, T2, V1, V14).

    T = -A (p - p_crankcase) ds/dphi - (1/2) w^2 dJ/dphi                     (T1; textbook eqs. 18 to 20)

with J the inertia of pistons and rods reduced to the crank (F3): what they store, they take from the torque. The load
takes its mean, and has an alternating torque of its own if it is not constant (T12). The rest is stored and comes back,
and what has to be stored is the largest less the smallest of its integral (T2; textbook 2.7, example 4).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from laufruhe.machine import Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.gravity import with_gravity
from laufruhe.physics.load_torque import less_load
from laufruhe.physics.mechanism import TWO_ORDER_ROLL, Direction, Effect, orders_of_masses, reduced, two_order_roll
from laufruhe.physics.rigid_body import ROLL
from laufruhe.physics.star_loads import star_loads

FINE_SPEED = 4
"""Times as many steps as the fidelity has, at which the ends of the speed are sought."""


def crank_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of gas, pistons and rods, less friction, at the output at even speed, (n,) [N m] (T1, L5b)."""
    gas = fidelity.gas_of(point)
    masses = fidelity.truncated(
        star_loads(engine.cycle, engine.slider_cranks, point.speed, lambda part: (_of_masses(part, fidelity),))
    )
    total = masses if gas is None else masses + fidelity.truncated(gas_loads(engine, gas, fidelity, point.fmep))
    return total.mapped(lambda wrench: wrench @ ROLL)


def excess_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of crank and weights less the alternating torque of the load, (n,) [N m] (T12, T14)."""
    return with_gravity(less_load(crank_torque(engine, point, fidelity), engine, point, fidelity), engine, fidelity)


def cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity = EXACT) -> ComplexArray:
    """Return the coefficients of one cylinder's torque by order of the cycle [N m], counted from its firing (T1)."""
    first = replace(part, x=0.0, throw=part.bank + part.fires_at, firing_angle=0.0)
    return _cylinder_torque(cycle, first, replace(point, name="", weight=1.0), fidelity)


@lru_cache(maxsize=256)
def _cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity) -> ComplexArray:
    torque = crank_torque(Engine("one cylinder", cycle, (part,)), point, fidelity)
    series = torque.with_finer_base(cycle.base_order).coefficients
    series.setflags(write=False)
    return series


def _of_masses(part: SliderCrank, fidelity: Fidelity) -> Effect:
    """Return the torque at unit speed of the mechanism's own crank, in the sense of the output (T1)."""
    is_rigid, is_short = fidelity.rod == "rigid", fidelity.kinematics == "two-order"
    key = "torque", replace(part, name="", x=0.0, throw=0.0, bank=0.0, firing_angle=0.0), is_rigid, is_short

    def series() -> ComplexArray:
        if is_short and type(part) is SliderCrank:
            return part.reciprocating_mass * part.crank_radius**2 * part.shaft.ratio * two_order_roll(part.rod_ratio)
        tables = orders_of_masses(part, _torque_rows, (2, 2))
        table: ComplexArray = tables.sum(axis=0) if is_rigid else tables[0]
        return table[: TWO_ORDER_ROLL + 1] if is_short else table

    return Effect(Direction.ROLL, 1.0, key, series)


def _torque_rows(part: SliderCrank, alpha: Array) -> tuple[Any, Any]:
    # torque of point masses and of swings
    motion = part.motion(np, alpha)
    (_, total), (_, points) = reduced(motion), reduced(motion, with_rods=False)
    factor = -0.5 * part.shaft.ratio
    return factor * points, factor * (total - points)


_STEPS = 1024


def reduced_inertia(part: SliderCrank) -> float:
    """Return the mean inertia of piston, rod and pin mass reduced to the crank [kg m2] (V1; textbook 2.9).

    With a long rod half the reciprocating mass at the crank radius.
    """
    return _reduced_inertia(replace(part, name="", x=0.0, throw=part.bank, firing_angle=0.0))


@lru_cache(maxsize=256)
def _reduced_inertia(part: SliderCrank) -> float:
    inertia, _ = reduced(part.motion(np, 2.0 * math.pi * np.arange(_STEPS) / _STEPS))
    return part.rotating_mass * part.crank_radius**2 + float(np.mean(inertia * np.ones(_STEPS)))


def turning_inertia(engine: Engine, fidelity: Fidelity) -> float | None:
    """Return the moment of inertia of all rotating parts, without pistons and rods [kg m2]; None if it is unknown."""
    return fidelity.crank_inertia if fidelity.has_uneven_speed else engine.turning_inertia
