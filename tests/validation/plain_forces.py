"""Mount forces of an in-line four-stroke engine in plain NumPy: closed forms of the slider-crank at every crank angle.

Nothing here comes from the package but the numbers of the engine: no orders, no transform, no kinks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from laufruhe.machine import Engine, OperatingPoint, Seiliger

FloatArray = NDArray[np.float64]
CYCLE = 4.0 * math.pi


@dataclass(frozen=True)
class PlainEngine:
    """Numbers of an engine, and what depends on neither rods nor speed.

    Attributes
    ----------
    phi
        Crank angles of the samples, shape (samples,) [rad].
    sine, cosine
        Of the local angle of each crank, shape (samples, cylinders).
    since
        Crank angle since the firing of each cylinder, shape (samples, cylinders) [rad].
    cut_off
        Volume at the end of the heat over the displacement.
    rotors
        Position, unbalance, ratio and place of each rotor.
    maps
        Forces on the mounts, three each, from a wrench, shape (3 x mounts, 6).
    """

    radius: float
    mass: float
    area: float
    x: FloatArray
    phi: FloatArray
    sine: FloatArray
    cosine: FloatArray
    since: FloatArray
    gas: Seiliger | None
    cut_off: float
    rotors: tuple[tuple[float, complex, float, float, float], ...]
    maps: FloatArray

    def forces(self, rod_ratio: float, speed: float) -> FloatArray:
        """Return the mount forces with all numbers computed, shape (samples, mounts, 3) [N]."""
        return self.on_mounts(speed**2 * self._inertia(rod_ratio) + self._gas(rod_ratio) + self.turning(speed))

    def truncated(self, rod_ratio: float) -> Callable[[float], FloatArray]:
        """Return the mount forces as a function of speed that keeps inertia, gas and unbalances at unit speed."""
        at_unit_speed, gas = self._inertia(rod_ratio) + self.turning(1.0), self._gas(rod_ratio)
        return lambda speed: self.on_mounts(speed**2 * at_unit_speed + gas)

    def on_mounts(self, wrench: FloatArray) -> FloatArray:
        """Return the forces on the mounts from wrenches, shape (samples, mounts, 3) [N]."""
        return (wrench @ self.maps.T).reshape(len(wrench), -1, 3)

    def _inertia(self, rod_ratio: float) -> FloatArray:
        root = np.sqrt(1.0 - (rod_ratio * self.sine) ** 2)
        velocity = -self.sine * (1.0 + rod_ratio * self.cosine / root)
        bent = (self.cosine**2 - self.sine**2) / root + rod_ratio**2 * (self.sine * self.cosine) ** 2 / root**3
        force = self.mass * self.radius * (self.cosine + rod_ratio * bent)
        wrench = np.zeros((len(self.phi), 6))
        wrench[:, 2] = force.sum(axis=1)
        wrench[:, 3] = self.radius * (force * velocity).sum(axis=1)
        wrench[:, 4] = -(force @ self.x)
        return wrench

    def _gas(self, rod_ratio: float) -> FloatArray:
        wrench = np.zeros((len(self.phi), 6))
        if self.gas is None:
            return wrench
        gas, root = self.gas, np.sqrt(1.0 - (rod_ratio * self.sine) ** 2)
        clearance = 1.0 / (gas.compression_ratio - 1.0)
        volume = clearance + 0.5 * (1.0 - self.cosine + (1.0 - root) / rod_ratio)
        pressure = np.where(self.since < 2.0 * math.pi, gas.exhaust_pressure, gas.intake_pressure)
        rises, falls = self.since > 3.0 * math.pi, self.since < math.pi
        pressure[rises] = gas.intake_pressure * ((1.0 + clearance) / volume[rises]) ** gas.compression_exponent
        share = np.minimum(1.0, self.cut_off / volume[falls])
        pressure[falls] = gas.peak_pressure * share**gas.expansion_exponent
        thrust = -self.area * (pressure - gas.crankcase_pressure)
        velocity = -self.sine * (1.0 + rod_ratio * self.cosine / root)
        wrench[:, 3] = self.radius * (thrust * velocity).sum(axis=1)
        return wrench

    def turning(self, speed: float) -> FloatArray:
        """Return the wrench of the rotors, shape (samples, 6) [N, N m]."""
        wrench = np.zeros((len(self.phi), 6))
        for x, unbalance, ratio, y, z in self.rotors:
            force = unbalance * (ratio * speed) ** 2 * np.exp(1j * ratio * self.phi)
            wrench[:, 1] += force.imag
            wrench[:, 2] += force.real
            wrench[:, 3] += y * force.real - z * force.imag
            wrench[:, 4] -= x * force.real
            wrench[:, 5] += x * force.imag
        return wrench


def plain_engine(engine: Engine, point: OperatingPoint, samples: int) -> PlainEngine:
    """Return the numbers of an upright in-line engine with equal cylinders on rigid mounts."""
    parts, gas = engine.slider_cranks, point.gas
    assert gas is None or isinstance(gas, Seiliger)
    phi = CYCLE * np.arange(samples) / samples
    alpha = phi[:, None] + np.array([part.throw for part in parts])
    return PlainEngine(
        radius=parts[0].crank_radius,
        mass=parts[0].reciprocating_mass,
        area=0.25 * math.pi * (parts[0].bore or 0.0) ** 2,
        x=np.array([part.x for part in parts]),
        phi=phi,
        sine=np.sin(alpha),
        cosine=np.cos(alpha),
        since=np.mod(phi[:, None] - np.array([part.firing_angle for part in parts]), CYCLE),
        gas=gas,
        cut_off=0.0 if gas is None else _cut_off(gas) / (gas.compression_ratio - 1.0),
        rotors=tuple((r.x, complex(r.unbalance), r.shaft.ratio, r.shaft.y, r.shaft.z) for r in engine.rotors),
        maps=_maps(engine),
    )


def _cut_off(gas: Seiliger) -> float:
    # volume at the end of the heat over the smallest, from the indicated mean pressure
    ratio, n, m = gas.compression_ratio, gas.compression_exponent, gas.expansion_exponent

    def excess(cut: float) -> float:
        compression = gas.intake_pressure * (ratio**n - ratio) / (n - 1.0)
        expansion = gas.peak_pressure * (cut - 1.0 + (cut - cut**m * ratio ** (1.0 - m)) / (m - 1.0))
        return (expansion - compression) / (ratio - 1.0) + gas.intake_pressure - gas.exhaust_pressure - gas.imep

    return float(brentq(excess, 1.0, ratio, xtol=1e-15, rtol=1e-15))


def _maps(engine: Engine) -> FloatArray:
    # springs at the mounts share a wrench: K G (sum G' K G)^+
    blocks: list[Any] = []
    for mount in engine.mounts:
        x, y, z = mount.position
        blocks.append(np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]]))
    motion = np.vstack(blocks)
    stiffness = np.concatenate([mount.stiffness for mount in engine.mounts])
    return stiffness[:, None] * motion @ np.linalg.pinv(motion.T @ (stiffness[:, None] * motion), rcond=1e-12)
