"""Engines reduced to one cylinder or to some rotors, so that their loads can be computed alone.

The other cylinders are removed, or keep their places without mass. They must keep their places for loads inside the
crankcase, because one cylinder may load the pins and bearings of another.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import replace

from laufruhe.machine import Chambers, Engine, GasModel, OperatingPoint, Rotor, SliderCrank
from laufruhe.machine.facing import Facing
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.physics.gas_cycle import alike_under
from laufruhe.problem.problem import Problem

BANK_SAMPLES = (0.0, 0.5 * math.pi, math.pi)
"""Bank angles at which loads determine those at any bank angle [rad]: loads turn with the bank, or stay."""
LEAD_DIGITS = 9
"""Decimal digits to which leads are compared [rad]."""


def massless_copy(part: SliderCrank) -> SliderCrank:
    """Return a cylinder without mass, and without a piston area on which gas could act."""
    return replace(part.only({}), bore=None if part.bore is None else 0.0)


def isolate_cylinder(engine: Engine, k: int, keep_places: bool, part: SliderCrank | None = None) -> Engine:
    """Return the engine reduced to cylinder k, without rotors.

    Parameters
    ----------
    engine
        Engine with all cylinders.
    k
        Index of the cylinder.
    keep_places
        Whether the other cylinders stay as massless copies.
    part
        Cylinder to put in place of cylinder k; None for that of the engine.
    """
    cylinders = engine.slider_cranks
    active = cylinders[k] if part is None else part
    with_idle = [active if j == k else massless_copy(idle) for j, idle in enumerate(cylinders)]
    return replace(engine, slider_cranks=tuple(with_idle) if keep_places else (active,), rotors=())


def isolate_rotors(engine: Engine, rotors: Sequence[Rotor], keep_places: bool) -> Engine:
    """Return the engine reduced to some rotors; massless copies of the cylinders stay if `keep_places`."""
    parts = tuple(map(massless_copy, engine.slider_cranks)) if keep_places else ()
    return replace(engine, slider_cranks=parts, rotors=tuple(rotors))


def split_by_bank(upright: ComplexArray, across: ComplexArray, upside: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return the factors of cos(bank), of sin(bank) and of 1 in the loads of a cylinder.

    Parameters
    ----------
    upright, across, upside
        Load coefficients at the three bank angles of `BANK_SAMPLES`.
    """
    constant = 0.5 * (upright + upside)
    return 0.5 * (upright - upside), across - constant, constant


def only_gas_of(problem: Problem, name: str) -> Problem:
    """Return the problem with the gas of the named cylinder only."""
    return replace(problem, points=tuple(_point_with_gas_of(point, name) for point in problem.points))


def motored(problem: Problem) -> Problem:
    """Return the problem without gas."""
    return replace(problem, fidelity=replace(problem.fidelity, gas=False, gas_orders=None))


def gas_distinguishes_cylinders(problem: Problem) -> bool:
    """Return True if gas acts on measures of the problem, and differs between cylinders."""
    if not problem.depends_on_gas:
        return False
    gases = [gas for gas in map(problem.fidelity.gas_of, problem.points) if gas is not None]
    return len({tuple(_gas_key(gas, part) for gas in gases) for part in problem.engine.cylinders}) > 1


def _gas_key(gas: GasModel, part: SliderCrank) -> Hashable:
    # without rounding errors in the lead of a facing piston
    facing = part.facing
    if isinstance(facing, Facing):
        part = replace(part, facing=replace(facing, ahead=round(facing.ahead, LEAD_DIGITS)))
    return alike_under(gas, part)


def _point_with_gas_of(point: OperatingPoint, name: str) -> OperatingPoint:
    gas = point.gas
    if not isinstance(gas, Chambers):
        # massless copies have no bore, so that other gas models do not act on them
        return point
    chambers = tuple(replace(chamber, cylinders=(name,)) for chamber in gas.chambers if name in chamber.cylinders)
    return replace(point, gas=replace(gas, chambers=chambers) if chambers else None)
