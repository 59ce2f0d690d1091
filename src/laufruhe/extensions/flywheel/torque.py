"""Torque of the crankshaft over the cycle, and fluctuation of its speed (T1-T4, T13-T16).

The degree of irregularity is exact at every inertia,

    w^2 = 2 (E + W) / (J_0 + J),   mean of w_0 / w over the angle = 1        (T3, T4)

with W the work of the gas less that of the load, and J the inertia of pistons and rods. Both are functions of the angle
alone (F2-F4), so for each inertia J_0 of all other parts one number E is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import rising_root
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gravity import with_gravity
from laufruhe.physics.load_torque import less_load
from laufruhe.physics.torque import FINE_SPEED, crank_torque, excess_torque, turning_inertia
from laufruhe.physics.uneven_speed import driving_torque, gas_torque, moving_inertia, start_energy

FINE_WORK = 8
"""Times as many steps as the fidelity has, at which the work is compared."""


@dataclass(frozen=True)
class TorqueFacts:
    """Key figures of the torque at one operating point: mean, which the load takes, and ends [N m], and power [W].

    Attributes
    ----------
    excursion
        Work that is stored and given back within the cycle [J] (T2).
    irregularity
        Largest less smallest speed over the mean speed (T3); None if the inertia of rotating parts is unknown.
    """

    mean: float
    power: float
    minimum: float
    largest: float
    excursion: float
    irregularity: float | None


@dataclass(frozen=True)
class TurningTorque:
    """Largest torque that turns the crank slowly [N m], and the crank angle at which it is needed [rad] (T15)."""

    torque: float
    angle: float


def turning_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> TurningTorque | None:
    """Return the largest torque against compression and weights, without combustion and friction (T15).

    It is None for gas whose pressure without combustion is not known.
    """
    gas = fidelity.gas_of(point)
    motored = gas and gas.motored(engine.cycle)
    if gas and not motored:
        return None
    still = with_gravity(gas_torque(engine, replace(point, gas=motored, fmep=0.0), fidelity), engine, fidelity)
    steps = FINE_WORK * fidelity.samples
    angles = np.concatenate([engine.cycle.angle * np.arange(steps) / steps, still.kink_angles])
    needed = -np.concatenate([still.sample(steps), still.values(still.kink_angles)])
    k = int(np.argmax(needed))
    return TurningTorque(max(float(needed[k]), 0.0), float(angles[k]))


def torque_parts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> dict[str, Spectrum]:
    """Return the torque of gas, of pistons and rods as point masses, of the rods' inertia, and of all (T1).

    Friction (L5b), weights of moving parts (T14), a load that is not constant (T12) and machines of extensions (T16)
    come last if they count.
    """
    total, still = crank_torque(engine, point, fidelity), replace(point, gas=None)
    masses = crank_torque(engine, still, fidelity)
    points = crank_torque(engine, still, replace(fidelity, rod="mass-only"))
    ideal = crank_torque(engine, replace(point, fmep=0.0), fidelity)
    gas, rods = ideal + masses.mapped(np.negative), masses + points.mapped(np.negative)
    parts = {"gas": gas, "pistons": points, "rods": rods, "all": total}
    mean = Spectrum(total.base, total.coefficients[:1])
    zero = mean.mapped(lambda values: 0.0 * values)
    if point.fmep:
        parts["friction"] = mean + Spectrum(ideal.base, -ideal.coefficients[:1])
    if engine.gravity:
        parts["weights"] = with_gravity(zero, engine, fidelity)
    if engine.load_torque is not None:
        load = less_load(zero, replace(engine, extras=()), point, fidelity)
        parts["load"] = mean + load.mapped(np.negative)
    if machines := [torque.on_crank for torque in engine.torques(point)]:
        parts["machines"] = sum(machines, zero)
    return parts


def torque_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> TorqueFacts:
    """Return mean, extremes and stored work of the torque, and the irregularity of the crank speed."""
    torque = crank_torque(engine, point, fidelity)
    # the torque has kinks where the gas has, and its ends may stand there
    values = np.concatenate([torque.sample(FINE_WORK * fidelity.samples), torque.values(torque.kink_angles)])
    mean = float(torque.coefficients[0].real)
    inertia = turning_inertia(engine, fidelity)
    uneven = None if inertia is None else swing_of(engine, point, fidelity).irregularity(inertia)
    return TorqueFacts(
        mean, mean * point.speed, float(values.min()), float(values.max()),
        float(np.ptp(excess_torque(engine, point, fidelity).integral.sample(FINE_WORK * fidelity.samples))), uneven,
    )  # fmt: skip


_NARROW = 1e-6
"""Relative width of an interval at the end of a range of speeds that is not divided further."""


@dataclass(frozen=True, eq=False)
class Swing:
    """Causes of the speed fluctuation of an engine at one operating point.

    Attributes
    ----------
    speed, torque
        Mean [rad/s], [N m].
    work, inertia
        W [J] and J [kg m2] at equal crank angles, shape (n,).
    bent_work, bent_inertia
        The same where the torque bends.
    """

    speed: float
    torque: float
    work: Array
    inertia: Array
    bent_work: Array
    bent_inertia: Array

    def speeds(self, inertia: float) -> Array:
        """Return the crank speed over the cycle with an inertia without pistons and rods [rad/s] (F2-F4)."""
        if inertia + self.inertia.min() <= 0.0:
            raise ModelError("the moving parts have no positive inertia; raise the inertia of the flywheel")
        energy = start_energy(self.work, inertia + self.inertia, self.speed)
        work = np.concatenate([self.work, self.bent_work])
        total = inertia + np.concatenate([self.inertia, self.bent_inertia])
        # between the angles that determine the energy the sum may fall under zero
        return np.asarray(np.sqrt(2.0 * np.maximum(energy + work, 0.0) / total))

    def irregularity(self, inertia: float) -> float:
        """Return the speed range over the mean speed (T3; textbook eq. 24); infinite if the crank would stop."""
        try:
            speeds = self.speeds(inertia)
        except ModelError:
            return np.inf
        return float((speeds.max() - speeds.min()) / self.speed)

    def speed_ranges(self, degree: float, inertia: float) -> tuple[tuple[float, float], ...]:
        """Return the ranges of mean speed in which the degree of irregularity is at most `degree` [rad/s] (T13).

        Gas and load torque are those of the operating point at every speed. The last range may end at infinity.
        """
        work = np.concatenate([self.work, self.bent_work])
        total = inertia + np.concatenate([self.inertia, self.bent_inertia])
        stored, swing = float(np.ptp(work)), float(np.ptp(total))
        # no slower speed keeps the limit (T11)
        slowest = degree * (2.0 + degree) * (0.5 * float(total.max()) + 0.25 * swing) + 0.5 * swing
        last = slowest / stored if stored > 0.0 else 1.0
        # intervals of the inverse square of the speed, on which the energy is bounded
        within, intervals = list[tuple[float, float]](), [(0.0, last)]
        while intervals:
            low, high = intervals.pop()
            try:
                middle = 0.5 * (low + high)
                energy = start_energy(middle * self.work, inertia + self.inertia, 1.0) + middle * work
            except ModelError:
                continue
            change = 0.5 * (high - low) * stored
            above, under = (2.0 * np.maximum(energy + side, 0.0) / total for side in (change, -change))
            if math.sqrt(above.max()) - math.sqrt(under.min()) <= degree:
                within.append((low, high))
                continue
            is_wide = high - low > _NARROW * (high + _NARROW * last)
            if is_wide and math.sqrt(under.max()) - math.sqrt(above.min()) <= degree:
                intervals += [(low, middle), (middle, high)]
        ranges = list[tuple[float, float]]()
        for low, high in sorted(within, reverse=True):
            first = 1.0 / math.sqrt(high) if stored > 0.0 else 0.0
            end = 1.0 / math.sqrt(low) if low > 0.0 else math.inf
            if ranges and first == ranges[-1][1]:
                first = ranges.pop()[0]
            ranges.append((first, end))
        return tuple(ranges)

    def minimum_inertia(self, degree: float) -> float:
        """Return the least inertia without pistons and rods for a degree of irregularity [kg m2] (T3).

        Zero where none is needed. The degree falls as the inertia grows.
        """
        if self.irregularity(0.0) <= degree:
            return 0.0
        inertia = float(np.ptp(self.work)) / (degree * self.speed**2) + float(np.ptp(self.inertia)) / degree
        while self.irregularity(inertia) > degree:
            inertia *= 2.0
        return rising_root(lambda inertia: degree - self.irregularity(inertia), 0.0, inertia)


def swing_of(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Swing:
    """Return work and inertia over the cycle; mounts and flywheel are not part of them, rotors by their weight only."""
    rotors = engine.rotors if engine.gravity else ()
    loaded = tuple(extra for extra in engine.extras if extra.torques(point.name, engine.cycle.base_order))
    bare = replace(engine, rotors=rotors, mounts=(), extras=loaded, geared=())
    return _compute_swing(bare, point, fidelity)


@lru_cache(maxsize=64)
def _compute_swing(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Swing:
    torque, steps = driving_torque(engine, point, fidelity), FINE_SPEED * fidelity.samples
    angles = engine.cycle.angle * np.arange(steps) / steps
    # a torque of extensions may repeat after several cycles only
    cycles = int(engine.cycle.base_order / torque.base)
    work = torque.integral
    mean, (steady, bent) = float(torque.coefficients[0].real), (angles, torque.kink_angles)
    steady_inertia, bent_inertia = (moving_inertia(engine, fidelity, at)[0] for at in (steady, bent))
    steady_work = work.sample(cycles * steps)
    return Swing(point.speed, mean, steady_work, np.tile(steady_inertia, cycles), work.values(bent), bent_inertia)
