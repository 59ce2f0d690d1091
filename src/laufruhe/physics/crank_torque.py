"""Torque of the crankshaft over the cycle (T1)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.mechanism import TWO_ORDER_ROLL, Direction, Effect, reduced, resolved_orders, two_order_roll
from laufruhe.physics.star_loads import star_loads
from laufruhe.physics.wrench import ROLL


def crank_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of gas, pistons and rods on the crankshaft at even speed, as it drives the output (T1).

    Returns
    -------
    Spectrum of shape (n,) [N m].
    """
    gas = fidelity.gas_of(point)
    masses = fidelity.kept(star_loads(engine, point.speed, lambda part: (_of_masses(part, fidelity),)))
    total = masses if gas is None else masses + fidelity.kept(gas_loads(engine, gas, fidelity))
    return total.each(lambda wrench: wrench @ ROLL)


def cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity = EXACT) -> ComplexArray:
    """Return the coefficients of one cylinder's torque by order of the cycle [N m], counted from its firing (T1)."""
    first = replace(part, name="cylinder", x=0.0, throw=part.bank + part.fires_at, firing_angle=0.0)
    return _cylinder_torque(cycle, first, replace(point, name="", weight=1.0), fidelity)


@lru_cache(maxsize=256)
def _cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity) -> ComplexArray:
    found = crank_torque(Engine("one cylinder", cycle, (part,)), point, fidelity)
    series = found.rebased(cycle.base_order).coefficients
    series.setflags(write=False)
    return series


def _of_masses(part: SliderCrank, fidelity: Fidelity) -> Effect:
    """Return the torque at unit speed of the mechanism's own crank, in the sense of the output (T1)."""
    is_rigid, is_short = fidelity.rod == "rigid", fidelity.kinematics == "two-order"
    key = "torque", replace(part, name="", x=0.0, throw=0.0, bank=0.0, firing_angle=0.0), is_rigid, is_short

    def torque(alpha: np.ndarray) -> tuple[np.ndarray]:
        _, slope = reduced(part.motion(np, alpha), is_rigid)
        return (-0.5 * part.shaft.ratio * slope,)

    def series() -> ComplexArray:
        if is_short and type(part) is SliderCrank:
            return part.reciprocating_mass * part.crank_radius**2 * part.shaft.ratio * two_order_roll(part.rod_ratio)
        table = np.asarray(resolved_orders(torque, np.ones((1, 1)), part.name)[0])
        return table[: TWO_ORDER_ROLL + 1] if is_short else table

    return Effect(Direction.ROLL, 1.0, key, series)
