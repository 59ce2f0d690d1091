"""Degree of irregularity of a crank with a flywheel, exact at every inertia (T3, T4).

    w^2 = 2 (E + W) / (J_0 + J),   mean of w_0 / w over the angle = 1

with W the work of the gas less that of the load, and J the inertia of pistons and rods (F2-F4). Both are functions of
the angle alone, so they are found once; for each inertia J_0 one number E is left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import rising_root
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.uneven_speed import gas_torque, moving_inertia, start_energy

FINE = 4
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
        """Return the crank speed over the cycle with an inertia beside pistons and rods [rad/s] (F2-F4).

        Raises
        ------
        ModelError
            If the crank would stop.
        """
        if inertia + self.inertia.min() <= 0.0:
            raise ModelError("the moving parts have no positive inertia; raise the inertia of the flywheel")
        energy = start_energy(self.work, inertia + self.inertia, self.speed)
        work = np.concatenate([self.work, self.bent_work])
        total = inertia + np.concatenate([self.inertia, self.bent_inertia])
        # between the angles that tell the energy it may fall under zero
        return np.asarray(np.sqrt(2.0 * np.maximum(energy + work, 0.0) / total))

    def irregularity(self, inertia: float) -> float:
        """Return the speed range over the mean speed (T3; textbook eq. 24); infinite if the crank would stop."""
        try:
            speeds = self.speeds(inertia)
        except ModelError:
            return np.inf
        return float((speeds.max() - speeds.min()) / self.speed)

    def least_inertia(self, degree: float) -> float:
        """Return the least inertia beside pistons and rods for a degree of irregularity [kg m2] (T3).

        Zero where none is needed. The degree falls as the inertia grows.
        """
        if self.irregularity(0.0) <= degree:
            return 0.0
        enough = float(np.ptp(self.work)) / (degree * self.speed**2) + float(np.ptp(self.inertia)) / degree
        while self.irregularity(enough) > degree:
            enough *= 2.0
        return rising_root(lambda inertia: degree - self.irregularity(inertia), 0.0, enough)


def swing_of(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Swing:
    """Return work and inertia over the cycle; rotors, mounts and flywheel are not part of them."""
    bare = replace(engine, rotors=(), mounts=(), bearings=(), flywheel=None, extras=(), geared=())
    return _found_swing(bare, point, fidelity)


@lru_cache(maxsize=64)
def _found_swing(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Swing:
    torque, steps = gas_torque(engine, point, fidelity), FINE * fidelity.samples
    angles = engine.cycle.angle * np.arange(steps) / steps
    work = torque.integral
    mean, (steady, bent) = float(torque.coefficients[0].real), (angles, torque.bends)
    own, own_bent = (moving_inertia(engine, fidelity, at)[0] for at in (steady, bent))
    return Swing(point.speed, mean, work.sample(steps), own, work.values(bent), own_bent)


def irregularity(engine: Engine, point: OperatingPoint, inertia: float, fidelity: Fidelity = EXACT) -> float:
    """Return the degree of irregularity with an inertia beside pistons and rods [kg m2] (T3)."""
    return swing_of(engine, point, fidelity).irregularity(inertia)
