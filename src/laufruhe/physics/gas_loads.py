"""Roll moment of the working gas, order by order (L5)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Cycle, Engine, GasModel, SliderCrank
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.numerics.turns import Turn, as_turn, star_sum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_cycle import cylinder_pressure
from laufruhe.physics.wrench import ROLL


def gas_loads(engine: Engine, gas: GasModel, fidelity: Fidelity = EXACT) -> Spectrum:
    """Roll moment of the gas, the reaction to its crank torque (L5; eq. 1). No net force."""
    turns = engine.cycle.turns
    # equal mechanisms differ only in when they fire
    alike: dict[Hashable, list[SliderCrank]] = defaultdict(list)
    for part in engine.slider_cranks:
        alike[part.path, part.bore, part.shaft.ratio].append(part)
    total = Spectrum(engine.cycle.base_order, np.zeros((1, 6), dtype=complex))
    for parts in alike.values():
        torque = gas_coefficients(gas, parts[0], engine.cycle, fidelity)
        delays: list[Turn] = [-as_turn(part.firing_angle) / turns for part in parts]
        multiples = np.arange(len(torque.coefficients))
        star = star_sum(np.tile(ROLL, (len(parts), 1)), delays, multiples)
        total = total + Spectrum(engine.cycle.base_order, torque.coefficients[:, None] * star)
    return total


def gas_coefficients(gas: GasModel, part: SliderCrank, cycle: Cycle, fidelity: Fidelity = EXACT) -> Spectrum:
    """Roll moment of one cylinder's gas [N m] by order, from its firing dead centre on (L5), shape (n,).

    A cylinder that fires at phi_k has these coefficients times e^{-i h phi_k}.
    """
    return fidelity.kept_of_gas(spectrum_of(gas_torque(gas, part, cycle, fidelity.gas_steps), cycle.base_order))


def gas_torque(gas: GasModel, part: SliderCrank, cycle: Cycle, samples: int) -> NDArray[np.float64]:
    """Torque of one cylinder's gas on the engine's output, -n A (p - p_crankcase) ds/dalpha (L5).

    Returns
    -------
    Shape (samples,) [N m], at equal steps over the cycle from the firing dead centre.
    """
    pressure = cylinder_pressure(gas, part, cycle, samples) - gas.crankcase_pressure
    alpha = part.fires_at + part.shaft.ratio * cycle.angle * np.arange(samples) / samples
    return np.asarray(-part.shaft.ratio * part.piston_area * pressure * part.velocity(np, alpha))
