"""Loads of a mechanism on the block by order of its own crank angle (L2-L4, L7).

Every mechanism says how its masses move (`SliderCrank.motion`). Momentum and angular momentum
of that motion are its loads, whatever it is; where closed forms are known, as of the plain
slider-crank, they are taken in place of a transform.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import SliderCrank
from laufruhe.machine.bodies import Motion
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics import order_coefficients
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.rigid_body import plane_wrench

_TAIL = 1e-15
_MAX_STEPS = 1 << 16


class Direction(IntEnum):
    """Direction of a load in the frame of its cylinder: axial, towards +i e^{i beta}, or about the crank."""

    AXIAL = 0
    TRANSVERSE = 1
    ROLL = 2


@dataclass(frozen=True)
class Effect:
    """Load of a moving part of one cylinder, in one direction, as a Fourier series.

    Attributes
    ----------
    size
        Factor of the series, besides the square of the speed [kg m, kg m2].
    shape
        Key of the series: loads with equal keys have equal series.
    series
        Coefficients by order of the crank's own angle (C8).
    """

    direction: Direction
    size: float
    shape: Hashable
    series: Callable[[], ComplexArray]


def effects_of(part: SliderCrank, fidelity: Fidelity) -> tuple[list[Effect], list[Effect]]:
    """Return the loads of point masses (L2, L3, L7), and the roll moments that these leave out of rods (L4, L7)."""
    masses, rods = (_slider_crank if type(part) is SliderCrank else _of_momentum)(part, fidelity)
    masses_and_rods = masses, rods if fidelity.rod == "rigid" else ()
    of_masses, of_rods = ([effect for effect in effects if effect.size != 0.0] for effects in masses_and_rods)
    return of_masses, of_rods


def momentum_loads(part: SliderCrank, motion: Motion, square: Any, turning: Any = 0.0) -> tuple[Any, Any, Any]:
    """Return the force on the block in the turned plane, and roll moments of point masses and of swings (L7).

    Its crank has this squared speed [rad2/s2] and turns faster by `turning` [rad/s2].
    """
    ratio = part.shaft.ratio
    force, roll, rods = 0.0, 0.0, 0.0
    for mass, (place, velocity, acceleration) in motion.points:
        pull = mass * (acceleration * square + velocity * turning)
        force = force - pull
        roll = roll + (place.conjugate() * pull).imag - ratio * (velocity.conjugate() * pull).real
    for inertia, (rate, acceleration) in motion.swings:
        rods = rods + inertia * (acceleration * square + rate * turning) * (1.0 - ratio * rate)
    return force, roll, rods


def reduced(motion: Motion, with_rods: bool = True) -> tuple[Any, Any]:
    """Return the inertia of a motion reduced to its own crank [kg m2], and its derivative by that angle (F3)."""
    inertia, slope = 0.0, 0.0
    for mass, (_, velocity, acceleration) in motion.points:
        inertia = inertia + mass * np.abs(velocity) ** 2
        slope = slope + 2.0 * mass * (np.conj(velocity) * acceleration).real
    for inertia_of_rod, (rate, swing) in motion.swings if with_rods else ():
        inertia, slope = inertia + inertia_of_rod * rate**2, slope + 2.0 * inertia_of_rod * rate * swing
    return inertia, slope


def cylinder_wrench(part: SliderCrank, motion: Motion, axis: Any, square: Any, turning: Any = 0.0,
                    with_rods: bool = True) -> Any:  # fmt: skip
    """Return the wrench of `momentum_loads`, shape (6, ...), for a cylinder axis as a unit number (C4)."""
    force, roll, rods = momentum_loads(part, motion, square, turning)
    force = force * axis
    wrench = plane_wrench(force.imag, force.real, part.x, part.shaft)
    wrench[3] += roll + rods if with_rods else roll
    return wrench


def two_order_roll(rod_ratio: float) -> ComplexArray:
    """Return (cos a + lam cos 2a)(-1)(sin a + lam/2 sin 2a) to first order in lam: roll moment (L3) and torque (T1)."""
    return 1j * np.array([0.0, -rod_ratio / 4.0, 0.5, 0.75 * rod_ratio])


def _slider_crank(part: SliderCrank, fidelity: Fidelity) -> tuple[tuple[Effect, ...], tuple[Effect, ...]]:
    """Return the loads of the reciprocating mass of a slider-crank, then those of its rod, in closed form (K7-K10)."""
    radius, ratio = part.crank_radius, part.shaft.ratio
    shape = part.rod_ratio, part.offset_ratio

    def force() -> ComplexArray:
        if fidelity.kinematics == "two-order":
            return np.array([0.0, 1.0, part.rod_ratio], dtype=complex)
        return -order_coefficients.piston_acceleration_orders(*shape, _highest(part, fidelity))

    def roll() -> ComplexArray:
        if fidelity.kinematics == "two-order":
            return ratio * two_order_roll(part.rod_ratio)
        return order_coefficients.inertia_roll_orders(*shape, ratio, _highest(part, fidelity))

    def rod() -> ComplexArray:
        if fidelity.kinematics == "two-order":
            return np.array([0.0, -1j * part.rod_ratio])
        return order_coefficients.rod_roll_orders(*shape, ratio, _highest(part, fidelity))

    mass, deficit = part.reciprocating_mass, part.rod_inertia_deficit if part.rod_ratio > 0.0 else 0.0
    return (
        Effect(Direction.AXIAL, mass * radius, shape, force),
        Effect(Direction.ROLL, mass * radius**2, shape, roll),
    ), (Effect(Direction.ROLL, deficit, ("rod", shape), rod),)


TWO_ORDER_ROLL = 3
"""Last order of a roll moment with two-order kinematics."""


def _highest(part: SliderCrank, fidelity: Fidelity) -> int:
    needed = order_coefficients.orders_needed(part.rod_ratio, part.offset_ratio)
    limit = fidelity.local_orders(part.shaft.ratio)
    return needed if limit is None else min(needed, limit)


def _of_momentum(part: SliderCrank, fidelity: Fidelity) -> tuple[tuple[Effect, ...], tuple[Effect, ...]]:
    # with two-order kinematics any mechanism has as many orders of each load as a slider-crank
    table = momentum_orders(part)
    limit = fidelity.local_orders(part.shaft.ratio)
    shape = part, fidelity.kinematics, limit

    def series(row: int, count: int) -> Callable[[], ComplexArray]:
        last = count if fidelity.kinematics == "two-order" else len(table[row]) - 1
        return lambda: table[row, : min(last, last if limit is None else limit) + 1]

    masses = tuple(Effect(direction, 1.0, shape, series(direction, 2 + direction // 2)) for direction in Direction)
    return masses, (Effect(Direction.ROLL, 1.0, ("rod", shape), series(3, 1)),)


@lru_cache(maxsize=1024)
def momentum_orders(part: SliderCrank) -> ComplexArray:
    """Return the loads at unit crank speed by a transform of the exact motion, shape (4, orders) (L7).

    They are axial and transverse force, and the roll moments of point masses and of swings.
    """
    table = orders_of_masses(part, _momentum_rows, (1, 1, 2, 2))
    # a periodic momentum has no mean derivative
    table[:, 0] = 0.0
    table.setflags(write=False)
    return table


def _momentum_rows(part: SliderCrank, alpha: Array) -> tuple[Any, ...]:
    force, roll, rods = momentum_loads(part, part.motion(np, alpha), 1.0)
    return np.real(force), np.imag(force), roll, rods


def orders_of_masses(
    part: SliderCrank, rows: Callable[..., Sequence[Any]], lengths: tuple[int, ...], *options: bool
) -> ComplexArray:
    """Return the coefficients of loads that are linear in the masses of a mechanism, shape (loads, orders).

    No mass decides how many orders there are, so loads are affine in the masses, also beside a signal with kinks.

    Parameters
    ----------
    rows
        Function that returns the loads of a mechanism at angles of its crank, and takes these `options`.
    lengths
        Power of length in the unit of each load.
    """
    masses = np.array([getattr(part, name) for name in _units(part)])
    # neither its place nor its phase changes the loads in the plane of its axis
    bare = replace(part.only({}), x=0.0, throw=0.0, firing_angle=0.0)
    return np.asarray(np.tensordot(masses, _unit_orders(bare, rows, lengths, options), 1))


def _units(part: SliderCrank) -> dict[str, int]:
    # masses and inertias by field name, with their powers of length
    return {name: length for name, (mass, length) in part.powers.items() if mass}


@lru_cache(maxsize=512)
def _unit_orders(
    part: SliderCrank, rows: Callable[..., Sequence[Any]], lengths: tuple[int, ...], options: tuple[bool, ...]
) -> ComplexArray:
    """Return the coefficients of the loads of a unit of each mass and inertia, shape (masses, loads, orders)."""
    units = _units(part)
    of_units = [part.only({name: 1.0}) for name in units]
    scale = [part.crank_radius ** (length - power) for power in units.values() for length in lengths]

    def signals(alpha: Array) -> list[Any]:
        return [row for unit in of_units for row in rows(unit, alpha, *options)]

    table = resolved_orders(signals, np.array(scale)[:, None], part.name)
    return table.reshape(len(units), len(lengths), -1)


def resolved_orders(rows: Callable[[Array], Sequence[Any]], scale: Any, name: str) -> ComplexArray:
    """Return the coefficients (functions, orders) of periodic functions of the crank's own angle.

    As many orders are taken as matter beside the scale of each function, shape (functions, 1).
    """
    steps = 64
    while steps <= _MAX_STEPS:
        alpha = 2.0 * np.pi * np.arange(steps) / steps
        sampled = np.stack([np.broadcast_to(row, alpha.shape) for row in rows(alpha)])
        table = 2.0 * np.fft.rfft(sampled)[:, :-1] / steps
        table[:, 0] /= 2.0
        sizes = np.abs(table / scale).max(axis=0)
        if sizes[-steps // 8 :].max() <= _TAIL * sizes.max():
            last = int(np.flatnonzero(sizes > 0.1 * _TAIL * sizes.max()).max(initial=0))
            return np.ascontiguousarray(table[:, : last + 1])
        steps *= 2
    raise ModelError(f"{name}: its motion is too close to locking to be resolved; lengthen the rods")
