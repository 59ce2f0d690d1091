"""Loads of an engine whose crank speeds up and slows down within the cycle (F2-F5).

Gas and load torque are functions of the crank angle, so the energy of everything that
moves is too, and speed follows from it without a differential equation. One number is
left, the energy at the start of the cycle, and the mean speed determines it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.numerics.turns import as_turn, cis
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.mechanism import cylinder_wrench
from laufruhe.physics.wrench import plane_wrench

Array = NDArray[np.float64]

_ROUNDS = 60
_CONVERGED = 1e-14


@dataclass(frozen=True, eq=False)
class CrankMotion:
    """Crank angle phi, and its derivatives, at equal steps of time over one cycle [rad, rad/s, rad/s2]."""

    angle: Array
    speed: Array
    acceleration: Array

    @property
    def unevenness(self) -> float:
        """Largest less smallest speed over the mean, the degree of irregularity."""
        return float((self.speed.max() - self.speed.min()) / self.speed.mean())


def crank_motion(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> CrankMotion:
    """Motion under gas and inertia torque against a constant load torque (F2-F4).

    Raises
    ------
    ModelError
        If the crank would stop within the cycle: the flywheel is too small for the speed.
    """
    # rotors and mounts do not move the crank; without them a motion is found once for all designs
    return _motion(replace(engine, rotors=(), mounts=()), point, fidelity)


@lru_cache(maxsize=32)
def _motion(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> CrankMotion:
    count = fidelity.samples
    phi = engine.cycle.angle * np.arange(count) / count
    torque = _alternating_torque(engine, point, fidelity)
    work, (inertia, _) = torque.integral, _inertia(engine, fidelity, phi)
    start = _start_energy(work.sample(count), inertia, point.speed)
    pace = spectrum_of(point.speed / np.sqrt(2.0 * (start + work.sample(count)) / inertia), engine.cycle.base_order)
    angle = _angles_at(pace, phi)
    inertia, slope = _inertia(engine, fidelity, angle)
    square = 2.0 * (start + work.values(angle)) / inertia
    # d/d phi of J w^2 / 2 = torque less load (F2)
    acceleration = (torque.values(angle) - 0.5 * slope * square) / inertia
    motion = CrankMotion(angle, np.sqrt(square), acceleration)
    for values in (motion.angle, motion.speed, motion.acceleration):
        values.setflags(write=False)
    return motion


def uneven_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Wrench on the block, shape (n, 6), in orders of the mean speed where that varies (F5).

    Its sums are taken at sampled times: what a star cancels is zero to rounding only.
    """
    motion = crank_motion(engine, point, fidelity)
    wrench = sum(
        (_slider_loads(part, motion, fidelity) for part in engine.slider_cranks), np.zeros((len(motion.angle), 6))
    )
    wrench = wrench + _rotor_loads((*engine.pins, *engine.rotors), motion)
    wrench[:, 3] += _torque(engine, point, fidelity).values(motion.angle)
    last_rotor = max((math.ceil(abs(rotor.shaft.ratio)) for rotor in engine.rotors), default=1)
    return fidelity.kept(spectrum_of(wrench, engine.cycle.base_order), last_rotor)


