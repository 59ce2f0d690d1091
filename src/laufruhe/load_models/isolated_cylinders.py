"""Parts of an engine that load by themselves: one cylinder, or some rotors, the other cylinders idle in their places.

What an idle cylinder leaves in place are its pin and its bearings: loads inside the crankcase have places of every
cylinder, and one cylinder may load those of another.
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

QUARTERS = (0.0, 0.5 * math.pi, math.pi)
"""Banks that tell what a cylinder loads at any other: all of it leans with the bank, or not at all."""
SAME = 9
"""Digits of a lead [rad] that count."""


def massless_copy(part: SliderCrank) -> SliderCrank:
    """A cylinder without mass, and without an area that a charge could press."""
    return replace(part.only({}), bore=None if part.bore is None else 0.0)


def isolate(engine: Engine, k: int, beside: bool, part: SliderCrank | None = None) -> Engine:
    """Cylinder k alone, or another in its place; the places of the others beside it where these are asked."""
    parts = engine.slider_cranks
    own = parts[k] if part is None else part
    every = [own if j == k else massless_copy(other) for j, other in enumerate(parts)]
    return replace(engine, slider_cranks=tuple(every) if beside else (own,), rotors=())


def only_rotors(engine: Engine, rotors: Sequence[Rotor], beside: bool) -> Engine:
    """These rotors alone; the places of the cylinders beside them where these are asked."""
    parts = tuple(map(massless_copy, engine.slider_cranks)) if beside else ()
    return replace(engine, slider_cranks=parts, rotors=tuple(rotors))


def leaning(upright: ComplexArray, across: ComplexArray, upside: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return the loads that go with cos(bank), with sin(bank) and with neither, from the banks of `QUARTERS`."""
    still = 0.5 * (upright + upside)
    return 0.5 * (upright - upside), across - still, still


def working(problem: Problem, name: str) -> Problem:
    """The problem with the gas of one cylinder alone."""
    return replace(problem, points=tuple(_working(point, name) for point in problem.points))


def motored(problem: Problem) -> Problem:
    """The problem without gas."""
    return replace(problem, fidelity=replace(problem.fidelity, gas=False, gas_orders=None))


def gas_distinguishes_cylinders(problem: Problem) -> bool:
    """Return True if gas that is felt drives some cylinders differently from others."""
    if not problem.depends_on_gas:
        return False
    gases = [gas for gas in map(problem.fidelity.gas_of, problem.points) if gas is not None]
    return len({tuple(_driven(gas, part) for gas in gases) for part in problem.engine.cylinders}) > 1


def _driven(gas: GasModel, part: SliderCrank) -> Hashable:
    # roundings of the lead of the facing piston are left out
    other = part.facing
    plain = replace(part, facing=replace(other, ahead=round(other.ahead, SAME))) if isinstance(other, Facing) else part
    return alike_under(gas, plain)


def _working(point: OperatingPoint, name: str) -> OperatingPoint:
    gas = point.gas
    if not isinstance(gas, Chambers):
        # idle cylinders have no bore
        return point
    own = tuple(replace(one, cylinders=(name,)) for one in gas.chambers if name in one.cylinders)
    return replace(point, gas=replace(gas, chambers=own) if own else None)
