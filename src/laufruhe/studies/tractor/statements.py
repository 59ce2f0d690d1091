"""What the study says in words about its gas trace, as functions of the parameters that it does not print."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Cycle, Engine, GasModel, Seiliger
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_torque
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.order_coefficients import inertia_roll_orders
from laufruhe.physics.seiliger_cycle import compression_end_pressure, motored_cycle, seiliger_imep
from laufruhe.physics.shaking_loads import rotor_loads, shaking_loads
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor import shafts

Array = NDArray[np.float64]

SAMPLES = 720
SHARES = np.linspace(0.0, 1.2, 241)


@dataclass(frozen=True)
class Unprinted:
    """What decides over the gas torque and is not printed.

    Attributes
    ----------
    compression_ratio, compression_exponent, expansion_exponent
        Of the mixed cycle.
    part_share
        Where the peak pressure at 5.5 kp/cm2 lies between the end of compression (0) and
        the highest that this load and 80 kp/cm2 allow (1); Fig. 2 prints a peak for
        9 kp/cm2 alone.
    rod_ratio
        lambda.
    """

    compression_ratio: float = 17.0
    compression_exponent: float = 1.35
    expansion_exponent: float = 1.30
    part_share: float = 1.0
    rod_ratio: float = study.ROD_RATIO

    def cycle(self, imep: float, peak_pressure: float) -> Seiliger:
        """The mixed cycle at a load."""
        return Seiliger(
            peak_pressure,
            imep,
            self.compression_exponent,
            self.expansion_exponent,
            compression_ratio=self.compression_ratio,
        )

    @property
    def compression_end(self) -> float:
        """Pressure before heat comes [Pa]."""
        return compression_end_pressure(self.cycle(0.0, study.PEAK_PRESSURE))

    def highest_peak(self, imep: float) -> float:
        """Peak pressure with all heat at constant volume, 80 kp/cm2 at most [Pa]."""
        # the mean pressure is linear in the peak pressure
        low, high = 40e5, 80e5
        reached = [seiliger_imep(self.cycle(imep, peak), Cycle.FOUR_STROKE, 1.0) for peak in (low, high)]
        peak = low + (imep - reached[0]) / (reached[1] - reached[0]) * (high - low)
        return max(min(peak, study.PEAK_PRESSURE), self.compression_end)

    @property
    def full_load(self) -> Seiliger:
        """Of Figs. 2 to 17."""
        return self.cycle(study.FULL_LOAD, self.highest_peak(study.FULL_LOAD))

    @property
    def part_load(self) -> Seiliger:
        """Of Figs. 22 and 25."""
        end, highest = self.compression_end, self.highest_peak(study.PART_LOAD)
        return self.cycle(study.PART_LOAD, end + self.part_share * (highest - end))

    @property
    def motored(self) -> Seiliger:
        """No heat."""
        return motored_cycle(self.cycle(0.0, self.compression_end), Cycle.FOUR_STROKE)


@dataclass(frozen=True)
class BalancedFour:
    """Mean mount forces of the four-cylinder with the shafts of Fig. 21 [N].

    Attributes
    ----------
    bare, force_pair, both
        Without shafts, with the force pair, and with the moment pair at Phi = 50 % too.
    best_share
        Phi of the least mean force.
    best
        That least mean force.
    """

    bare: float
    force_pair: float
    both: float
    best_share: float
    best: float

    @property
    def first_fall(self) -> float:
        """Share by which the force pair lowers the mean force."""
        return 1.0 - self.force_pair / self.bare

    @property
    def second_fall(self) -> float:
        """Share by which the moment pair at Phi = 50 % lowers what is left."""
        return 1.0 - self.both / self.force_pair


def largest_gas_force(gas: GasModel, rod_ratio: float, samples: int = 4 * SAMPLES) -> float:
    """Largest mount force A = T / b of the single (eq. 1, Fig. 2) [N]."""
    torque = gas_torque(gas, study.cylinder(rod_ratio), Cycle.FOUR_STROKE, samples)
    return float(np.abs(torque).max()) / study.WIDTH


def gas_second_order(gas: GasModel, rod_ratio: float) -> complex:
    """Coefficient of order two of one cylinder's gas torque [N m] (C8)."""
    torque = gas_torque(gas, study.cylinder(rod_ratio), Cycle.FOUR_STROKE, SAMPLES)
    return complex(spectrum_of(torque, Fraction(1, 2)).at(2))


def inertia_second_order(rod_ratio: float, piston_speed: float) -> complex:
    """Coefficient of order two of one cylinder's inertia torque [N m], about i m r^2 w^2 / 2."""
    scale = study.RECIPROCATING_MASS * study.RADIUS**2 * study.speed_of(piston_speed) ** 2
    return complex(scale * inertia_roll_orders(rod_ratio, 0.0, 1.0, 4)[2])


def cancelling_speed(gas: GasModel, rod_ratio: float) -> float:
    """Mean piston speed [m/s] at which least of the second-order torque is left."""
    inertia = inertia_second_order(rod_ratio, 1.0)
    along = -(gas_second_order(gas, rod_ratio) * inertia.conjugate()).real / abs(inertia) ** 2
    return math.sqrt(max(along, 0.0))


def balanced_four(gas: GasModel | None, rod_ratio: float, piston_speed: float = study.PISTON_SPEED) -> BalancedFour:
    """The four-cylinder with the shafts of eqs. 26 and 28 (Fig. 22)."""
    bare, left, slope = _pairs(gas, rod_ratio, piston_speed)
    means = np.array([_mean(left + share * slope) for share in SHARES])
    k = int(np.argmin(means))
    both = _mean(left + shafts.MOMENT_SHARE * slope)
    return BalancedFour(_mean(bare), _mean(left), both, float(SHARES[k]), float(means[k]))


def moment_sweep(gas: GasModel | None, rod_ratio: float, shares: Array) -> Array:
    """Mean mount force [N] over the share Phi of the moment pair (eq. 28), the force pair in place."""
    _, left, slope = _pairs(gas, rod_ratio, study.PISTON_SPEED)
    return np.array([_mean(left + share * slope) for share in shares])


def _pairs(gas: GasModel | None, rod_ratio: float, piston_speed: float) -> tuple[Array, Array, Array]:
    """Mount forces without shafts, with the force pair, and of a whole moment pair alone, sampled."""
    engine = study.inline_engine(4, how=study.Build(rod_ratio=rod_ratio))
    point = study.running(gas, piston_speed)
    mounting = rigid_mounting(engine.mounts)
    bare = shaking_loads(engine, point, Fidelity(samples=SAMPLES))
    pair = shafts.force_pair(shafts.FORCE_UNBALANCE * rod_ratio / study.ROD_RATIO)
    lanchester = bare + rotor_loads(pair, point.speed, engine.cycle)
    moment = rotor_loads(shafts.moment_pair(1.0), point.speed, engine.cycle)
    given, left, slope = (_sampled(engine, mounting.forces(load)) for load in (bare, lanchester, moment))
    return given, left, slope


def _sampled(engine: Engine, forces: Spectrum) -> Array:
    return forces.rebased(engine.cycle.base_order).sample(SAMPLES)


def _mean(samples: Array) -> float:
    """Mean length of vectors (..., 3)."""
    return float(np.sqrt(np.sum(samples**2, axis=-1)).mean())
