"""Lower bounds of the objective over crank stars that fire slightly unevenly (S22, S24).

As in S4, a direction v bounds the couples from below by sum_k x_k a_k. x_k is the position of throw k, and a_k the
component of its rotating load along v. Here a throw on step p may stand anywhere in a window around the step, as far as
the firing intervals before and after it allow. The minimum of x_k a_k over the window is a number for each throw and
step. The sum of these numbers bounds a star, and the smallest sum bounds all stars.

Gas has a mean torque that no throw changes. A norm is at least the norm of the mean load over the cycle (S24).
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import add

import numpy as np

from laufruhe.load_models.amplitudes import AmplitudeObjective, dual_directions
from laufruhe.machine import Engine
from laufruhe.machine.firing import firing_lattice
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import as_order
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.evaluation import Evaluation, evaluate, with_common_base
from laufruhe.problem.measure import load_rows
from laufruhe.problem.phasing import Intervals
from laufruhe.problem.problem import Phasing, Problem


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


POINTS = 97
MAX_STARS = 50_000
BATCH = 32
"""Number of directions that bound all remaining stars at a time."""


def uneven_bound(
    phasing: Phasing, space: StarSpace, objective: AmplitudeObjective, intervals: Intervals
) -> float:  # fmt: skip
    """Return a lower bound of the objective over all in-line crank stars with bounded firing intervals [SI].

    It is zero, which is always valid, if there are more than `MAX_STARS` stars.

    Parameters
    ----------
    space, objective
        Crank stars that fire evenly, and objective as norms of couples.
    intervals
        Bounds of every firing interval [rad].
    """
    if phasing.bank is not None or space.size > MAX_STARS:
        return 0.0
    costs = throw_costs(phasing, space, objective, intervals)
    images = StarSpace(space.phases, space.patterns, space.places, mirror=True, reflect=True)
    minimum = math.inf
    for block in images.blocks():
        minimum = minimum_bound(costs, block, minimum)
    return max(minimum, 0.0)


def steady_bound(problem: Problem) -> float:
    """Return a lower bound of the objective for any throw angles [SI], from the mean loads on fixed mounts (S24)."""
    initial, total = evaluate(problem), 0.0
    for term in problem.objective:
        measure = term.measure
        if measure.is_mass or not measure.counted([0.0])[0]:
            continue
        total += term.weight * initial.value(replace(measure, orders=(0.0,)))
    return total


def minimum_bound(costs: Array, stars: Stars, incumbent: float) -> float:
    """Return the lowest bound of many crank stars, shape (stars, throws), or `incumbent` if that is less [SI].

    `costs` are those of `throw_costs`, and `incumbent` is the minimum over earlier stars. Directions are evaluated in
    batches. A star whose bound exceeds the minimum needs no further directions.
    """
    bounds = np.full(len(stars), -math.inf)
    for first in range(0, len(costs), BATCH):
        if not len(stars):
            return incumbent
        bounds = np.maximum(bounds, star_bounds(costs[first : first + BATCH], stars))
        incumbent = min(incumbent, float(star_bounds(costs, stars[[np.argmin(bounds)]])[0]))
        is_open = bounds < incumbent
        stars, bounds = stars[is_open], bounds[is_open]
    return min(incumbent, float(bounds.min(initial=math.inf)))


def star_bounds(costs: Array, stars: Stars) -> Array:
    """Return a lower bound of the objective of every crank star, shape (n,): the largest over all dual directions.

    `costs` are the minima from `throw_costs`.
    """
    total = np.zeros((len(stars), len(costs)))
    for k in range(stars.shape[1]):
        total += costs[:, k, stars[:, k]].T
    return np.asarray(total.max(axis=1))


def throw_costs(phasing: Phasing, space: StarSpace, objective: AmplitudeObjective, intervals: Intervals) -> Array:
    """Return the smallest contribution of each throw to a couple bound, on each step: (directions, throws, steps).

    It is the minimum of x_k a_k over the angles that the firing intervals allow near the step.

        x_k is the position of throw k [m], and a_k the component of its rotating load along a dual direction.
    """
    lower, upper = windows(phasing, intervals)
    v = dual_directions(objective)
    orders = np.array(objective.orders, dtype=float)
    minima = np.empty((len(v), space.throws, space.phases))
    places = np.array(space.places)
    for p in range(space.phases):
        angles = math.tau * p / space.phases + np.linspace(lower[p], upper[p], POINTS)
        values = (v.conj() @ np.exp(1j * np.outer(orders, angles))).real
        # between two points the component a bends away from its chord by at most a'' step^2 / 8
        step = (upper[p] - lower[p]) / (POINTS - 1)
        bend = (np.abs(v) @ orders**2) * step**2 / 8.0
        low, high = values.min(axis=1) - bend, values.max(axis=1) + bend
        minima[:, :, p] = np.where(places > 0.0, places * low[:, None], places * high[:, None])
    return minima


def windows(phasing: Phasing, intervals: Intervals) -> tuple[Array, Array]:
    """Return how far a throw may stand before and after each evenly spaced step [rad], shape (steps,) each.

    Cylinder 1 stays at its dead centre. The s-th firing follows the first by s minimum to s maximum intervals, and the
    other intervals remain until the next cycle. A throw that stands less far ahead fires later.
    """
    count, cycle, even = phasing.cylinders, phasing.cycle.angle, phasing.even_interval
    lattice = firing_lattice(phasing.cycle, count)
    lower, upper = np.full(lattice.steps, math.inf), np.full(lattice.steps, -math.inf)
    for s, step in enumerate(lattice.slots):
        earliest = max(s * intervals.minimum, cycle - (count - s) * intervals.maximum) - s * even
        latest = min(s * intervals.maximum, cycle - (count - s) * intervals.minimum) - s * even
        p = -step % lattice.steps
        lower[p], upper[p] = min(lower[p], -latest), max(upper[p], -earliest)
    # the first throw stays
    if phasing.cycle.turns == 1 or count % 2:
        lower[0] = upper[0] = 0.0
    return lower, upper
