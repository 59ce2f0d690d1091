"""Loads inside the crankcase: pistons on their walls, rods on their pins, crankshaft on its main bearings (B1-B11).

Piston and small end are driven along the cylinder axis by gas and inertia, P; the rod leans on
the cylinder wall with N, so that it turns as it does. Their sum is what the rod presses on its pin:

    P = -m s'' - A (p - p_crankcase)                                        (B1; textbook eqs. 16, 17)
    N = -P tan psi - dTheta psi'' / (l cos psi)                             (B2; eq. 12)
    F_pin = (P + i N) e^{i beta} + m_rot r w^2 e^{i (phi + theta)}          (B3; example 3)

A rod that is hinged to a master rod presses its knuckle pin so; the master's pin carries that as well, and the
master's piston leans on its wall by as much more as turns the master rod back (B11).

Pins, webs and counterweights load the crankshaft, each in its own plane; it is taken as cut in the
middle of its journals, so that the two bearings next to a load share it by the lever rule (B4). Bearings
are linear in every unbalance on their shaft. Taken as one beam, the shaft hands some of a load on to farther
bearings (B6), still linear. What gears and belts add is not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.bearing_loads.machine import Bearing, bearings_of
from laufruhe.machine import Cycle, Engine, GasModel, OperatingPoint, Rotor, Shaft, SliderCrank
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.exact_angles import as_turn, cis, star_sum
from laufruhe.numerics.spectrum import Spectrum, spectrum_with_kinks
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.mechanism import orders_of_masses
from laufruhe.physics.shaking_loads import rotor_loads, rotor_wrench
from laufruhe.physics.star_loads import order_index, spread

OfPart: TypeAlias = Callable[[Cycle, SliderCrank, float, GasModel | None, Fidelity], Spectrum]


def has_bearing_loads(engine: Engine) -> bool:
    """Return True if an engine has main bearings, and the loads of all its pins are modelled."""
    return bool(bearings_of(engine)) and all(part.has_pin_loads for part in engine.slider_cranks)


def pin_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the force of every rod on its pin, shape (n, cylinders, 3) [N], in the axes of C2 (B1-B3, B11).

    A hinged rod presses its knuckle pin.

    Raises
    ------
    ModelError
        If the crank turns unevenly, or a mechanism has no pin.
    """
    forces = _of_parts(_of_rod, engine, point, fidelity)
    if (carried := _carried(engine.slider_cranks)) is None:
        return forces
    return forces + crank_forces(engine, point, fidelity).mapped(partial(np.einsum, "mk,nkd->nmd", carried))


def crank_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the force of every cylinder on its crank pin, as `pin_forces`; hinged rods act on the master (B3, B11)."""
    return _of_parts(_of_crank, engine, point, fidelity)


def piston_pin_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return axial and side force on every piston pin, shape (n, cylinders, 2) [N] (B1, B2, B11).

    P points away from the crank, N towards i e^{i beta}; together they press the rod.
    """
    for part in engine.slider_cranks:
        if not part.has_rod:
            raise ModelError(f"{part.name} has no rod that leans on a cylinder wall; use the crank-pin force")
    forces = _of_parts(_of_piston_pin, engine, point, fidelity)
    if (carried := _carried(engine.slider_cranks)) is None:
        return forces
    across = np.multiply.outer(carried, np.array([[0.0, 1.0]]))
    return forces + _of_parts(_of_hinge, engine, point, fidelity).mapped(partial(np.einsum, "mkcd,nkc->nmd", across))


def _carried(parts: Sequence[SliderCrank]) -> Array | None:
    # ones where the rod of a column is hinged to the rod of a row; None without hinges
    crank_rods = [(part.shaft, part.x, part.bank) if part.master_bank is None else None for part in parts]
    master_rods = [(part.shaft, part.x, part.master_bank) for part in parts]
    hinges = np.array([[master_rod == rod for master_rod in master_rods] for rod in crank_rods], float)
    return hinges if hinges.any() else None


