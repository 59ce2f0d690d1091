"""What every even star has in common, whatever its order and its weights: the orders of its firing (S40).

Alike cylinders that fire evenly load by the same function, each later by whole firing intervals. Averaged over shifts
by that interval the loads of every such star are one and the same: orders that are no multiples of the firing's fall
out, and with them all rotors of other orders. A norm that feels no shift is convex, so that of the average is no more.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import add

from laufruhe.load_models.lone_parts import gas_tells_apart
from laufruhe.machine import Engine, SliderCrank
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.problem.evaluation import Evaluation, over
from laufruhe.problem.measure import load_rows
from laufruhe.problem.problem import Problem


def firing_bound(problem: Problem, design: Evaluation) -> float:
    """What no even star of this geometry goes under; zero where that is not known.

    Parameters
    ----------
    design
        One of them, with any weights.
    """
    engine = design.engine
    if any(term.measure.is_load and term.measure.is_inside for term in problem.objective) or problem.fidelity.is_uneven:
        return 0.0
    # shafts that are not built here may be elsewhere
    if not _is_alike(engine) or not _is_alike(problem.engine) or gas_tells_apart(problem):
        return 0.0
    total = 0.0
    for term in problem.objective:
        measure = term.measure
        if not measure.is_load:
            if not measure.is_mass:
                return 0.0
            continue
        signals = over(engine.cycle.base_order, design.signals(measure.load))
        if any(signal.base != engine.cycle.base_order for signal in signals):
            return 0.0
        shared = [_averaged(signal, len(engine.cylinders)) for signal in signals]
        if measure.norm.averages:
            shared = [signal.averaged(signal.period / design.samples) for signal in shared]
        total += term.weight * load_rows(measure, problem.points, shared, engine, design.samples).value
    return total


def _averaged(signal: Spectrum, count: int) -> Spectrum:
    """Over shifts by whole firing intervals, so many in a period."""
    shifted = [signal.later(Fraction(k, count), k * signal.period / count) for k in range(count)]
    return reduce(add, shifted).each(lambda values: values / count)


def _is_alike(engine: Engine) -> bool:
    """Whether nothing but place, bank and firing tells cylinders apart, and no rotor turns with the firing's orders."""
    parts = {_plain(part) for part in engine.slider_cranks}
    firing = Fraction(len(engine.cylinders), engine.cycle.turns)
    turning = [as_order(abs(rotor.shaft.ratio)) for rotor in engine.rotors]
    own = any(part.rotating_mass for part in engine.slider_cranks)
    rotors = all((order / firing).denominator != 1 for order in [*turning, *([Fraction(1)] if own else [])])
    return len(parts) == 1 and len(engine.cylinders) == len(engine.slider_cranks) and rotors


def _plain(part: SliderCrank) -> SliderCrank:
    return replace(part, name="", x=0.0, throw=part.fires_at, bank=0.0, firing_angle=0.0)
