"""Torque of the crankshaft over the cycle, the energy that a flywheel has to store (T1-T3).

    T = -A (p - p_crankcase) ds/dphi - (1/2) w^2 dJ/dphi                     (T1; textbook eqs. 18 to 20)

with J the inertia of pistons and rods reduced to the crank (F3): what they store, they take from the torque. The load
takes its mean; the rest goes into the flywheel and comes back, and what has to be stored is the largest less the
smallest of its integral (T2; textbook 2.7, example 4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.crank_torque import crank_torque
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.irregularity import swing_of
from laufruhe.physics.reduced_inertia import turning_inertia

FINE = 8
"""Times as many steps as the fidelity has, at which the work is compared."""


@dataclass(frozen=True)
class TorqueFacts:
    """Key figures of the torque at one operating point.

    Attributes
    ----------
    mean
        What the load takes [N m].
    power
        Mean torque times speed [W].
    least, largest
        Over the cycle [N m].
    excursion
        Work that is stored and given back within the cycle [J] (T2).
    irregularity
        Largest less smallest speed over the mean speed (T3); None where no inertia of what turns is told.
    """

    mean: float
    power: float
    least: float
    largest: float
    excursion: float
    irregularity: float | None


def torque_parts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> dict[str, Spectrum]:
    """Return the torque of gas, of pistons and rods as point masses, of the rods' inertia, and of all (T1)."""
    whole, still = crank_torque(engine, point, fidelity), replace(point, gas=None)
    masses = crank_torque(engine, still, fidelity)
    points = crank_torque(engine, still, replace(fidelity, rod="mass-only"))
    return {"gas": whole + _less(masses), "pistons": points, "rods": masses + _less(points), "all": whole}


def _less(torque: Spectrum) -> Spectrum:
    return torque.each(lambda values: -values)


def work_stored(torque: Spectrum, samples: int) -> float:
    """Return the range of the work of the alternating torque [J], of a torque of shape (n,) (T2)."""
    work = torque.integral.sample(samples)
    return float(work.max() - work.min()) if len(work) else 0.0


def torque_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> TorqueFacts:
    """Return mean, extremes and stored work of the torque, and the irregularity of the crank speed."""
    torque = crank_torque(engine, point, fidelity)
    # it bends where the gas does: its ends may stand there
    values = np.concatenate([torque.sample(FINE * fidelity.samples), torque.values(torque.bends)])
    mean = float(torque.coefficients[0].real)
    inertia = turning_inertia(engine, fidelity)
    uneven = None if inertia is None else swing_of(engine, point, fidelity).irregularity(inertia)
    return TorqueFacts(
        mean, mean * point.speed, float(values.min()), float(values.max()),
        work_stored(torque, FINE * fidelity.samples), uneven,
    )  # fmt: skip
