"""Lower bound of all even stars: the orders of their firing, which every star has (S40).

Alike cylinders that fire evenly load by the same function, each later by whole firing intervals. Averaged over shifts
by that interval the loads of every such star are the same: orders that are no multiples of the firing's drop out, and
with them all rotors of other orders. A norm that no shift changes is convex, so that of the average is no larger.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import add

from laufruhe.load_models.isolated_cylinders import gas_distinguishes_cylinders
from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import as_order
from laufruhe.problem.evaluation import Evaluation, with_common_base
from laufruhe.problem.measure import load_rows
from laufruhe.problem.problem import Problem


def firing_bound(problem: Problem, design: Evaluation) -> float:
    """Return a lower bound of the objective over all even stars of this geometry, or zero where none is known [SI].

    The design is one of the stars, with any weights.
    """
    engine = design.engine
    if any(term.measure.is_load and term.measure.is_inside for term in problem.objective) or problem.fidelity.is_uneven:
        return 0.0
    # shafts that are not built here may be elsewhere
    if not _is_alike(engine) or not _is_alike(problem.engine) or gas_distinguishes_cylinders(problem):
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
