"""Roll moment of inertia on geared shafts (L8).

    Mx = (1/n - 1) s (T - mean of T),      s = n^2 J_n / J

for each shaft of ratio n with an inertia J_n, of J of all that turns reduced to the crank. The torque T of the crank
(T1) speeds them all up, and what turns against the crank takes its share of angular momentum back. Two cranks geared at
-1 (textbook Fig. 4.1) leave (J_1 - J_2) / (J_1 + J_2) of the alternating torque. At uneven speed (F5) it is
(n - n^2) J_n times the acceleration of the crank.
"""

from __future__ import annotations

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.rigid_body import ROLL


def geared_factor(engine: Engine) -> float:
    """Return the sum of (1/n - 1) s over the shafts."""
    return sum(((1.0 / geared.ratio - 1.0) * geared.share for geared in engine.geared), 0.0)


def geared_moment(engine: Engine, torque: Spectrum) -> Spectrum:
    """Return the wrench on the block, shape (n, 6), of a crank torque (n,) at even speed [N m] (L8)."""
    mean = torque.coefficients[:1]
    alternating = torque + Spectrum(torque.base, -mean)
    factor = geared_factor(engine)
    return alternating.mapped(lambda values: factor * values[:, None] * ROLL)
