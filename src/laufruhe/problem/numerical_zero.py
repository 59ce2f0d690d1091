"""Numerical zero of an objective: the rounding error of loads that cancel (P6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.physics.mount_numbers import torque_roll_answer
from laufruhe.problem.channels import DECOUPLING_SHORTFALL, RAW_TORQUE_ROLL, TORQUE_ROLL, Channel, mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

ROUNDING = 1e-9
"""Fraction of cancelling loads below which their sum counts as zero."""
OF_ORDERS = 1e-12
"""Fraction of the load of one cylinder or rotor over all orders, below which a single order counts as zero."""
SAMPLES = 96
"""Number of samples over the cycle for these estimates."""


_SIZES: Mapping[Channel, Callable[[Engine], float]] = {
    DECOUPLING_SHORTFALL: lambda _: 1.0,
    TORQUE_ROLL: lambda _: 1.0,
    RAW_TORQUE_ROLL: lambda engine: torque_roll_answer(mounting_in(engine)),
}
"""Size of the terms that cancel in residuals [SI], by channel; other numbers have no numerical zero."""


def numerical_zero(problem: Problem, engine: Engine | None = None) -> float:
    """Return the value of the objective that counts as zero [SI]: the rounding error of the sum of loads.

    The objective of a balanced engine gives no scale, so those of single cylinders and rotors are summed. If only some
    orders count, a small fraction of all orders is added, because each order is a sum over the cycle of the complete
    signal.
    The engine is by default that of the problem as given.
    """
    engine = problem.engine if engine is None else engine
    return _cached_zero(Problem("", "", engine, problem.points, objective=problem.objective, fidelity=problem.fidelity))


@lru_cache(maxsize=32)
def _cached_zero(problem: Problem) -> float:
    # with damped mounts, because a resonance would magnify the scale
    springs = [
        mount.mapped(lambda spring: replace(spring, loss_factor=max(spring.loss_factor, 1.0)))
        for mount in problem.engine.mounts
    ]
    engine = replace(problem.engine, mounts=tuple(springs))
    # at even speed, because the effect of one part on the speed does not count
    even = replace(problem, engine=engine, fidelity=replace(problem.fidelity, crank_inertia=math.inf))
    total = _sum_of_parts(even)
    all_orders = tuple(
        replace(term, measure=term.measure.with_all_orders if term.measure.is_load else term.measure)
        for term in even.objective
    )
    if all_orders != even.objective:
        total += OF_ORDERS / ROUNDING * _sum_of_parts(replace(even, objective=all_orders))
    for term in problem.objective:
        if term.measure.is_mass:
            moving = sum(part.reciprocating_mass + part.rotating_mass for part in engine.slider_cranks)
            total += term.weight * moving
        elif term.measure.channel in _SIZES:
            total += term.weight * _SIZES[term.measure.channel](engine)
    return ROUNDING * total


def _sum_of_parts(problem: Problem) -> float:
    # objectives of every slider-crank and every rotor alone [SI]
    engine, total = problem.engine, 0.0
    parts = [replace(engine, slider_cranks=(part,), rotors=()) for part in engine.slider_cranks]
    parts += [replace(engine, slider_cranks=(), rotors=(r,)) for r in engine.rotors if r.unbalance != 0.0]
    for part in parts:
        # a single part may excite a direction that no mount carries
        with suppress(ModelError):
            single = evaluate(problem, part, min(problem.fidelity.samples, SAMPLES))
            terms = (term for term in problem.load_terms if not term.measure.is_mass)
            total += sum(term.weight * single.value(term.measure) for term in terms)
    return total
