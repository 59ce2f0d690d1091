"""Mount forces and transmissibility over a range of speeds, in one pass (E11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum, common_base, orders_equal
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.geared_inertia import geared_moment
from laufruhe.physics.load_torque import less_load, with_machines
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.rigid_body import ROLL
from laufruhe.physics.shaking_loads import shaking_loads


def split_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> tuple[Spectrum, Spectrum | None]:
    """Return the inertia wrench per squared crank speed [N s2, N m s2], and that of gas and load [N, N m] or None."""
    inertia = shaking_loads(engine.unloaded, replace(point, speed=1.0, gas=None), fidelity)
    gas = fidelity.gas_of(point)
    if gas is None and not engine.is_loaded:
        return inertia, None
    loads = Spectrum(engine.cycle.base_order, np.zeros((1, 6), dtype=complex))
    if gas is not None:
        loads = fidelity.truncated(gas_loads(engine, gas, fidelity, point.fmep))
    if engine.geared:
        torque = less_load(loads.mapped(lambda wrench: wrench @ ROLL), engine, point, fidelity)
        loads += geared_moment(engine, torque)
    return inertia, with_machines(loads, engine, point)


@dataclass(frozen=True, eq=False)
class SpeedMap:
    """Mount forces over speed and order.

    Attributes
    ----------
    orders
        Orders that the loads hold, shape (n,).
    forces, firm
        Complex forces on the mounts, and on the same mounts if rigid, shape (speeds, n, mounts, 3) [N].
    """

    orders: Array
    forces: ComplexArray
    firm: ComplexArray

    @property
    def transmissibility(self) -> Array:
        """Transmissibility over speed and order, shape (speeds, n); zero without excitation (E11)."""
        over, under = (np.sqrt(np.sum(np.abs(f) ** 2, axis=(2, 3))) for f in (self.forces, self.firm))
        floor = 1e-12 * under.max(initial=0.0)
        return np.asarray(np.where(under > floor, over / np.where(under > floor, under, 1.0), 0.0))


def speed_map(
    mounting: ElasticMounting,
    inertia: Spectrum,
    gas: Spectrum | None,
    speeds: Array,
    minimum: float = 1e-7,
    only_orders: Sequence[float] | None = None,
) -> SpeedMap:
    """Return the mount forces at many speeds under the loads of `split_loads`, all orders and speeds solved together.

    Orders under the share `minimum` of the largest, at every speed, are left out, and those not in `only_orders`.
    """
    spectra = [inertia] if gas is None else [inertia, gas]
    base = common_base([spectrum.base for spectrum in spectra])
    columns = [spectrum.with_finer_base(base).coefficients for spectrum in spectra]
    longest = max(len(c) for c in columns)
    padded = [np.pad(c, ((0, longest - len(c)), (0, 0))) for c in columns]
    # inertia grows with the square of speed, gas does not
    growth = [np.asarray(speeds, dtype=float) ** 2, np.ones(len(speeds))][: len(spectra)]
    size = sum(np.abs(c).max(axis=1) * g.max(initial=0.0) for c, g in zip(padded, growth, strict=True))
    indices = np.flatnonzero(size > minimum * np.max(size, initial=0.0))
    if only_orders is not None:
        indices = indices[orders_equal(indices * float(base), only_orders)]
    orders: Array = np.asarray(indices, dtype=float) * float(base)
    parts = [c[indices] for c in padded]
    omegas = np.outer(speeds, orders).reshape(-1)
    drive = _over_speeds(growth, [mounting.drives(c) for c in parts]).reshape(-1, 6)
    forces = mounting.mount_forces(omegas, mounting.driven(omegas, drive))
    shape = (len(speeds), len(orders), len(mounting.mounts), 3)
    maps = rigid_mounting(mounting.mounts).maps
    firm = [np.einsum("mij,nj->nmi", maps, c) for c in parts]
    return SpeedMap(orders, forces.reshape(shape), _over_speeds(growth, firm))


def _over_speeds(growth: Sequence[Array], parts: Sequence[ComplexArray]) -> ComplexArray:
    total = np.multiply.outer(growth[0], parts[0])
    for grown, part in zip(growth[1:], parts[1:], strict=True):
        total += np.multiply.outer(grown, part)
    return np.asarray(total)
