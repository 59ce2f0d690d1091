"""Torque of the crankshaft over the cycle, stored energy and irregularity of its speed (T1-T4, V1, V14).

    T = -A (p - p_crankcase) ds/dphi - (1/2) w^2 dJ/dphi                     (T1; textbook eqs. 18 to 20)

with J the inertia of pistons and rods reduced to the crank (F3): what they store, they take from the torque. The load
takes its mean, and has an alternating torque of its own if it is not constant (T12). The rest goes into the flywheel
and comes back, and what has to be stored is the largest less the smallest of its integral (T2; textbook 2.7, example
4). The degree of irregularity is exact at every inertia,

    w^2 = 2 (E + W) / (J_0 + J),   mean of w_0 / w over the angle = 1        (T3, T4)

with W the work of the gas less that of the load. W and J are functions of the angle alone (F2-F4), so for each inertia
J_0 of the flywheel one number E is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.roots import rising_root
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.gravity import with_gravity
from laufruhe.physics.load_torque import less_load
from laufruhe.physics.mechanism import TWO_ORDER_ROLL, Direction, Effect, orders_of_masses, reduced, two_order_roll
from laufruhe.physics.rigid_body import ROLL
from laufruhe.physics.star_loads import star_loads
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


def crank_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of gas, pistons and rods, less friction, at the output at even speed, (n,) [N m] (T1, L5b)."""
    gas = fidelity.gas_of(point)
    masses = fidelity.truncated(
        star_loads(engine.cycle, engine.slider_cranks, point.speed, lambda part: (_of_masses(part, fidelity),))
    )
    total = masses if gas is None else masses + fidelity.truncated(gas_loads(engine, gas, fidelity, point.fmep))
    return total.mapped(lambda wrench: wrench @ ROLL)


def excess_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of crank and weights less the alternating torque of the load, (n,) [N m] (T12, T14)."""
    return with_gravity(less_load(crank_torque(engine, point, fidelity), engine, point, fidelity), engine, fidelity)


def cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity = EXACT) -> ComplexArray:
    """Return the coefficients of one cylinder's torque by order of the cycle [N m], counted from its firing (T1)."""
    first = replace(part, x=0.0, throw=part.bank + part.fires_at, firing_angle=0.0)
    return _cylinder_torque(cycle, first, replace(point, name="", weight=1.0), fidelity)


@lru_cache(maxsize=256)
def _cylinder_torque(cycle: Cycle, part: SliderCrank, point: OperatingPoint, fidelity: Fidelity) -> ComplexArray:
    torque = crank_torque(Engine("one cylinder", cycle, (part,)), point, fidelity)
    series = torque.with_finer_base(cycle.base_order).coefficients
    series.setflags(write=False)
    return series


def _of_masses(part: SliderCrank, fidelity: Fidelity) -> Effect:
    """Return the torque at unit speed of the mechanism's own crank, in the sense of the output (T1)."""
    is_rigid, is_short = fidelity.rod == "rigid", fidelity.kinematics == "two-order"
    key = "torque", replace(part, name="", x=0.0, throw=0.0, bank=0.0, firing_angle=0.0), is_rigid, is_short

    def series() -> ComplexArray:
        if is_short and type(part) is SliderCrank:
            return part.reciprocating_mass * part.crank_radius**2 * part.shaft.ratio * two_order_roll(part.rod_ratio)
        tables = orders_of_masses(part, _torque_rows, (2, 2))
        table: ComplexArray = tables.sum(axis=0) if is_rigid else tables[0]
        return table[: TWO_ORDER_ROLL + 1] if is_short else table

    return Effect(Direction.ROLL, 1.0, key, series)


def _torque_rows(part: SliderCrank, alpha: Array) -> tuple[Any, Any]:
    # torque of point masses and of swings
    motion = part.motion(np, alpha)
    (_, total), (_, points) = reduced(motion), reduced(motion, with_rods=False)
    factor = -0.5 * part.shaft.ratio
    return factor * points, factor * (total - points)


_NARROW = 1e-6
"""Relative width of an interval at the end of a range of speeds that is not divided further."""
FINE_SPEED = 4
"""Times as many steps as the fidelity has, at which the ends of the speed are sought."""


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
    bare = replace(engine, rotors=rotors, mounts=(), flywheel=None, extras=loaded, geared=())
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


_STEPS = 1024


def reduced_inertia(part: SliderCrank) -> float:
    """Return the mean inertia of piston, rod and pin mass reduced to the crank [kg m2] (V1; textbook 2.9).

    With a long rod half the reciprocating mass at the crank radius.
    """
    return _reduced_inertia(replace(part, name="", x=0.0, throw=part.bank, firing_angle=0.0))


@lru_cache(maxsize=256)
def _reduced_inertia(part: SliderCrank) -> float:
    inertia, _ = reduced(part.motion(np, 2.0 * math.pi * np.arange(_STEPS) / _STEPS))
    return part.rotating_mass * part.crank_radius**2 + float(np.mean(inertia * np.ones(_STEPS)))


def turning_inertia(engine: Engine, fidelity: Fidelity) -> float | None:
    """Return the moment of inertia of all rotating parts, without pistons and rods [kg m2]; None if it is unknown.

    None if none of these is known.
    """
    if fidelity.has_uneven_speed:
        return fidelity.crank_inertia
    if engine.flywheel is not None:
        return engine.flywheel.inertia
    inertias = (extra.turning_inertia(engine.slider_cranks) for extra in engine.extras)
    return next((inertia for inertia in inertias if inertia is not None), None)
