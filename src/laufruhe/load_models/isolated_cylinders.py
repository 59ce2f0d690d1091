"""Engines reduced to one cylinder or to some rotors, so that their loads can be computed alone.

The other cylinders are removed, or keep their places without mass. They must keep their places for loads inside the
crankcase, because one cylinder may load the pins and bearings of another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from laufruhe.machine import Engine, Rotor, SliderCrank
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.problem import Problem

BANK_SAMPLES = (0.0, 0.5 * math.pi, math.pi)
"""Bank angles [rad] whose loads determine the loads at any bank angle: components turn with the bank, or stay."""


def massless_copy(part: SliderCrank) -> SliderCrank:
    """Return a cylinder without mass, and without a piston area on which gas could act."""
    return replace(part.only({}), bore=None if part.bore is None else 0.0)


def isolate_cylinder(engine: Engine, k: int, keep_places: bool, part: SliderCrank | None = None) -> Engine:
    """Return the engine reduced to cylinder k, or to `part` in its place, without rotors and load torque.

    The other cylinders stay as massless copies if `keep_places`.
    """
    active = engine.slider_cranks[k] if part is None else part
    with_idle = [active if j == k else massless_copy(idle) for j, idle in enumerate(engine.slider_cranks)]
    return replace(engine.unloaded, slider_cranks=tuple(with_idle) if keep_places else (active,), rotors=())


def evaluate_cylinders(
    problem: Problem, layout: Layout, banks_are_open: bool, keep_places: bool
) -> Iterator[tuple[Evaluation, ...]]:
    """Yield loads of every cylinder alone, at its dead centre at crank angle zero.

    The loads are those at its own bank angle, or at each of `BANK_SAMPLES` if bank angles are open.
    """
    for k, part in enumerate(problem.engine.slider_cranks):
        delay = layout.firing_delays[k] if layout.firing_delays else 0.0
        banks = BANK_SAMPLES if banks_are_open else (layout.banks[k],)
        copies = (replace(part, bank=bank, throw=bank, firing_angle=delay) for bank in banks)
        alone = only_gas_of(problem, part.name)
        yield tuple(evaluate(alone, isolate_cylinder(problem.engine, k, keep_places, copy)) for copy in copies)


def isolate_rotors(engine: Engine, rotors: Sequence[Rotor], keep_places: bool) -> Engine:
    """Return the engine reduced to some rotors, without load torque.

    Massless copies of the cylinders stay if `keep_places`.
    """
    parts = tuple(map(massless_copy, engine.slider_cranks)) if keep_places else ()
    return replace(engine.unloaded, slider_cranks=parts, rotors=tuple(rotors))


def split_by_bank(upright: ComplexArray, across: ComplexArray, upside: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return the factors of cos(bank), sin(bank) and 1 in the load coefficients of a cylinder.

    The parameters are the coefficients at the three bank angles of `BANK_SAMPLES`.
    """
    constant = 0.5 * (upright + upside)
    return 0.5 * (upright - upside), across - constant, constant


def only_gas_of(problem: Problem, name: str) -> Problem:
    """Return the problem with gas pressure in the named cylinder only."""
    # massless copies have no bore, so that gas with a pressure for each cylinder does not act on them
    points = [replace(point, gas=point.gas and point.gas.only(name)) for point in problem.points]
    return replace(problem, points=tuple(points))


def motored(problem: Problem) -> Problem:
    """Return the problem without gas forces, as if the engine were motored."""
    return replace(problem, fidelity=replace(problem.fidelity, gas=False, gas_orders=None))
