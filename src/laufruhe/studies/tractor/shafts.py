"""Balancer unbalances in closed form (Hasselgruber 1964, eqs. 24-31), with the angles that they need.

An oscillating couple is the sum of two that turn in opposite directions; counterweights
on the crank remove the half that turns with it, a shaft of ratio -1 the other.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.machine.layouts import stations
from laufruhe.studies.tractor import engines as study

FORCE_UNBALANCE = 0.5 * study.RECIPROCATING_MASS * study.RADIUS * study.ROD_RATIO
"""U_Kr of eq. 26 [kg m]."""
MOMENT_UNBALANCE_ARM = 0.5 * study.RECIPROCATING_MASS * study.RADIUS**2
"""U_Mom x of eq. 27 [kg m2]."""
MOMENT_SHARE = 0.5
"""Phi of eq. 28."""
FRONT_SHARE = 0.72
"""Share of U_Kr in eq. 29."""
FRONT_ARM = 0.7 * study.RADIUS / study.ROD_RATIO
"""Distance of the axes in eq. 29 [m]."""

PAIR_DISTANCE = 0.200
FRONT_END = 2.0 * study.SPACING
SHAFT_PLACE = (0.100, -0.100)


def couple_star(throws: Sequence[float]) -> complex:
    """Sum of x_k e^{i theta_k} of throws [deg], in cylinder spacings: its size is the root of eqs. 24, 25, 30, 31."""
    places = stations(len(throws), 1.0)
    return sum((x * cmath.exp(1j * math.radians(t)) for x, t in zip(places, throws, strict=True)), 0j)


def half_couple(throws: Sequence[float]) -> complex:
    """m r / 2 a times the couple star [kg m2]: U_A s of eqs. 24, 25, 30, 31."""
    return 0.5 * study.RECIPROCATING_MASS * study.RADIUS * study.SPACING * couple_star(throws)


def crank_weights(throws: Sequence[float]) -> tuple[Rotor, ...]:
    """Counterweights at the end throws for half of the first-order couple, as far as a crank can go."""
    apart = (len(throws) - 1) * study.SPACING
    unbalance = -half_couple(throws) / apart
    return _opposed("web", CRANKSHAFT, Role.COUNTERWEIGHT, apart, unbalance, 0.080)


def first_order_shaft(throws: Sequence[float]) -> tuple[Rotor, ...]:
    """Two unbalances U_A on a shaft against the crank at its speed (eqs. 24, 25, 30, 31)."""
    apart = len(throws) * study.SPACING
    shaft = Shaft("shaft", -1.0, *SHAFT_PLACE)
    return _opposed("shaft", shaft, Role.BALANCER, apart, -half_couple(throws).conjugate() / apart, 0.020)


def force_pair(unbalance: float, x: float = 0.0, z: float = -0.100) -> tuple[Rotor, ...]:
    """Lanchester's pair at twice crank speed, one shaft each way (Figs. 18, 21; eq. 26)."""
    y = 0.5 * PAIR_DISTANCE
    return (
        study.balancer("force left", 2.0, (x, y, z), -unbalance),
        study.balancer("force right", -2.0, (x, -y, z), -unbalance),
    )


def moment_pair(share: float) -> tuple[Rotor, ...]:
    """Two opposed unbalances that turn the same way (Figs. 19, 21; eq. 28), Phi = share."""
    y = 0.5 * PAIR_DISTANCE
    unbalance = -1j * share * MOMENT_UNBALANCE_ARM / PAIR_DISTANCE
    return (
        study.balancer("moment left", 2.0, (FRONT_END, y, 0.0), unbalance),
        study.balancer("moment right", 2.0, (FRONT_END, -y, 0.0), -unbalance),
    )


def front_pair(unbalance: float, arm: float, x: float = FRONT_END) -> tuple[Rotor, ...]:
    """One pair one above the other for force and moment together (Figs. 20, 24; eq. 29)."""
    return (
        study.balancer("upper", 2.0, (x, 0.0, 0.5 * arm), -unbalance),
        study.balancer("lower", -2.0, (x, 0.0, -0.5 * arm), -unbalance),
    )


def _opposed(
    name: str, shaft: Shaft, role: Role, apart: float, unbalance: complex, radius: float
) -> tuple[Rotor, Rotor]:
    return (
        Rotor(f"{name} front", 0.5 * apart, unbalance, shaft, role, radius),
        Rotor(f"{name} rear", -0.5 * apart, -unbalance, shaft, role, radius),
    )
