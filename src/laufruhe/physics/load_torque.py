"""Alternating torque of the driven machine (T12).

The mean torque of the load is that of the engine, because the mean speed is constant. What remains is the difference of
the curve from its own mean, and excites the crank against the torque of the engine.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, LoadTorque
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.pressure_trace import periodic_cubics


def less_load(torque: Spectrum, engine: Engine, fidelity: Fidelity) -> Spectrum:
    """Return a torque on the crank less the alternating torque of the load, shape (n,) [N m] (T12)."""
    if engine.load_torque is None:
        return torque
    return torque + fidelity.truncated(_alternating(engine.load_torque, engine.cycle, fidelity.gas_steps))


@lru_cache(maxsize=16)
def _alternating(load: LoadTorque, cycle: Cycle, samples: int) -> Spectrum:
    angles = cycle.angle * np.arange(samples) / samples
    torques = periodic_cubics(np.array(load.angles), np.array(load.torques), cycle, angles, load.periods)
    return spectrum_of(-torques, cycle.base_order).without_mean
