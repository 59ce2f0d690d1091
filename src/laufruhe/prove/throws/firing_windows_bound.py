"""Lower bounds of slightly uneven stars (S22, S24).

As in S4 a direction v bounds the couples by sum_k x_k a_k, but a throw on step p may now stand anywhere in a window
around it: as far as the intervals before and after it let its firing move. The minimum of x_k a_p over the window is
a number for each throw and step. A sum of them bounds every star, and the smallest sum bounds all stars.

Gas has a mean torque that no throw changes, and a norm is never less than that of the mean over the cycle (S24).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from laufruhe.load_models.amplitudes import AmplitudeObjective, dual_directions
from laufruhe.machine.firing import firing_lattice
from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.phasing import Intervals
from laufruhe.problem.problem import Phasing, Problem

POINTS = 97
MAX_STARS = 50_000
BATCH = 32
"""Number of directions that bound all remaining stars at a time."""


def uneven_bound(
    phasing: Phasing, space: StarSpace, objective: AmplitudeObjective, intervals: Intervals
) -> float:  # fmt: skip
    """Return a lower bound over all stars of in-line cylinders with these firing intervals [SI].

    It is zero, which is always valid, if there are more than `MAX_STARS` stars.

    Parameters
    ----------
    space, objective
        The even stars, and norms of couples.
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
    """Return the objective that the mean of the loads over the cycle leaves, on mounts as given (S24) [SI]."""
    initial, total = evaluate(problem), 0.0
    for term in problem.objective:
        measure = term.measure
        if measure.is_mass or not measure.counted([0.0])[0]:
            continue
        total += term.weight * initial.value(replace(measure, orders=(0.0,)))
    return total


def minimum_bound(costs: Array, stars: Stars, incumbent: float) -> float:
    """Return the minimum of `star_bounds` over stars, shape (stars, throws), and of the minimum over earlier stars.

    Directions are evaluated in batches. A star whose bound exceeds the minimum needs no further directions.
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
    """Return the best bound of every star over all directions, shape (n,)."""
    total = np.zeros((len(stars), len(costs)))
    for k in range(stars.shape[1]):
        total += costs[:, k, stars[:, k]].T
    return np.asarray(total.max(axis=1))


def throw_costs(phasing: Phasing, space: StarSpace, objective: AmplitudeObjective, intervals: Intervals) -> Array:
    """Return the minimum of x_k a over the angle window of each step, shape (directions, throws, steps).

    x_k is the position of throw k [m], and a the component of its rotating load along a dual direction.
    """
    lower, upper = windows(phasing, intervals)
    v = dual_directions(objective)
    orders = np.array(objective.orders, dtype=float)
    minima = np.empty((len(v), space.throws, space.phases))
    places = np.array(space.places)
    for p in range(space.phases):
        angles = math.tau * p / space.phases + np.linspace(lower[p], upper[p], POINTS)
        values = (v.conj() @ np.exp(1j * np.outer(orders, angles))).real
        # between two points a function bends away from its chord by at most a'' step^2 / 8
        step = (upper[p] - lower[p]) / (POINTS - 1)
        bend = (np.abs(v) @ orders**2) * step**2 / 8.0
        low, high = values.min(axis=1) - bend, values.max(axis=1) + bend
        minima[:, :, p] = np.where(places > 0.0, places * low[:, None], places * high[:, None])
    return minima


def windows(phasing: Phasing, intervals: Intervals) -> tuple[Array, Array]:
    """Return how far a throw of every step may stand from it, low and high [rad], cylinder 1 at its dead centre.

    The s-th firing follows the first by s minimum to s maximum intervals, and precedes the next cycle by the others.
    A throw fires later the less far ahead it stands.
    """
    count, cycle, even = phasing.cylinders, phasing.cycle.angle, phasing.even_interval
    lattice = firing_lattice(phasing.cycle, count)
    lower, upper = np.full(lattice.steps, math.inf), np.full(lattice.steps, -math.inf)
    for s, step in enumerate(lattice.slots):
        early = max(s * intervals.minimum, cycle - (count - s) * intervals.maximum) - s * even
        late = min(s * intervals.maximum, cycle - (count - s) * intervals.minimum) - s * even
        p = -step % lattice.steps
        lower[p], upper[p] = min(lower[p], -late), max(upper[p], -early)
    # the first throw stays
    if phasing.cycle.turns == 1 or count % 2:
        lower[0] = upper[0] = 0.0
    return lower, upper
