"""Lower bound of the degree of irregularity delta by the work that is stored at constant speed (T11).

w is the crank speed, w_0 its mean, and u = w^2 lies between u_1 and u_2. m = J_0 + J is the inertia of the crank and
all moving parts, and W the work of the excess torque. F2 then says that m u / 2 - W is constant. With the stored work
S, the peak to peak of W at constant speed (T2),

    u_2 - u_1 >= S / (m_max / 2 + (J_max - J_min) / 4),      delta >= (1 + (u_2 - u_1) / w_0^2)^(1/2) - 1,

because m (u - u_mid) / 2, with u_mid halfway from u_1 to u_2, has a peak to peak of at most m_max (u_2 - u_1) / 2, and
w_0^2 lies between u_1 and u_2. The bound is tight if the inertia is large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.uneven_speed import moving_inertia

SAMPLED = 1e-4
"""Largest relative error by which a degree of irregularity from samples is too small."""


@dataclass(frozen=True)
class IrregularityBound:
    """Lower bound of the degree of irregularity from stored work at one operating point (T11).

    Stored work is the peak to peak of the excess work of the loads at constant speed.

    `energy` is (m_max / 2 + (J_max - J_min) / 4) w_0^2 [J], and holds for any firing angles of the cylinders.
    """

    energy: float

    @classmethod
    def from_engine(
        cls, engine: Engine, point: OperatingPoint, fidelity: Fidelity, inertia: float
    ) -> IrregularityBound:
        """Return the bound of the degree of irregularity at an operating point, for any firing angles of the cylinders.

        `inertia` is the moment of inertia of all rotating parts [kg m2].
        """
        angles = math.tau * np.arange(fidelity.samples) / fidelity.samples
        cylinders = [replace(engine, slider_cranks=(part,)) for part in engine.slider_cranks]
        inertias = [moving_inertia(cylinder, fidelity, angles)[0] for cylinder in cylinders]
        largest, smallest = (float(sum(map(end, inertias))) for end in (np.max, np.min))
        return cls((0.5 * (inertia + largest) + 0.25 * (largest - smallest)) * point.speed**2)

    def degree(self, work: float) -> float:
        """Return a lower bound of the degree of irregularity from the stored work [J]."""
        return (1.0 - SAMPLED) * (math.sqrt(1.0 + work / self.energy) - 1.0)

    def work(self, degree: float) -> float:
        """Return the largest stored work [J] at which a degree of irregularity is possible."""
        return ((1.0 + degree / (1.0 - SAMPLED)) ** 2 - 1.0) * self.energy
