"""Torque of the weight of everything that moves (T14).

All that moves turns with the crank, so that its potential energy V is a function of the crank angle. Its torque on the
crank is -dV/dphi, at any speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, Engine, Rotor, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.modes import GRAVITY

_STEPS = 720


def with_gravity(torque: Spectrum, engine: Engine, fidelity: Fidelity) -> Spectrum:
    """Return a torque on the crank with that of the weights if the engine counts them, shape (n,) [N m] (T14)."""
    if not engine.gravity:
        return torque
    rotors = (*engine.pins, *engine.rotors)
    return torque + fidelity.truncated(_gravity_torque(engine.cycle, engine.slider_cranks, rotors))


@lru_cache(maxsize=64)
def _gravity_torque(cycle: Cycle, parts: tuple[SliderCrank, ...], rotors: tuple[Rotor, ...]) -> Spectrum:
    energy = potential_energy(parts, rotors, cycle.angle * np.arange(_STEPS) / _STEPS)
    return spectrum_of(-energy, cycle.base_order).derivative


def potential_energy(parts: Sequence[SliderCrank], rotors: Sequence[Rotor], angles: Array) -> Array:
    """Return the potential energy at crank angles but for a constant [J], shape of `angles` (T14)."""
    height = np.zeros(len(angles))
    for rotor in rotors:
        height += (rotor.unbalance * np.exp(1j * rotor.shaft.ratio * angles)).real
    for part in parts:
        alpha = part.shaft.ratio * angles + (part.throw - part.bank)
        for mass, (place, *_) in part.motion(np, alpha).points:
            height += (mass * place * cis(as_turn(part.bank))).real
    return GRAVITY * height
