"""Many engines of one layout in one call: speeds, masses, rod ratios, unbalances (F12).

A load is its size times a shape. Sizes differ from engine to engine, shapes belong to
the crank star and the mounts; so a whole engine is one row of sizes times a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, GasModel, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.batch_norms import CACHE_BYTES, BatchNorm
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import order_coefficients
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import rotor_loads, unit_star_load
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure, load_rows

Array = NDArray[np.float64]

_NODES = 24
_PART = 4096


@dataclass(frozen=True, eq=False)
class EngineArrays:
    """Numbers that differ from engine to engine, each of shape (engines,); those of the template when None.

    Attributes
    ----------
    speed
        [rad/s].
    reciprocating_mass, rotating_mass
        Per cylinder [kg].
    crank_radius
        [m].
    rod_ratio
        lambda. Gas goes with the template's own only: its pressure depends on it.
    rod_inertia_deficit
        [kg m2].
    unbalances
        Of the rotors in the order of the template, complex, shape (engines, rotors) [kg m].
    """

    speed: Array
    reciprocating_mass: Array | None = None
    rotating_mass: Array | None = None
    crank_radius: Array | None = None
    rod_ratio: Array | None = None
    rod_inertia_deficit: Array | None = None
    unbalances: NDArray[np.complex128] | None = None


@dataclass(frozen=True, eq=False)
class _Table:
    """Chebyshev series in (lambda - middle) / half."""

    middle: float
    half: float
    series: Array


class EngineFamily:
    """An engine whose cylinders are alike, and all engines that differ from it in sizes only.

    Parameters
    ----------
    template
        One crank at ratio 1 through the origin, cylinders alike, no offset.
    quantity
        A load.
    fidelity
        Orders kept (at most 24 when None) and samples.
    gas
        Of every engine.

    Raises
    ------
    ModelError
        If the template is not of that kind.
    """

    def __init__(self, template: Engine, quantity: Measure, fidelity: Fidelity, gas: GasModel | None = None) -> None:
        self.template, self.fidelity, self.gas = template, fidelity, gas
        first = _alike(template)
        needed = order_coefficients.orders_needed(first.rod_ratio)
        self._highest = min(fidelity.orders or needed, needed)
        shapes = [*self._force_shapes(), *self._roll_shapes(), *self._rotor_shapes()]
        if gas is not None and fidelity.gas:
            per_radius = gas_loads(template, gas, fidelity)
            shapes.append(Spectrum(per_radius.base, per_radius.coefficients / first.crank_radius))
        if fidelity.orders is not None:
            rotors = max((abs(rotor.shaft.ratio) for rotor in template.rotors), default=1.0)
            shapes = [shape.kept(max(fidelity.orders, rotors)) for shape in shapes]
        self._norm = self._batched(quantity, shapes)

    def values(self, arrays: EngineArrays, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """The quantity of every engine, shape (engines,)."""
        out = np.empty(len(arrays.speed))
        table = self._table(arrays.rod_ratio)
        for start in range(0, len(out), _PART):
            part = slice(start, start + _PART)
            out[part] = self._norm.values(self._sizes(_cut(arrays, part), table), threads, cache_bytes)
        return out

    def _force_shapes(self) -> list[Spectrum]:
        """Unit force along every cylinder axis, by local order (L2, L6)."""
        return [unit_star_load(self.template, order, 1.0, roll=False) for order in range(1, self._highest + 1)]

    def _roll_shapes(self) -> list[Spectrum]:
        """Unit roll moment, in phase and a quarter ahead are one: without an offset it is odd (L3, L4)."""
        return [unit_star_load(self.template, order, 1.0j, roll=True) for order in range(1, self._highest + 1)]

    def _rotor_shapes(self) -> list[Spectrum]:
        cycle, found = self.template.cycle, []
        pins = [Rotor(p.name, p.x, complex(np.exp(1j * p.throw)), p.shaft) for p in self.template.slider_cranks]
        found.append(rotor_loads(pins, 1.0, cycle))
        for rotor in self.template.rotors:
            found += [rotor_loads([replace(rotor, unbalance=unit)], 1.0, cycle) for unit in (1.0, 1.0j)]
        return found

    def _sizes(self, arrays: EngineArrays, table: _Table | None) -> Array:
        """What every shape is multiplied with, shape (engines, shapes)."""
        first = self.template.slider_cranks[0]
        count = len(arrays.speed)
        square = np.asarray(arrays.speed, dtype=float) ** 2
        mass = _or(arrays.reciprocating_mass, first.reciprocating_mass, count)
        rotating = _or(arrays.rotating_mass, first.rotating_mass, count)
        radius = _or(arrays.crank_radius, first.crank_radius, count)
        deficit = _or(arrays.rod_inertia_deficit, first.rod_inertia_deficit, count)
        if arrays.rod_ratio is not None and self.gas is not None and self.fidelity.gas:
            raise ModelError("rod ratios cannot differ with gas, whose pressure depends on them; leave one of them out")
        force, roll, rod = self._coefficients(arrays.rod_ratio, table, count)
        if self.fidelity.rod == "mass-only":
            rod = np.zeros_like(rod)
        mr = (mass * radius * square)[:, None]
        columns = [-force * mr, roll * mr * radius[:, None] + rod * (deficit * square)[:, None]]
        columns.append((rotating * radius * square)[:, None])
        given = np.array([rotor.unbalance for rotor in self.template.rotors], dtype=complex)
        unbalances = np.broadcast_to(given, (count, len(given))) if arrays.unbalances is None else arrays.unbalances
        if unbalances.shape != (count, len(given)):
            raise ModelError(f"unbalances need the shape ({count}, {len(given)}), the rotors of the template")
        pairs = np.stack([unbalances.real, unbalances.imag], axis=2).reshape(count, -1) * square[:, None]
        columns.append(pairs)
        if self.gas is not None and self.fidelity.gas:
            columns.append(radius[:, None])
        return np.ascontiguousarray(np.concatenate(columns, axis=1))

    def _table(self, rod_ratios: Array | None) -> _Table | None:
        """Chebyshev series of the order coefficients over the rod ratios that occur.

        The closed forms are analytic in lambda, so that two dozen nodes leave a rounding
        for the rod ratios of engines.
        """
        if rod_ratios is None:
            return None
        low, high = float(np.min(rod_ratios)), float(np.max(rod_ratios))
        if not 0.0 < low <= high < 1.0:
            raise ModelError(f"rod ratios from {low:g} to {high:g} must lie between 0 and 1")
        half, middle = max(0.5 * (high - low), 1e-9 * high), 0.5 * (high + low)
        nodes = chebyshev.chebpts1(_NODES)
        values = np.array([np.concatenate(self._closed_forms(middle + half * node)) for node in nodes])
        return _Table(middle, half, np.linalg.solve(chebyshev.chebvander(nodes, _NODES - 1), values))

    def _coefficients(self, rod_ratios: Array | None, table: _Table | None, count: int) -> tuple[Array, Array, Array]:
        """Order coefficients 1 ... n of force, inertia roll and rod roll, each (engines, n)."""
        n = self._highest
        if rod_ratios is None or table is None:
            values = np.concatenate(self._closed_forms(self.template.slider_cranks[0].rod_ratio))
            values = np.broadcast_to(values, (count, 3 * n))
        else:
            places = (rod_ratios - table.middle) / table.half
            values = chebyshev.chebvander(places, _NODES - 1) @ table.series
        return values[:, :n], values[:, n : 2 * n], values[:, 2 * n :]

    def _closed_forms(self, rod_ratio: float) -> tuple[Array, Array, Array]:
        n = self._highest
        force = order_coefficients.piston_acceleration_orders(rod_ratio, 0.0, n)[1:].real
        roll = order_coefficients.inertia_roll_orders(rod_ratio, 0.0, 1.0, n)[1:].imag
        if self.template.slider_cranks[0].rod_inertia_deficit == 0.0 and rod_ratio <= 0.0:
            return force, roll, np.zeros(n)
        return force, roll, order_coefficients.rod_roll_orders(rod_ratio, 0.0, 1.0, n)[1:].imag

    def _batched(self, quantity: Measure, shapes: list[Spectrum]) -> BatchNorm:
        engine, samples = self.template, self.fidelity.samples
        if quantity.channel is channels.MOUNT_FORCE:
            maps = rigid_mounting(engine.mounts).maps
            shapes = [Spectrum(s.base, np.einsum("mij,nj->nmi", maps, s.coefficients)) for s in shapes]
        point = (OperatingPoint("all", 1.0),)
        names = [mount.name for mount in engine.mounts]
        rebased = [shape.rebased(engine.cycle.base_order) for shape in shapes]
        rows = [load_rows(quantity, point, [shape], names, samples) for shape in rebased]
        stacked = np.stack([row.vectors for row in rows])
        driven = np.any(stacked != 0.0, axis=(0, 1))
        if not driven.any():
            driven[:1] = True
        return BatchNorm(quantity.norm, np.ascontiguousarray(stacked[:, :, driven].transpose(2, 0, 1)), rows[0].grid)


def _alike(engine: Engine) -> SliderCrank:
    first = engine.slider_cranks[0]
    for part in engine.slider_cranks:
        as_first = replace(part, name=first.name, x=first.x, throw=first.throw, bank=first.bank, bore=first.bore,
                           firing_angle=first.firing_angle)  # fmt: skip
        plain = type(part) is SliderCrank and not part.offset
        if not plain or as_first != first or part.shaft.ratio != 1.0 or part.shaft.y or part.shaft.z:
            raise ModelError(f"{part.name}: a family needs cylinders that are alike, without offset, on one crank")
    return first


def _or(values: Array | None, given: float, count: int) -> Array:
    return np.full(count, given) if values is None else np.asarray(values, dtype=float)


def _cut(arrays: EngineArrays, part: slice) -> EngineArrays:
    given = {field.name: getattr(arrays, field.name) for field in fields(arrays)}
    return replace(arrays, **{name: values[part] for name, values in given.items() if values is not None})
