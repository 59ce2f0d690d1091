"""Roll moment of the working gas less that of friction, order by order (L5, L5b)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, GasModel, SliderCrank
from laufruhe.machine.slider_crank import displacement
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.exact_angles import Turn, as_turn, star_orders
from laufruhe.numerics.spectrum import Spectrum, spectrum_with_kinks
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.rigid_body import ROLL
from laufruhe.physics.willans import mean_torque


def gas_loads(engine: Engine, gas: GasModel, fidelity: Fidelity = EXACT, fmep: float = 0.0) -> Spectrum:
    """Return the wrench of the gas: a roll moment, the reaction to its crank torque less friction (L5, L5b; eq. 1).

    Friction has a mean pressure `fmep` [Pa].
    """
    loads = _gas_loads(engine.cycle, engine.slider_cranks, gas, fidelity)
    if fmep == 0.0:
        return loads
    friction = mean_torque(fmep, displacement(engine.slider_cranks), engine.cycle.turns)
    return loads + Spectrum(engine.cycle.base_order, np.array([-friction * ROLL], dtype=complex))


@lru_cache(maxsize=64)
def _gas_loads(cycle: Cycle, parts: tuple[SliderCrank, ...], gas: GasModel, fidelity: Fidelity) -> Spectrum:
    # equal mechanisms differ only in their firing angles
    alike: dict[Hashable, list[SliderCrank]] = defaultdict(list)
    for part in parts:
        alike[gas.alike(part), part.shaft.ratio].append(part)
    total = Spectrum(cycle.base_order, np.zeros(1, dtype=complex))
    for star in alike.values():
        # torque of one cylinder at the firing angles of several
        torque, firing = gas_coefficients(gas, star[0], cycle, fidelity), tuple(part.firing_angle for part in star)
        phases = star_orders(np.ones((len(star), 1)), _delays(firing, cycle.turns), len(torque.coefficients))[:, 0]
        kinks = torque.kinks and torque.kinks.repeated(firing, cycle.angle)
        total = total + Spectrum(cycle.base_order, torque.coefficients * phases, kinks)
    return total.mapped(lambda moment: moment[:, None] * ROLL)


def forget_gas() -> None:
    """Clear the cache of stars of gas torque, for timing."""
    _gas_loads.cache_clear()


@lru_cache(maxsize=256)
def _delays(firing: tuple[float, ...], turns: int) -> tuple[Turn, ...]:
    return tuple(-as_turn(angle) / turns for angle in firing)


def gas_coefficients(gas: GasModel, part: SliderCrank, cycle: Cycle, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the roll moment of one cylinder's gas [N m] by order, shape (n,) (L5).

    Angles count from its firing: a cylinder that fires at phi_k has these coefficients times e^{-i h phi_k}.
    """
    key = _CylinderKey((type(part), gas.alike(part), part.shaft.ratio), part)
    return fidelity.truncated_gas(_one_cylinder(gas.of_cylinder(part.name), key, cycle, fidelity.gas_steps))


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

    torque = spectrum_with_kinks(torque_at, samples, cycle.base_order, gas.breaks(part, cycle))
    torque.coefficients.setflags(write=False)
    return torque


def chamber_torque(gas: GasModel, part: SliderCrank, cycle: Cycle, since: Array) -> Array:
    """Return the torque of a piston or one rotor chamber at crank angles after it fired [N m] (L5, Y4)."""
    piston, pace = part.swept.piston, part.swept.pace
    alpha = piston.fires_at + piston.shaft.ratio * pace * since
    return np.asarray(pace * piston.shaft.ratio * gas.thrust(part, cycle, since) * piston.velocity(np, alpha))
