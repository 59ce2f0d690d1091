"""Alternating torques of the driven machine (T12) and of machines of extensions (T16).

The mean torque of the load is that of the engine, because the mean speed is constant. What remains is the difference of
the curve from its own mean, and excites the crank against the torque of the engine. A machine whose stator is on the
block excites the block too.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, LoadTorque, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.measured_cycle import periodic_cubics
from laufruhe.physics.rigid_body import ROLL


def less_load(torque: Spectrum, engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return a torque on the crank with the alternating ones of load and machines, shape (n,) [N m] (T12, T16)."""
    return sum((alternating for _, alternating in load_torques(engine, point, fidelity)), torque)


def load_torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> list[tuple[str, Spectrum]]:
    """Return the alternating torques of load and machines on the crank, each with its disc, (n,) [N m] (T12, T16).

    The name of the disc is empty for the one of the load.
    """
    torques = [(torque.disc, torque.on_crank.without_mean) for torque in engine.torques(point)]
    if engine.load_torque is not None:
        load = _alternating(engine.load_torque, engine.cycle, fidelity.gas_steps)
        torques.append(("", fidelity.truncated(load)))
    return torques


def machine_moment(engine: Engine, point: OperatingPoint) -> Spectrum:
    """Return the roll moment of machines on the block, shape (n,) [N m] (T16)."""
    zero = Spectrum(engine.cycle.base_order, np.zeros(1, dtype=complex))
    return sum((torque.on_block for torque in engine.torques(point)), zero)


def with_machines(wrench: Spectrum, engine: Engine, point: OperatingPoint) -> Spectrum:
    """Return a wrench on the block with the roll moment of machines, shape (n, 6) [N, N m] (T16)."""
    if not engine.torques(point):
        return wrench
    return wrench + machine_moment(engine, point).mapped(lambda values: values[:, None] * ROLL)


@lru_cache(maxsize=16)
def _alternating(load: LoadTorque, cycle: Cycle, samples: int) -> Spectrum:
    angles = cycle.angle * np.arange(samples) / samples
    torques = periodic_cubics(np.array(load.angles), np.array(load.torques), cycle, angles, load.periods)
    return spectrum_of(-torques, cycle.base_order).without_mean