def uneven_rotor_loads(rotors: Sequence[Rotor], engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Loads of rotors alone on an engine whose motion they do not change; linear in their unbalances (F5)."""
    motion = crank_motion(engine, point, fidelity)
    return spectrum_of(_rotor_loads(rotors, motion), engine.cycle.base_order)


def _torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Torque of the gas over the crank angle: its roll moment (L5)."""
    gas, cycle = fidelity.gas_of(point), engine.cycle
    if gas is None:
        return Spectrum(cycle.base_order, np.zeros(1, dtype=complex))
    return Spectrum(cycle.base_order, gas_loads(engine, gas, fidelity).coefficients[:, 3])


def _alternating_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Torque of the gas less that of the load, which takes the mean of it (F2)."""
    torque = _torque(engine, point, fidelity)
    return Spectrum(torque.base, np.concatenate([[0.0], torque.coefficients[1:]]))


def _inertia(engine: Engine, fidelity: Fidelity, phi: Array) -> tuple[Array, Array]:
    """Inertia reduced to the crank, and its derivative by the crank angle (F3), shape of `phi`."""
    total, slope = np.full(len(phi), float(fidelity.crank_inertia)), np.zeros(len(phi))
    for part in engine.slider_cranks:
        ratio, motion = part.shaft.ratio, part.motion(np, _alpha(part, phi))
        for mass, (_, velocity, acceleration) in motion.points:
            total += mass * ratio**2 * np.abs(velocity) ** 2
            slope += 2.0 * mass * ratio**3 * (np.conj(velocity) * acceleration).real
        for inertia, (rate, swing) in motion.swings if fidelity.rod == "rigid" else ():
            total += inertia * ratio**2 * rate**2
            slope += 2.0 * inertia * ratio**3 * rate * swing
    if total.min() <= 0.0:
        raise ModelError("the moving parts have no positive inertia; raise the crank inertia")
    return total, slope


def _start_energy(work: Array, inertia: Array, speed: float) -> float:
    """Energy at the start of the cycle that gives the mean speed (F4), by safeguarded Newton.

    The mean of w0 / w falls with the energy and is convex, so Newton from the left of
    the root never leaves it; from the right a halved step is taken.
    """
    floor = -float(work.min())
    weight = 0.5 * speed**2 * inertia
    low, energy = floor, max(float(weight.mean()), floor * 1.5)
    for _ in range(_ROUNDS):
        above = energy + work
        if above.min() <= 0.0:
            raise ModelError("the crank would stop within the cycle; raise the crank inertia or the speed")
        pace = np.sqrt(weight / above)
        miss = float(pace.mean()) - 1.0
        if miss > 0.0:
            low = energy
        step = miss / float((0.5 * pace / above).mean())
        following = energy + step
        if following <= low:
            following = 0.5 * (energy + low)
        if abs(following - energy) <= _CONVERGED * abs(energy):
            return following
        energy = following
    raise ModelError("the crank all but stops within the cycle; raise the crank inertia or the speed")


def _angles_at(pace: Spectrum, times: Array) -> Array:
    """Crank angles at equal times: the inverse of t(phi), whose derivative is `pace`, by Newton."""
    shift = pace.integral.coefficients
    series = Spectrum(pace.base, np.stack([shift, pace.coefficients], axis=1))
    origin = float(shift.sum().real)
    angle = times.copy()
    for _ in range(_ROUNDS):
        values = series.values(angle)
        step = (times - (angle + values[:, 0] - origin)) / values[:, 1]
        angle = angle + step
        if float(np.abs(step).max()) <= 1e-13:
            break
    return angle


def _alpha(part: SliderCrank, phi: Array) -> Array:
    return np.asarray(part.shaft.ratio * phi + (part.throw - part.bank))


def _slider_loads(part: SliderCrank, motion: CrankMotion, fidelity: Fidelity) -> Array:
    """Loads of one piston and its rods, shape (n, 6): L7 with d2/dt2 in full (F5)."""
    square, turning = (part.shaft.ratio * motion.speed) ** 2, part.shaft.ratio * motion.acceleration
    moving, axis = part.motion(np, _alpha(part, motion.angle)), cis(as_turn(part.bank))
    return np.asarray(cylinder_wrench(part, moving, axis, square, turning, with_rods=fidelity.rod == "rigid").T)


def _rotor_loads(rotors: Sequence[Rotor], motion: CrankMotion) -> Array:
    """F = U (n^2 w^2 - i n dw/dt) e^{i n phi} of each rotor, with its moments (F5), shape (n, 6)."""
    wrench = np.zeros((len(motion.angle), 6))
    for rotor in rotors:
        ratio = rotor.shaft.ratio
        force = rotor.unbalance * ((ratio * motion.speed) ** 2 - 1j * ratio * motion.acceleration)
        force = force * np.exp(1j * ratio * motion.angle)
        wrench += plane_wrench(force.imag, force.real, rotor.x, rotor.shaft).T
    return wrench
