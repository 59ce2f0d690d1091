"""Many engines of one layout in one call: speeds, masses, rod ratios, unbalances (F12).

A load is its size times a shape. Sizes differ from engine to engine, shapes belong to
the crank star and the mounts; so a whole engine is one row of sizes times a matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, GasModel, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.batch_norms import CACHE_BYTES, BatchNorm
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import order_coefficients
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import rotor_loads, unit_star_load
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure, bends_of

_NODES, _PART = 24, 4096


@dataclass(frozen=True, eq=False)
class EngineArrays:
    """Numbers [SI] that differ from engine to engine, each of shape (engines,); those of the template when None.

    Attributes
    ----------
    reciprocating_mass, rotating_mass
        Per cylinder.
    rod_ratio
        lambda. Gas goes with the template's own only: its pressure depends on it.
    unbalances
        Of the rotors in the order of the template, complex, shape (engines, rotors).
    """

    speed: Array
    reciprocating_mass: Array | None = None
    rotating_mass: Array | None = None
    crank_radius: Array | None = None
    rod_ratio: Array | None = None
    rod_inertia_deficit: Array | None = None
    unbalances: NDArray[np.complex128] | None = None


class EngineFamily:
    """An engine whose cylinders are alike, and all engines that differ from it in sizes only.

    Parameters
    ----------
    template
        One crank at ratio 1 through the origin, cylinders alike, no offset.
    measure
        Of a load.
    fidelity
        Orders kept (at most 24 when None) and samples.
    gas
        Of every engine.

    Raises
    ------
    ModelError
        If the template is not of that kind.
    """

    def __init__(self, template: Engine, measure: Measure, fidelity: Fidelity, gas: GasModel | None = None) -> None:
        if not measure.is_load or measure.is_inside:
            raise ModelError(f"a family measures loads on the block and its mounts, not {measure.name}")
        self.template, self.fidelity = template, fidelity
        self._first, self._point = _alike(template), OperatingPoint("all", 1.0, gas)
        self._gas = fidelity.gas_of(self._point)
        needed = order_coefficients.orders_needed(self._first.rod_ratio)
        self._orders = range(1, min(fidelity.orders or needed, needed) + 1)
        rotors = max((abs(rotor.shaft.ratio) for rotor in template.rotors), default=1.0)
        self._norm = self._batched(measure, [fidelity.kept(shape, rotors) for shape in self._shapes()])

    def values(self, arrays: EngineArrays, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """The measure of every engine, shape (engines,)."""
        coefficients, out = self._coefficients(arrays.rod_ratio), np.empty(len(arrays.speed))
        for start in range(0, len(out), _PART):
            part = slice(start, start + _PART)
            out[part] = self._norm.values(self._sizes(arrays, part, coefficients(part)), threads, cache_bytes)
        return out

    def _shapes(self) -> list[Spectrum]:
        """Loads of unit size: forces along every cylinder axis, roll moments, masses at the pins, rotors, gas.

        A roll moment in phase and one a quarter ahead are one: without an offset it is odd (L3, L4).
        """
        engine, cycle = self.template, self.template.cycle
        found = [unit_star_load(engine, order, 1.0, roll=False) for order in self._orders]
        found += [unit_star_load(engine, order, 1.0j, roll=True) for order in self._orders]
        pins = [Rotor(p.name, p.x, complex(np.exp(1j * p.throw)), p.shaft) for p in engine.slider_cranks]
        found.append(rotor_loads(pins, 1.0, cycle))
        units = [replace(rotor, unbalance=unit) for rotor in engine.rotors for unit in (1.0, 1.0j)]
        found += [rotor_loads([rotor], 1.0, cycle) for rotor in units]
        if self._gas is not None:
            gas = gas_loads(engine, self._gas, self.fidelity)
            found.append(gas.each(lambda loads: loads / self._first.crank_radius))
        return found

    def _sizes(self, arrays: EngineArrays, part: slice, coefficients: Array) -> Array:
        """What every shape is multiplied with, shape (engines, shapes)."""

        def column(key: str) -> Array:
            values = getattr(arrays, key)
            return np.full((count, 1), getattr(self._first, key)) if values is None else values[part, None]

        square = np.asarray(arrays.speed[part, None], dtype=float) ** 2
        count, given = len(square), np.array([rotor.unbalance for rotor in self.template.rotors], dtype=complex)
        radius = column("crank_radius")
        force, roll, rod = np.split(coefficients, 3, axis=1)
        deficit = column("rod_inertia_deficit") * (self.fidelity.rod == "rigid")
        inertia = column("reciprocating_mass") * radius * square
        unbalances = (
            np.broadcast_to(given, (count, len(given))) if arrays.unbalances is None else arrays.unbalances[part]
        )
        if unbalances.shape != (count, len(given)):
            raise ModelError(f"unbalances need a column for each of the {len(given)} rotors of the template")
        pairs = np.stack([unbalances.real, unbalances.imag], axis=2).reshape(count, -1) * square
        columns = [-force * inertia, roll * inertia * radius + rod * deficit * square]
        columns += [column("rotating_mass") * radius * square, pairs]
        return np.ascontiguousarray(np.concatenate([*columns, *([] if self._gas is None else [radius])], axis=1))

    def _coefficients(self, rod_ratios: Array | None) -> Callable[[slice], Array]:
        """Order coefficients 1 ... n of force, inertia roll and rod roll of some engines, shape (engines, 3 n).

        The closed forms are analytic in lambda, so that Chebyshev series of two dozen nodes
        leave a rounding for the rod ratios of engines.
        """
        if rod_ratios is None:
            own = self._closed_forms(self._first.rod_ratio)[None]
            return lambda _: own
        if self._gas is not None:
            raise ModelError("rod ratios cannot differ with gas, whose pressure depends on them; leave one of them out")
        low, high = float(np.min(rod_ratios)), float(np.max(rod_ratios))
        if not 0.0 < low <= high < 1.0:
            raise ModelError(f"rod ratios from {low:g} to {high:g} must lie between 0 and 1")
        half, middle = max(0.5 * (high - low), 1e-9 * high), 0.5 * (high + low)
        nodes = chebyshev.chebpts1(_NODES)
        values = np.array([self._closed_forms(middle + half * node) for node in nodes])
        series = np.linalg.solve(chebyshev.chebvander(nodes, _NODES - 1), values)
        places = (rod_ratios - middle) / half
        return lambda part: np.asarray(chebyshev.chebvander(places[part], _NODES - 1) @ series)

    def _closed_forms(self, rod_ratio: float) -> Array:
        n, swings = self._orders.stop - 1, rod_ratio > 0.0
        force = order_coefficients.piston_acceleration_orders(rod_ratio, 0.0, n).real
        roll = order_coefficients.inertia_roll_orders(rod_ratio, 0.0, 1.0, n).imag
        rod = order_coefficients.rod_roll_orders(rod_ratio, 0.0, 1.0, n).imag if swings else np.zeros(n + 1)
        return np.concatenate([force[1:], roll[1:], rod[1:]])

    def _batched(self, measure: Measure, shapes: list[Spectrum]) -> BatchNorm:
        engine, found = self.template, []
        maps = rigid_mounting(engine.mounts).maps if engine.mounts else np.zeros((0, 3, 6))
        for wrench in shapes:
            loads = PointLoads(self._point, wrench, wrench.each(lambda own: np.einsum("mij,nj->nmi", maps, own)))
            found.append(Evaluation(engine, self.fidelity, (loads,), self.fidelity.samples))
        bends = max(
            (bends_of(measure, each.signals(measure.load), engine) for each in found), key=lambda own: len(own[0])
        )
        rows = [each.rows(measure, bends=bends) for each in found]
        stacked = np.stack([each.vectors for each in rows])
        driven = np.any(stacked != 0.0, axis=(0, 1))
        driven[:1] |= not driven.any()
        return BatchNorm(measure.norm, np.ascontiguousarray(stacked[:, :, driven].transpose(2, 0, 1)), rows[0].grid)


def _alike(engine: Engine) -> SliderCrank:
    first = engine.slider_cranks[0]
    if engine.geared:
        raise ModelError("a family has all its inertia on the crank; leave geared inertias out")
    for part in engine.slider_cranks:
        as_first = replace(part, name=first.name, x=first.x, throw=first.throw, bank=first.bank, bore=first.bore,
                           firing_angle=first.firing_angle)  # fmt: skip
        plain = type(part) is SliderCrank and not part.offset
        if not plain or as_first != first or part.shaft.ratio != 1.0 or part.shaft.y or part.shaft.z:
            raise ModelError(f"{part.name}: a family needs cylinders that are alike, without offset, on one crank")
    return first