def _of_parts(of: OfPart, engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    _check_even(fidelity)
    return _side_by_side(of, engine.cycle, engine.slider_cranks, point.speed, fidelity.gas_of(point), fidelity)


def _check_even(fidelity: Fidelity) -> None:
    if fidelity.has_uneven_speed:
        raise ModelError("bearing loads are modelled at constant crank speed; remove fidelity.crank_inertia")


def main_bearing_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the force of the shafts on every main bearing, shape (n, bearings, 3) [N], linear in unbalances (B4)."""
    _check_even(fidelity)
    gas, parts = fidelity.gas_of(point), engine.slider_cranks
    of_rods = _of_rods(engine.cycle, parts, bearings_of(engine), point.speed, gas, fidelity)
    return of_rods + _of_rotors(engine, point.speed, fidelity)


@lru_cache(maxsize=64)
def _of_rods(
    cycle: Cycle, parts: tuple[SliderCrank, ...], bearings: tuple[Bearing, ...], speed: float, gas: GasModel | None,
    fidelity: Fidelity,
) -> Spectrum:  # fmt: skip
    pins = _side_by_side(_of_crank, cycle, parts, speed, gas, fidelity)
    shares = shares_of(bearings, tuple((part.shaft, part.x) for part in parts), fidelity.crankshaft)
    return pins.mapped(partial(np.einsum, "bp,npd->nbd", shares))


def _of_rotors(engine: Engine, speed: float, fidelity: Fidelity) -> Spectrum:
    # main bearing forces of webs, weights and throws, each of the order of its shaft
    bearings = bearings_of(engine)
    shafts = {bearing.shaft for bearing in bearings}
    rotors = [rotor for rotor in engine.rotors if rotor.shaft in shafts]
    shares = shares_of(bearings, tuple((rotor.shaft, rotor.x) for rotor in rotors), fidelity.crankshaft)
    indices = [order_index(engine.cycle, abs(rotor.shaft.ratio)) for rotor in rotors]
    out = np.zeros((max(indices, default=0) + 1, len(bearings), 3), dtype=complex)
    for rotor, index, share in zip(rotors, indices, shares.T, strict=True):
        out[index] += share[:, None] * rotor_wrench(rotor, speed)[:3]
    return Spectrum(engine.cycle.base_order, out)


def hammer_blows(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the vertical force on the rail under each wheel, shape (n, bearings, 1) [N], of turning masses (B9).

    The wheels stand where the main bearings do. What reciprocates is left out: it drives the frame, not the axle.
    """
    _check_even(fidelity)
    turning = replace(engine, rotors=(*engine.pins, *engine.rotors))
    return _of_rotors(turning, point.speed, fidelity).mapped(lambda forces: forces[..., 2:])


def bearing_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal projected area of every main bearing [1/m2] (B5; textbook, example 3)."""
    return np.array([1.0 / bearing.area for bearing in bearings_of(engine)])


def crank_pin_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal projected area of every big end [1/m2] (B5; textbook, example 3)."""
    return np.array([1.0 / part.big_end_area for part in engine.slider_cranks])


def drag_factors(engine: Engine, point: OperatingPoint) -> Array:
    """Return coefficient of friction times journal speed of every main bearing [m/s]; times force it is power (B7)."""
    return point.speed * np.array([bearing.drag for bearing in bearings_of(engine)])


@lru_cache(maxsize=256)
def _of_rod(cycle: Cycle, part: SliderCrank, speed: float, gas: GasModel | None, fidelity: Fidelity) -> Spectrum:
    load = _pin_loads(cycle, part, speed, gas, fidelity)
    y, z = cis(as_turn(part.bank)).imag, cis(as_turn(part.bank)).real
    turned = load.mapped(lambda forces: forces[:, 2:4] @ np.array([[0.0, y, z], [0.0, z, -y]]))
    # of a hinged rod nothing turns with the crank pin
    mass = part.rotating_mass if part.master_bank is None else 0.0
    rod = Rotor("rod", part.x, mass * part.crank_radius * cis(as_turn(part.throw)), part.shaft)
    series = turned + rotor_loads((rod,), speed, cycle).mapped(lambda wrench: wrench[:, :3])
    series.coefficients.setflags(write=False)
    return series


@lru_cache(maxsize=256)
def _of_crank(cycle: Cycle, part: SliderCrank, speed: float, gas: GasModel | None, fidelity: Fidelity) -> Spectrum:
    series = _of_rod(cycle, part, speed, gas, fidelity)
    if part.master_bank is not None:
        wall = 1j * cis(as_turn(part.master_bank))
        leaning = _of_hinge(cycle, part, speed, gas, fidelity)
        series = series + leaning.mapped(lambda force: force * np.array([0.0, wall.imag, wall.real]))
        series.coefficients.setflags(write=False)
    return series


def _of_piston_pin(cycle: Cycle, part: SliderCrank, speed: float, gas: GasModel | None, fidelity: Fidelity) -> Spectrum:
    return _pin_loads(cycle, part, speed, gas, fidelity).mapped(lambda forces: forces[:, :2])


def _of_hinge(cycle: Cycle, part: SliderCrank, speed: float, gas: GasModel | None, fidelity: Fidelity) -> Spectrum:
    return _pin_loads(cycle, part, speed, gas, fidelity).mapped(lambda forces: forces[:, 4:])


@lru_cache(maxsize=512)
def _pin_loads(cycle: Cycle, part: SliderCrank, speed: float, gas: GasModel | None, fidelity: Fidelity) -> Spectrum:
    """Return the loads of the masses and the gas of one cylinder, shape (n, 5) [N] (B1, B2, B11).

    They are axial and side force on the piston pin, both on the rod's pin, and the wall force of a master's piston.
    """
    if not part.has_pin_loads:
        raise ModelError(f"{part.name}: loads of its rod are not modelled; use forces on the block or the mounts")
    ratio = part.shaft.ratio
    series = _inertia_orders(part, fidelity) * (ratio * speed) ** 2
    moved = series * star_sum(np.ones((1, 1)), [part.star_turn], np.arange(len(series)))
    moved = moved if ratio > 0.0 else moved.conj()
    load = fidelity.truncated(Spectrum(cycle.base_order, spread(moved, order_index(cycle, abs(ratio)))))
    if gas is not None:
        load = load + fidelity.truncated(_gas_orders(cycle, part, gas, fidelity))
    load.coefficients.setflags(write=False)
    return load


def _reactions(part: SliderCrank, alpha: Array, force: ComplexArray, with_masses: bool) -> tuple[Array, ...]:
    # columns of `_pin_loads` under a force at the piston pin; masses at other pins may count
    pin = part.on_pin(np, alpha, force, with_masses)
    return force.real, force.imag, pin.real, pin.imag, part.on_wall_of_master(np, alpha, pin)


@lru_cache(maxsize=256)
def _inertia_orders(part: SliderCrank, fidelity: Fidelity) -> ComplexArray:
    # inertia part at unit speed of the crank, by order of its own angle, shape (n, 5) (B1, B2)
    is_short = fidelity.kinematics == "two-order" and type(part) is SliderCrank
    points, rods = np.split(orders_of_masses(part, _inertia_rows, (1,) * 10, is_short), 2)
    table = (points + rods if fidelity.rod == "rigid" else points).T
    last = fidelity.local_orders(part.shaft.ratio)
    return table if last is None else table[: last + 1]


def _inertia_rows(part: SliderCrank, alpha: Array, is_short: bool) -> tuple[Array, ...]:
    # columns of `_pin_loads` by point masses, then by swings of the rod
    motion = part.motion(np, alpha)
    mass, (_, _, acceleration) = motion.points[0]
    if is_short:
        acceleration = -part.crank_radius * (np.cos(alpha) + part.rod_ratio * np.cos(2.0 * alpha))
    sine, cosine = part.rod_lean(np, alpha)
    along, across = -mass * acceleration.real, 0.0 * alpha
    for inertia, (_, turning) in motion.swings if part.rod_ratio > 0.0 else ():
        across = across + inertia * turning / (part.rod_length * cosine)
    thrust = np.asarray(along * (1.0 - 1j * sine / cosine), dtype=complex)
    swing = np.asarray(1j * across, dtype=complex)
    return (*_reactions(part, alpha, thrust, True), *_reactions(part, alpha, swing, False))


@lru_cache(maxsize=256)
def _gas_orders(cycle: Cycle, part: SliderCrank, gas: GasModel, fidelity: Fidelity) -> Spectrum:
    # gas part over the crank angle of the engine, shape (n, 5) (B1, B2)
    def loads(angles: Array) -> Array:
        total: Array | float = 0.0
        for since in (angles + lag for lag in part.swept.lags):
            thrust = gas.thrust(part, cycle, since) * part.lean(np, since)
            total += np.stack(_reactions(part, part.fires_at + part.shaft.ratio * since, thrust, False), axis=1)
        return np.asarray(total)

    from_firing = spectrum_with_kinks(loads, fidelity.gas_steps, cycle.base_order, gas.breaks(part, cycle))
    return fidelity.truncated_gas(from_firing.shift(as_turn(part.firing_angle) / cycle.turns, part.firing_angle))


@lru_cache(maxsize=64)
def _side_by_side(
    of: OfPart, cycle: Cycle, parts: tuple[SliderCrank, ...], speed: float, gas: GasModel | None, fidelity: Fidelity
) -> Spectrum:
    # (n, d) of every slider-crank to (n, cylinders, d)
    loads = [of(cycle, part, speed, gas, fidelity) for part in parts]
    width = loads[0].coefficients.shape[-1] if loads else 3
    total = Spectrum(cycle.base_order, np.zeros((1, len(loads), width), dtype=complex))
    for one, load in zip(np.eye(len(loads)), loads, strict=True):
        total = total + load.mapped(partial(np.einsum, "k,nd->nkd", one))
    total.coefficients.setflags(write=False)
    return total


@lru_cache(maxsize=256)
def shares_of(bearings: tuple[Bearing, ...], places: tuple[tuple[Shaft, float], ...], crankshaft: str) -> Array:
    """Return the share of a load at each place that each bearing carries, shape (bearings, places) (B4, B6)."""
    shares = np.zeros((len(bearings), len(places)))
    for shaft in dict.fromkeys(bearing.shaft for bearing in bearings):
        rows = [k for k, bearing in enumerate(bearings) if bearing.shaft == shaft]
        columns = [k for k, (on, _) in enumerate(places) if on == shaft]
        columns_of_shares = SHARES[crankshaft]([bearings[k].x for k in rows], [places[k][1] for k in columns])
        shares[np.ix_(rows, columns)] = columns_of_shares
    shares.setflags(write=False)
    return shares


def lever_shares(bearings: Sequence[float], places: Sequence[float]) -> Array:
    """Return the shares by the lever rule, shape (bearings, places) (B4).

    A load outside all bearings hangs over: the two nearest carry it, the far one upwards.
    """
    order = np.argsort(bearings)
    x = np.asarray(bearings, dtype=float)[order]
    shares = np.zeros((len(x), len(places)))
    if not len(places):
        return shares
    if len(x) < 2:
        raise ModelError("a loaded shaft needs at least two main bearings; add one in [[main_bearings]]")
    columns = np.arange(len(places))
    first = np.clip(np.searchsorted(x, places, side="right") - 1, 0, len(x) - 2)
    far = (np.asarray(places) - x[first]) / (x[first + 1] - x[first])
    shares[first, columns], shares[first + 1, columns] = 1.0 - far, far
    return shares[np.argsort(order)]


def beam_shares(bearings: Sequence[float], places: Sequence[float]) -> Array:
    """Return the shares of a continuous uniform beam on rigid supports, as `lever_shares` (B6).

    Bending between bearings and loads is a cubic exactly, so that a beam element each is exact.
    """
    shares = lever_shares(bearings, places)
    if len(bearings) == 2:
        return shares
    x = np.unique([*bearings, *places])
    stiffness = np.zeros((2 * len(x), 2 * len(x)))
    for k, length in enumerate(np.diff(x) / np.ptp(x)):
        a, b, c = 12.0 / length**3, 6.0 / length**2, 2.0 / length
        element = [[a, b, -a, b], [b, 2 * c, -b, c], [-a, -b, a, -b], [b, c, -b, 2 * c]]
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += element
    supports, loaded = 2 * np.searchsorted(x, bearings), 2 * np.searchsorted(x, places)
    free = np.setdiff1d(np.arange(2 * len(x)), supports)
    moved = np.zeros((2 * len(x), len(supports)))
    moved[supports, np.arange(len(supports))] = 1.0
    # a support carries as much of a load as the beam comes down there when that support does (Maxwell, Betti)
    moved[free] = -np.linalg.solve(stiffness[np.ix_(free, free)], stiffness[np.ix_(free, supports)])
    return np.asarray(moved[loaded].T)


SHARES = {"cut": lever_shares, "beam": beam_shares}


SIDES = math.radians(60.0)
"""A load wears its bearing this far to either side."""


def wear_of(path: ComplexArray, angles: Array) -> Array:
    """Return the load of every direction (k,) over the cycle as a share of the largest, 0 to 1, shape (k,) (B10).

    The path (n,) is the force on the bearing at equal steps of the cycle [N], across the crank axis (C4).
    """
    size = np.abs(path)
    total = size @ (np.outer(path, np.exp(-1j * angles)).real >= math.cos(SIDES) * size[:, None])
    return np.asarray(total / (total.max() or 1.0))
