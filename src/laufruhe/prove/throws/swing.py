"""What one order of the torque says of the degree of irregularity, whatever the others are (T10).

With u = w^2 between its ends u_1 < u_2 and m = J_0 + J, F2 is m u / 2 - W = E, a constant: every order of m u / 2
is that of W. Of u less the middle of its ends an order is no larger than m_max (u_2 - u_1) / pi, of m times that
middle it is m_h w_0^2 and no more than |m_h| (u_2 - u_1) / 2 beside it. So

    u_2 - u_1 >= |T_h| / h / (m_max / pi + |m_h| / 4),      delta >= (1 + (u_2 - u_1) / w_0^2)^(1/2) - 1

with T of T1. By the work S that is stored at even speed (T2), tight where the inertia is large (T11),

    u_2 - u_1 >= S / (m_max / 2 + (J_max - J_min) / 4),

for half of m times u less its middle spans no more than m_max (u_2 - u_1) / 2, and w_0^2 lies between the ends.
Cylinders add up in T_h and m_h, each later by when it fires, so that thousands of firing orders are bounded at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import CRANKSHAFT, Engine, OperatingPoint
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.turns import as_turn
from laufruhe.physics.crank_torque import crank_torque, cylinder_torque
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.uneven_speed import moving_inertia

SAMPLED = 1e-4
"""Share by which a degree at angles may lie under the true one."""
_HIGHEST, _SAME = 200, 1e-8


@dataclass(frozen=True, eq=False)
class SwingBound:
    """Of one operating point.

    Attributes
    ----------
    work, inertia
        T_h / h of every cylinder at even speed [J], and orders of its J [kg m2], counted from its firing,
        shapes (cylinders, orders), from the first order of the cycle.
    most
        m_max [kg m2].
    speed
        w_0 [rad/s].
    turns
        Of the cycle.
    """

    work: ComplexArray
    inertia: ComplexArray
    most: float
    speed: float
    turns: int

    @classmethod
    def of(cls, engine: Engine, point: OperatingPoint, fidelity: Fidelity, turning: float) -> SwingBound | None:
        """Of an engine with an inertia beside pistons and rods; None where cylinders do not add up to its torque."""
        parts, cycle = engine.slider_cranks, engine.cycle
        # as the speed is found: pistons with all their orders
        fidelity = replace(fidelity, kinematics="exact", orders=None)
        if any(part.shaft != CRANKSHAFT for part in parts):
            return None
        still = replace(point, gas=None)
        whole, masses = (
            _padded([cylinder_torque(cycle, part, at, fidelity) for part in parts]) for at in (point, still)
        )
        orders = np.arange(1, _HIGHEST + 1) * float(cycle.base_order)
        own = -2.0 * masses[:, 1:] / (1j * orders * point.speed**2)
        angles = math.tau * np.arange(fidelity.samples) / fidelity.samples
        mean = float(moving_inertia(engine, fidelity, angles)[0].mean())
        found = cls(whole[:, 1:] / orders, own, turning + mean + float(np.abs(own).sum()), point.speed, cycle.turns)
        fires = np.array([[float(as_turn(part.firing_angle)) for part in parts]])
        told = crank_torque(replace(engine, rotors=()), point, fidelity).rebased(cycle.base_order).coefficients
        told = _padded([told])[0, 1:] / orders
        added = np.einsum("kh,nkh->nh", found.work, found._phases(fires))[0]
        adds_up = float(np.abs(added - told).max()) <= _SAME * float(np.abs(found.work).sum(axis=0).max())
        return found if adds_up else None

    def least(self, fires: Array) -> Array:
        """What no degree goes under, of cylinders that fire at these turns, shape (n,) of (n, cylinders)."""
        phases = self._phases(fires)
        work, inertia = (np.abs(np.einsum("kh,nkh->nh", part, phases)) for part in (self.work, self.inertia))
        apart = (work / (self.most / math.pi + 0.25 * inertia)).max(axis=1)
        return np.asarray((1.0 - SAMPLED) * (np.sqrt(1.0 + apart / self.speed**2) - 1.0))

    def _phases(self, fires: Array) -> ComplexArray:
        turned = fires[:, :, None] / self.turns * np.arange(1, self.work.shape[1] + 1)
        return np.asarray(np.exp(-2j * np.pi * turned))


@dataclass(frozen=True)
class StoredBound:
    """What the work that is stored at even speed says of the degree of irregularity at one operating point (T11).

    Attributes
    ----------
    most
        m_max of cylinders in any phase [kg m2].
    reach
        The most by which their J may vary [kg m2].
    speed
        w_0 [rad/s].
    """

    most: float
    reach: float
    speed: float

    @classmethod
    def of(cls, engine: Engine, point: OperatingPoint, fidelity: Fidelity, turning: float) -> StoredBound:
        """Of an engine whose cylinders stay what they are and fire at any angles, with an inertia beside them."""
        angles = math.tau * np.arange(fidelity.samples) / fidelity.samples
        alone = [replace(engine, slider_cranks=(part,)) for part in engine.slider_cranks]
        own = [moving_inertia(one, fidelity, angles)[0] for one in alone]
        most, least = (float(sum(map(end, own))) for end in (np.max, np.min))
        return cls(turning + most, most - least, point.speed)

    def degree(self, work: float) -> float:
        """The least degree with so much work stored [J]."""
        return (1.0 - SAMPLED) * (math.sqrt(1.0 + work / self._energy) - 1.0)

    def work(self, degree: float) -> float:
        """The most work that leaves a degree [J]."""
        return ((1.0 + degree / (1.0 - SAMPLED)) ** 2 - 1.0) * self._energy

    @property
    def _energy(self) -> float:
        return (0.5 * self.most + 0.25 * self.reach) * self.speed**2


def _padded(series: Sequence[ComplexArray]) -> ComplexArray:
    """Rows of one length, of the lowest orders."""
    out = np.zeros((len(series), _HIGHEST + 1), dtype=complex)
    for k, own in enumerate(series):
        kept = own[: _HIGHEST + 1]
        out[k, : len(kept)] = kept
    return out
