"""What of an objective is nothing: a rounding of loads that cancel (P6)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, Mount
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

ROUNDING = 1e-9
"""Share of what cancels that a sum of loads is taken for zero below."""
OF_ORDERS = 1e-12
"""Share of all orders of a part that one of them is taken for zero below: they are told from one signal."""
SAMPLES = 96
"""Steps over the cycle at which a size is taken."""


def nothing_of(problem: Problem, engine: Engine | None = None) -> float:
    """Objective that counts as zero [SI]: a rounding of the parts of an engine, each alone, added up.

    A balanced engine has an objective of its own size no more; its parts still have theirs. A part that has nothing of
    an order has its other orders, which cancel there over the cycle.

    Parameters
    ----------
    problem
        What is minimised.
    engine
        On the mounts that are meant; that of the problem as given when left out.
    """
    engine = problem.engine if engine is None else engine
    return _nothing(Problem("", "", engine, problem.points, objective=problem.objective, fidelity=problem.fidelity))


@lru_cache(maxsize=32)
def _nothing(problem: Problem) -> float:
    """Return the objective of the problem's own engine that counts as zero; many ask for that of one design."""
    # on mounts that damp all modes: a resonance would make a size of its own
    mounts = tuple(mount.each(_lossy) for mount in problem.engine.mounts)
    engine = replace(problem.engine, mounts=mounts)
    # the crank turns evenly: what one part alone does to its speed is not asked
    even = replace(problem, engine=engine, fidelity=replace(problem.fidelity, crank_inertia=math.inf))
    whole = replace(
        even, objective=tuple(replace(term, measure=_of_all_orders(term.measure)) for term in even.objective)
    )
    total = sum(_alone(even, part) for part in _parts(engine))
    if whole.objective != even.objective:
        total += OF_ORDERS / ROUNDING * sum(_alone(whole, part) for part in _parts(engine))
    total += sum(term.weight * _own(term.measure, engine) for term in problem.objective)
    return ROUNDING * total


def _of_all_orders(measure: Measure) -> Measure:
    return measure if not measure.is_load else measure.of_all_orders


def _lossy(spring: Mount) -> Mount:
    return replace(spring, loss_factor=max(spring.loss_factor, 1.0))


def _parts(engine: Engine) -> Iterator[Engine]:
    """Engines of one slider-crank or one rotor each."""
    for part in engine.slider_cranks:
        yield replace(engine, slider_cranks=(part,), rotors=())
    for rotor in engine.rotors:
        if rotor.unbalance != 0.0:
            yield replace(engine, slider_cranks=(), rotors=(rotor,))


def _alone(problem: Problem, part: Engine) -> float:
    try:
        found = evaluate(problem, part, min(problem.fidelity.samples, SAMPLES))
        return sum(term.weight * found.value(term.measure) for term in problem.load_terms if not term.measure.is_mass)
    except ModelError:
        # alone it drives what no mount carries
        return 0.0


def _own(measure: Measure, engine: Engine) -> float:
    """Size of what is minimised that is no load: masses beside those that move, and what a channel says of itself."""
    if measure.is_mass:
        return sum(part.reciprocating_mass + part.rotating_mass for part in engine.slider_cranks)
    return measure.channel.size(engine)
