"""Pressure of one cylinder over a cycle, and its loads by order of its own crank angle, as tests compare them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Cycle, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import swept_rate
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_cycle import OneChamber, pressure_at
from laufruhe.physics.mechanism import mass_effects, rod_effects
from laufruhe.physics.star_loads import square_of


def indicated_mean_pressure(pressures: Array, part: SliderCrank, cycle: Cycle) -> float:
    """Cyclic integral of p dV over the displacement (G3).

    Parameters
    ----------
    pressures
        Shape (n,) [Pa], at equal steps over one cycle from the firing dead centre.

    Returns
    -------
    Mean pressure [Pa] by the trapezoidal rule with the exact dV/d gamma. It converges
    faster than any power of 1/n for a smooth trace, and with 1/n^2 where the pressure
    has jumps at dead centres or bends.
    """
    angles = cycle.angle * np.arange(len(pressures)) / len(pressures)
    return float(np.mean(pressures * swept_rate(part, angles)) * cycle.angle)


def cylinder_pressure(gas: OneChamber, part: SliderCrank, cycle: Cycle, samples: int) -> NDArray[np.float64]:
    """Absolute cylinder pressure [Pa] at equal steps of the crank angle from the firing dead centre, shape (samples,).

    Raises
    ------
    ModelError
        If the model cannot meet its indicated mean pressure, or a trace does not cover the cycle.
    """
    return pressure_at(gas, part, cycle, cycle.angle * np.arange(samples) / samples)


def inertia_coefficients(
    part: SliderCrank, speed: float, fidelity: Fidelity = EXACT
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Force along the axis and across it [N] and roll moment [N m] of one cylinder, by order of its own crank angle.

    Returns
    -------
    Three arrays of one length: the coefficients that `reciprocating_loads` and
    `rod_inertia_loads` multiply by the phase and place of each cylinder (L2-L4, L7).
    """
    effects = (*mass_effects(part, fidelity), *rod_effects(part, fidelity))
    found = [(effect.direction, effect.size * square_of(part, speed) * effect.series()) for effect in effects]
    out = np.zeros((3, max((len(series) for _, series in found), default=1)), dtype=complex)
    for direction, series in found:
        out[direction, : len(series)] += series
    return out[0], out[1], out[2]
