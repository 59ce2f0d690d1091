"""Lower bound of the objective over all crank stars that fire evenly, by the orders of their firing (S40).

Equal cylinders that fire evenly cause the same load, each later by whole firing intervals. The average of the loads
over shifts by this interval is the same for every such star. Only multiples of the firing order remain in it, so that
all rotors of other orders drop out. A norm is convex, and no shift changes it. The norm of the average is therefore at
most that of the loads.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import add

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import as_order
from laufruhe.problem.evaluation import Evaluation, with_common_base
from laufruhe.problem.measure import load_rows
from laufruhe.problem.problem import Problem


def firing_bound(problem: Problem, design: Evaluation) -> float:
    """Return a lower bound of the objective over all crank stars with even firing [SI]; zero if none is known.

    The mean of a design's loads over shifts by firing intervals is the same for all these stars, and no star's norm
    is below that of the mean.

    `design` is the evaluation of one of these stars, with any counterweights; all have its bank angle and split pin.
    """
    engine = design.engine
    if (
        any(term.measure.is_load and term.measure.is_inside for term in problem.objective)
        or problem.fidelity.has_uneven_speed
    ):
        return 0.0
    # shafts that are not built in this design may be built in others
    if not _is_alike(engine) or not _is_alike(problem.engine) or problem.gas_distinguishes_cylinders:
        return 0.0
    total = 0.0
    for term in problem.objective:
        measure = term.measure
        if not measure.is_load:
            if not measure.is_mass:
                return 0.0
            continue
        signals = with_common_base(engine.cycle.base_order, design.signals(measure.load))
        if any(signal.base != engine.cycle.base_order for signal in signals):
            return 0.0
        count = len(engine.cylinders)
        # the mean over shifts by whole firing intervals
        shifted = ([x.shift(Fraction(k, count), k * x.period / count) for k in range(count)] for x in signals)
        shared = [reduce(add, shifts).mapped(lambda values: values / len(engine.cylinders)) for shifts in shifted]
        if measure.norm.averages:
            shared = [signal.averaged(signal.period / design.samples) for signal in shared]
        total += term.weight * load_rows(measure, problem.points, shared, engine, design.samples).value
    return total


def _is_alike(engine: Engine) -> bool:
    # cylinders differ in place, bank and firing alone, and no rotor turns with the firing's orders
    parts = {
        replace(part, name="", x=0.0, throw=part.fires_at, bank=0.0, firing_angle=0.0) for part in engine.slider_cranks
    }
    firing = Fraction(len(engine.cylinders), engine.cycle.turns)
    turning = [as_order(abs(rotor.shaft.ratio)) for rotor in engine.rotors]
    has_rotating = any(part.rotating_mass for part in engine.slider_cranks)
    rotors = all((order / firing).denominator != 1 for order in [*turning, *([Fraction(1)] if has_rotating else [])])
    return len(parts) == 1 and len(engine.cylinders) == len(engine.slider_cranks) and rotors
