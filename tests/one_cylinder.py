"""Pressure and loads of one cylinder, loads of rods and rotors by themselves, and irregularity, for comparisons."""

from __future__ import annotations

import math
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.chambers.gas import Steam
from laufruhe.extensions.flywheel.torque import swing_of
from laufruhe.machine import Cycle, Engine, GasModel, OperatingPoint, SliderCrank
from laufruhe.machine.gas.base import OneChamber
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.physics.mechanism import effects_of
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.physics.star_loads import star_loads


def rod_inertia_loads(engine: Engine, speed: float) -> Spectrum:
    """Return the roll moment of the rods' inertia deficits, Mx = -dTheta psi'' (1 + n psi') (L4; eqs. 10-12)."""
    return star_loads(engine.cycle, engine.slider_cranks, speed, lambda part: effects_of(part, EXACT)[1])


def rotating_loads(engine: Engine, speed: float) -> Spectrum:
    """Return the loads of rotating masses at the crank pins and of every rotor (L1)."""
    return rotor_loads((*engine.pins, *engine.rotors), speed, engine.cycle)


def swept_rate(part: SliderCrank, angles: Array) -> Array:
    """Return the derivative of `swept_volume` by the crank angle, exact, shape of `angles`."""
    ratio = part.shaft.ratio
    return np.asarray(-ratio * part.velocity(np, part.fires_at + ratio * angles) / part.stroke)


def gas_torque(gas: GasModel, part: SliderCrank, cycle: Cycle, samples: int) -> Array:
    """Return torque of one cylinder's gas on the output at equal steps over the cycle from its firing [N m] (L5)."""
    angles = cycle.angle * np.arange(samples) / samples
    return np.sum([chamber_torque(gas, part, cycle, angles + lag) for lag in part.swept.lags], axis=0)


def irregularity(engine: Engine, point: OperatingPoint, inertia: float, fidelity: Fidelity = EXACT) -> float:
    """Return the degree of irregularity with an inertia without pistons and rods [kg m2] (T3)."""
    return swing_of(engine, point, fidelity).irregularity(inertia)


def indicated_mean_pressure(pressures: Array, part: SliderCrank, cycle: Cycle) -> float:
    """Return the cyclic integral of p dV over the displacement (G3).

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
    """Return the cylinder pressure [Pa] at equal steps of crank angle from the firing dead centre, shape (samples,).

    Raises
    ------
    ModelError
        If the model cannot meet its indicated mean pressure, or a trace does not cover the cycle.
    """
    return gas.pressure(part, cycle, cycle.angle * np.arange(samples) / samples)


def inertia_coefficients(
    part: SliderCrank, speed: float, fidelity: Fidelity = EXACT
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Return axial and lateral force [N] and roll moment [N m] of one cylinder, by order of its own crank angle.

    Returns
    -------
    Three arrays of one length: the coefficients that `reciprocating_loads` and
    `rod_inertia_loads` multiply by the phase and place of each cylinder (L2-L4, L7).
    """
    effects = chain(*effects_of(part, fidelity))
    found = [(effect.direction, effect.size * (part.shaft.ratio * speed) ** 2 * effect.series()) for effect in effects]
    out = np.zeros((3, max((len(series) for _, series in found), default=1)), dtype=complex)
    for direction, series in found:
        out[direction, : len(series)] += series
    return out[0], out[1], out[2]


def mean_pressure_of(steam: Steam) -> float:
    """Return the area of a diagram over its length [Pa], in closed form (G16)."""

    def fallen(begin: float, end: float) -> float:
        return ((begin + steam.clearance) / (end + steam.clearance)) ** steam.exponent if begin != end else 1.0

    def work(begin: float, end: float) -> float:
        if begin == end:
            return 0.0
        first, log = begin + steam.clearance, math.log((end + steam.clearance) / (begin + steam.clearance))
        power = steam.exponent - 1.0
        return first * (-math.expm1(-power * log) / power if power else log)

    released = steam.admission * fallen(steam.cut_off, steam.release)
    squeezed = steam.back_pressure * fallen(steam.compression, steam.lead)
    out = steam.admission * (steam.cut_off + work(steam.cut_off, steam.release))
    out += 0.5 * (released + steam.back_pressure) * (1.0 - steam.release)
    back = steam.back_pressure * (1.0 - steam.compression - work(steam.compression, steam.lead))
    return out - back - 0.5 * (squeezed + steam.admission) * steam.lead
