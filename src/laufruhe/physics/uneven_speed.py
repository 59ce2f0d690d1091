"""Loads of an engine whose crank speeds up and slows down within the cycle (F2-F5).

Gas and load torque are functions of the crank angle, so the energy of everything that
moves is too, and speed follows from it without a differential equation. One number is
left, the energy at the start of the cycle, and the mean speed determines it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.numerics.spectrum import Spectrum, spectrum_of, spectrum_with_kinks
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.geared_inertia import geared_factor
from laufruhe.physics.gravity import with_gravity
from laufruhe.physics.load_torque import less_load, machine_moment
from laufruhe.physics.mechanism import cylinder_wrench, reduced
from laufruhe.physics.rigid_body import ROLL, plane_wrench

_ROUNDS = 60
_CONVERGED = 1e-14


@dataclass(frozen=True, eq=False)
class CrankMotion:
    """Crank angle phi, and its derivatives, at times over one cycle [rad, rad/s, rad/s2]."""

    angle: Array
    speed: Array
    acceleration: Array

    @property
    def unevenness(self) -> float:
        """Degree of irregularity: speed range over the mean."""
        return float((self.speed.max() - self.speed.min()) / self.speed.mean())


@dataclass(frozen=True, eq=False)
class _Turning:
    """Solution that gives the motion at any time (F2-F4); times are angles at the mean speed [rad]."""

    engine: Engine
    fidelity: Fidelity
    torque: Spectrum
    start: float
    pace: Spectrum

    def at(self, times: Array) -> CrankMotion:
        """Return the motion at some times."""
        return _motion_at(self, times.tobytes())

    def loads(self, wrench: Callable[[CrankMotion], Array]) -> Spectrum:
        """Return the loads (n, 6) of a wrench that follows from the motion (F5), in orders of the mean speed."""
        steps, bends = self.fidelity.samples, np.zeros(0)
        if self.torque.kinks is not None:
            # times of kinks of the gas torque, and so of the acceleration
            angles, shift = self.torque.kinks.angles, self.pace.integral
            bends = angles + shift.values(angles) - shift.values(np.zeros(1))
        return spectrum_with_kinks(lambda times: wrench(self.at(times)), steps, self.torque.base, bends, len(bends))


def crank_motion(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> CrankMotion:
    """Return the motion under gas, inertia and load torque, at equal time steps (F2-F4)."""
    return _turning(engine, point, fidelity).at(_steps(engine, fidelity))


def _steps(engine: Engine, fidelity: Fidelity) -> Array:
    return engine.cycle.angle * np.arange(fidelity.samples) / fidelity.samples


def _turning(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> _Turning:
    # rotors and mounts do not move the crank; without them a motion is found once for all designs
    return _compute_turning(replace(engine, rotors=(), mounts=(), geared=()), point, fidelity)


@lru_cache(maxsize=32)
def _compute_turning(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> _Turning:
    phi, torque = _steps(engine, fidelity), driving_torque(engine, point, fidelity)
    # F2: the load takes the mean of the torque
    torque = torque.with_coefficients(np.concatenate([[0.0], torque.coefficients[1:]]))
    work, (inertia, _) = torque.integral.sample(fidelity.samples), _inertia(engine, fidelity, phi)
    start = start_energy(work, inertia, point.speed)
    pace = spectrum_of(point.speed / np.sqrt(2.0 * (start + work) / inertia), engine.cycle.base_order)
    return _Turning(engine, fidelity, torque, start, pace)


@lru_cache(maxsize=64)
def _motion_at(turning: _Turning, times: bytes) -> CrankMotion:
    torque, instants = turning.torque, np.frombuffer(times)
    # crank angles at these times: the inverse of t(phi), whose derivative is the pace, by Newton's method
    shift = turning.pace.integral.coefficients
    series = Spectrum(turning.pace.base, np.stack([shift, turning.pace.coefficients], axis=1))
    origin, angle = float(shift.sum().real), instants.copy()
    for _ in range(_ROUNDS):
        values = series.values(angle)
        step = (instants - (angle + values[:, 0] - origin)) / values[:, 1]
        angle = angle + step
        if float(np.abs(step).max()) <= 1e-13:
            break
    inertia, slope = _inertia(turning.engine, turning.fidelity, angle)
    square = 2.0 * (turning.start + torque.integral.values(angle)) / inertia
    # d/d phi of J w^2 / 2 = torque less load (F2)
    acceleration = (torque.values(angle) - 0.5 * slope * square) / inertia
    motion = CrankMotion(angle, np.sqrt(square), acceleration)
    for values in (motion.angle, motion.speed, motion.acceleration):
        values.setflags(write=False)
    return motion


def uneven_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the wrench on the block, shape (n, 6), in orders of the varying speed's mean (F5).

    Its sums are taken at sampled times: what a star cancels is zero to rounding only.
    """
    torque = gas_torque(engine, point, fidelity) + machine_moment(engine, point)

    def wrench(motion: CrankMotion) -> Array:
        total = _rotor_loads((*engine.pins, *engine.rotors), motion)
        for part in engine.slider_cranks:
            # L7 with both terms of the second derivative by time
            square, turning = (part.shaft.ratio * motion.speed) ** 2, part.shaft.ratio * motion.acceleration
            moving, axis = part.motion(np, _alpha(part, motion.angle)), cis(as_turn(part.bank))
            total += cylinder_wrench(part, moving, axis, square, turning, with_rods=fidelity.rod == "rigid").T
        total[:, 3] += torque.values(motion.angle)
        # geared inertia accelerates with the crank (L8)
        total[:, 3] += geared_factor(engine) * fidelity.crank_inertia * motion.acceleration
        return total

    last_rotor = max((math.ceil(abs(rotor.shaft.ratio)) for rotor in engine.rotors), default=1)
    return fidelity.truncated(_turning(engine, point, fidelity).loads(wrench), last_rotor)


