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
from laufruhe.physics.mechanism import momentum_loads
from laufruhe.physics.wrench import plane_wrench

Array = NDArray[np.float64]

_ROUNDS = 60
_CONVERGED = 1e-14


@dataclass(frozen=True, eq=False)
class CrankMotion:
    """Periodic motion of the crank at equal steps of time over one cycle.

    Attributes
    ----------
    angle
        Crank angle phi [rad], shape (n,).
    speed
        d phi / dt [rad/s].
    acceleration
        d2 phi / dt2 [rad/s2].
    """

    angle: Array
    speed: Array
    acceleration: Array

    @property
    def unevenness(self) -> float:
        """Largest less smallest speed over the mean, the degree of irregularity."""
        return float((self.speed.max() - self.speed.min()) / self.speed.mean())


def crank_motion(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> CrankMotion:
    """Motion under gas and inertia torque against a constant load torque (F2-F4).

    Parameters
    ----------
    engine
        Slider-cranks; inertia of what turns is in the fidelity.
    point
        Mean speed and working gas.
    fidelity
        Crank inertia, rod model, gas, and steps.

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
    work = _work(engine, point, fidelity, phi)
    inertia, _ = _inertia(engine, fidelity, phi)
    start = _start_energy(work, inertia, point.speed)
    pace = spectrum_of(point.speed / np.sqrt(2.0 * (start + work) / inertia), engine.cycle.base_order)
    angle = _angles_at(pace, phi)
    work_series, torque = _work_series(engine, point, fidelity)
    work = work_series.values(angle) if work_series is not None else np.zeros(count)
    inertia, slope = _inertia(engine, fidelity, angle)
    square = 2.0 * (start + work) / inertia
    drive = torque.values(angle) if torque is not None else np.zeros(count)
    # d/d phi of J w^2 / 2 = torque less load (F2)
    acceleration = (drive - 0.5 * slope * square) / inertia
    motion = CrankMotion(angle, np.sqrt(square), acceleration)
    for values in (motion.angle, motion.speed, motion.acceleration):
        values.setflags(write=False)
    return motion


def uneven_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Wrench on the block at a crank speed that varies (F5).

    Returns
    -------
    Spectrum of shape (n, 6) [N, N m] in orders of the mean speed. Its sums are taken at
    sampled times: what a star cancels is zero to rounding only.
    """
    motion = crank_motion(engine, point, fidelity)
    wrench = sum(
        (_slider_loads(part, motion, fidelity) for part in engine.slider_cranks), np.zeros((len(motion.angle), 6))
    )
    wrench = wrench + _rotor_loads((*engine.pins, *engine.rotors), motion)
    _, torque = _work_series(engine, point, fidelity)
    if torque is not None:
        wrench[:, 3] += torque.values(motion.angle)
    gas = fidelity.gas_of(point)
    if gas is not None:
        wrench[:, 3] += gas_loads(engine, gas, fidelity).coefficients[0, 3].real
    last_rotor = max((math.ceil(abs(rotor.shaft.ratio)) for rotor in engine.rotors), default=1)
    return fidelity.kept(spectrum_of(wrench, engine.cycle.base_order), last_rotor)


def uneven_rotor_loads(rotors: Sequence[Rotor], engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Loads of rotors alone on an engine whose motion they do not change; linear in their unbalances (F5)."""
    motion = crank_motion(engine, point, fidelity)
    return spectrum_of(_rotor_loads(rotors, motion), engine.cycle.base_order)


def _work_series(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> tuple[Spectrum | None, Spectrum | None]:
    """Work of gas less load over the crank angle, and the torque that does it (F2)."""
    gas = fidelity.gas_of(point)
    if gas is None:
        return None, None
    # the roll moment of the gas is its torque (L5); the load takes the mean of it
    torque = gas_loads(engine, gas, fidelity).coefficients[:, 3].copy()
    torque[0] = 0.0
    orders = np.arange(len(torque)) * float(engine.cycle.base_order)
    work = np.zeros_like(torque)
    work[1:] = torque[1:] / (1j * orders[1:])
    return Spectrum(engine.cycle.base_order, work), Spectrum(engine.cycle.base_order, torque)


def _work(engine: Engine, point: OperatingPoint, fidelity: Fidelity, phi: Array) -> Array:
    work, _ = _work_series(engine, point, fidelity)
    return np.zeros(len(phi)) if work is None else work.sample(len(phi))


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
    orders = pace.orders
    shift = np.zeros_like(pace.coefficients)
    shift[1:] = pace.coefficients[1:] / (1j * orders[1:])
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
    force, roll, rods = momentum_loads(part, part.motion(np, _alpha(part, motion.angle)), square, turning)
    force = force * cis(as_turn(part.bank))
    wrench = plane_wrench(force.imag, force.real, part.x, part.shaft).T
    wrench[:, 3] += roll + rods if fidelity.rod == "rigid" else roll
    return wrench


def _rotor_loads(rotors: Sequence[Rotor], motion: CrankMotion) -> Array:
    """F = U (n^2 w^2 - i n dw/dt) e^{i n phi} of each rotor, with its moments (F5), shape (n, 6)."""
    wrench = np.zeros((len(motion.angle), 6))
    for rotor in rotors:
        ratio = rotor.shaft.ratio
        force = rotor.unbalance * ((ratio * motion.speed) ** 2 - 1j * ratio * motion.acceleration)
        force = force * np.exp(1j * ratio * motion.angle)
        wrench += plane_wrench(force.imag, force.real, rotor.x, rotor.shaft).T
    return wrench
