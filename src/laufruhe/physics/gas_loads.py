"""Roll moment of the working gas, order by order (L5)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, GasModel, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.exact_angles import Turn, as_turn, star_sum
from laufruhe.numerics.kinks import join_kinks
from laufruhe.numerics.spectrum import Spectrum, spectrum_with_kinks
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_cycle import alike_under, pressure_breaks, thrust_at
from laufruhe.physics.rigid_body import ROLL


def gas_loads(engine: Engine, gas: GasModel, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the wrench of the gas: a roll moment, the reaction to its crank torque (L5; eq. 1)."""
    turns = engine.cycle.turns
    # equal mechanisms differ only in their firing angles
    alike: dict[Hashable, list[SliderCrank]] = defaultdict(list)
    for part in engine.slider_cranks:
        alike[alike_under(gas, part), part.shaft.ratio].append(part)
    total = Spectrum(engine.cycle.base_order, np.zeros((1, 6), dtype=complex))
    for parts in alike.values():
        torque = gas_coefficients(gas, parts[0], engine.cycle, fidelity)
        delays: list[Turn] = [-as_turn(part.firing_angle) / turns for part in parts]
        multiples = np.arange(len(torque.coefficients))
        star = star_sum(np.tile(ROLL, (len(parts), 1)), delays, multiples)
        load = Spectrum(engine.cycle.base_order, torque.coefficients[:, None] * star)
        if torque.kinks is not None:
            rolling = torque.kinks.mapped(lambda jumps: jumps[:, None] * ROLL)
            kinks = join_kinks([rolling.shift(part.firing_angle) for part in parts] if rolling else [])
            load = replace(load, kinks=kinks and kinks.folded(load.period, 1))
        total = total + load
    return total


def gas_coefficients(gas: GasModel, part: SliderCrank, cycle: Cycle, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the roll moment of one cylinder's gas [N m] by order, shape (n,) (L5).

    Angles count from its firing: a cylinder that fires at phi_k has these coefficients times e^{-i h phi_k}.
    """
    key = _CylinderKey((type(part), alike_under(gas, part), part.shaft.ratio), part)
    return fidelity.truncated_gas(_one_cylinder(gas, key, cycle, fidelity.gas_steps))


@dataclass(frozen=True)
class _CylinderKey:
    """Cache key of a cylinder: equal for equal gas forces, at any mass, place and firing angle."""

    alike: Hashable
    part: SliderCrank = field(compare=False)


@lru_cache(maxsize=64)
def _one_cylinder(gas: GasModel, key: _CylinderKey, cycle: Cycle, samples: int) -> Spectrum:
    # the kinks of the torque are taken out before the transform (L5a)
    part = key.part

    def torque_at(angles: Array) -> Array:
        return np.asarray(np.sum([chamber_torque(gas, part, cycle, angles + lag) for lag in part.swept.lags], axis=0))

    torque = spectrum_with_kinks(torque_at, samples, cycle.base_order, pressure_breaks(gas, part, cycle))
    torque.coefficients.setflags(write=False)
    return torque


def chamber_torque(gas: GasModel, part: SliderCrank, cycle: Cycle, since: Array) -> Array:
    """Return the torque of a piston or one rotor chamber at crank angles after it fired [N m] (L5, Y4)."""
    piston, pace = part.swept.piston, part.swept.pace
    alpha = piston.fires_at + piston.shaft.ratio * pace * since
    return np.asarray(pace * piston.shaft.ratio * thrust_at(gas, part, cycle, since) * piston.velocity(np, alpha))