def uneven_rotor_loads(rotors: Sequence[Rotor], engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the loads of rotors alone, which do not change the motion; linear in unbalances (F5)."""
    return _turning(engine, point, fidelity).loads(lambda motion: _rotor_loads(rotors, motion))


def uneven_geared_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the loads of the geared inertia alone (F5, L8)."""
    gain = geared_factor(engine) * fidelity.crank_inertia
    return _turning(engine, point, fidelity).loads(lambda motion: gain * motion.acceleration[:, None] * ROLL)


def gas_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the gas torque less friction over the crank angle [N m], as the roll moment of the gas (L5, L5b)."""
    gas, cycle = fidelity.gas_of(point), engine.cycle
    if gas is None:
        return Spectrum(cycle.base_order, np.zeros(1, dtype=complex))
    return gas_loads(engine, gas, fidelity, point.fmep).mapped(lambda loads: loads[:, 3])


def driving_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the torque of gas and weights less the alternating torque of the load [N m] (T12, T14)."""
    return with_gravity(less_load(gas_torque(engine, point, fidelity), engine, point, fidelity), engine, fidelity)


def _inertia(engine: Engine, fidelity: Fidelity, phi: Array) -> tuple[Array, Array]:
    # F3: inertia reduced to the crank, and its derivative by the crank angle, shape of `phi`
    total, slope = moving_inertia(engine, fidelity, phi)
    total = total + fidelity.crank_inertia
    if total.min() <= 0.0:
        raise ModelError("the moving parts have no positive inertia; raise the crank inertia")
    return total, slope


def moving_inertia(engine: Engine, fidelity: Fidelity, phi: Array) -> tuple[Array, Array]:
    """Return the inertia of pistons and rods, reduced to the crank [kg m2], and its derivative by crank angle (F3)."""
    total, slope = np.zeros(len(phi)), np.zeros(len(phi))
    for part in engine.slider_cranks:
        ratio, (inertia, steep) = part.shaft.ratio, reduced(part.motion(np, _alpha(part, phi)), fidelity.rod == "rigid")
        total, slope = total + ratio**2 * inertia, slope + ratio**3 * steep
    return total, slope


def start_energy(work: Array, inertia: Array, speed: float) -> float:
    """Return the energy at the start of the cycle for the mean speed (F4), by safeguarded Newton steps.

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


def _alpha(part: SliderCrank, phi: Array) -> Array:
    return np.asarray(part.shaft.ratio * phi + (part.throw - part.bank))


def _rotor_loads(rotors: Sequence[Rotor], motion: CrankMotion) -> Array:
    # F5: F = U (n^2 w^2 - i n dw/dt) e^{i n phi} of each rotor, with its moments, shape (n, 6)
    wrench = np.zeros((len(motion.angle), 6))
    for rotor in rotors:
        ratio = rotor.shaft.ratio
        force = rotor.unbalance * ((ratio * motion.speed) ** 2 - 1j * ratio * motion.acceleration)
        force = force * np.exp(1j * ratio * motion.angle)
        wrench += plane_wrench(force.imag, force.real, rotor.x, rotor.shaft).T
    return wrench
