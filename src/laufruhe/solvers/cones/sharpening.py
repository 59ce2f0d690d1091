"""An optimum of the whole cycle from that at some of its angles, by Newton's method (P10).

A cone program holds as many angles as its time allows, and its dual rows between them are guessed. Where the objective
is smooth, a few steps from its answer find the optimum at many times as many angles, and there every row of the design
is its own dual row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import ROUNDING, Bound, Multipliers, gap_of, levelled, lower_bound
from laufruhe.solvers.conclusion import FEASIBLE
from laufruhe.solvers.cones.conic import solve_quadratic

SHARP = 1e-6
TIMES = 16
MOST_STEPS = 5
STAY = (1e-10, 1e-7, 1e-4)
"""Of the curvature in all directions, what is added in each: along what nothing tells apart it stays where it is."""
NEXT = 1e-5
"""Of a decision's scale: a step under it is squared by the next one."""
STILL = 1e-9
"""Share of a decision's scale that is no step, and that is left of one that was zero."""
FEW_ROWS = 64
MOST_NUMBERS = 8_000_000


@dataclass(frozen=True, eq=False)
class Optimum:
    """A design, the bound that meets it, and how far it is from being allowed.

    Attributes
    ----------
    problem
        Rows on the grid that the bound holds on.
    excess
        Largest relative excess over a limit, sought between the angles too.
    nothing
        Objective that counts as zero.
    then
        What followed the cones, in words.
    """

    x: Array
    bound: Bound
    problem: AffineProblem
    gap: float
    excess: float
    samples: int
    nothing: float
    then: str = ""


def sharpened(model: AffineModel, rough: Optimum) -> Optimum:
    """The optimum at many times as many angles; the rough one where that is no better."""
    if rough.gap <= SHARP or not _is_smooth(rough.problem):
        return rough
    samples = TIMES * rough.samples
    fine = model.at(samples)
    found = _by_newton(fine, rough.x)
    if found is None:
        return rough
    x, limits = found
    own = [norm.subgradient(x) for _, norm in fine.terms]
    averaged = model.at(samples, averaged=True)
    bound = lower_bound(averaged, Multipliers(tuple(own), limits))
    value = fine.objective(x)
    if gap_of(value, bound.value, rough.nothing) > SHARP:
        bound = max(bound, lower_bound(averaged, levelled(averaged, x, bound)), key=lambda each: each.value)
    gap, excess = gap_of(value, bound.value, rough.nothing), fine.excess(x)
    if gap >= rough.gap or excess > max(rough.excess, FEASIBLE):
        return rough
    then = " and Newton's method"
    return replace(rough, x=x, bound=bound, problem=fine, gap=gap, excess=excess, then=then)


def _is_smooth(problem: AffineProblem) -> bool:
    """Whether every term has second derivatives, and every limit is one of masses alone."""
    if problem.groups or not problem.terms:
        return False
    shapes = [norm.slope.shape for _, norm in problem.terms]
    if TIMES // 2 * sum(int(np.prod(shape)) for shape in shapes) > MOST_NUMBERS:
        return False
    bends = [norm.norm.across(norm.grid, norm.constant) is not None for _, norm in problem.terms]
    return all(bends) and all(len(norm.grid.weights) <= FEW_ROWS for _, norm in problem.limits)


def _by_newton(problem: AffineProblem, x: Array) -> tuple[Array, tuple[Array, ...]] | None:
    """Where steps from x end, and the dual rows of the limits there; None where the first one makes it worse."""
    found, zero = None, x == 0.0
    for _ in range(MOST_STEPS):
        step = _step(problem, x)
        if step is None:
            break
        y = np.where(zero & (np.abs(step[0]) <= STILL * problem.scales), 0.0, step[0])
        moved = float((np.abs(y - x) / problem.scales).max(initial=0.0))
        x, found = y, (y, step[1])
        if moved <= NEXT:
            break
    return found


def _step(problem: AffineProblem, x: Array) -> tuple[Array, tuple[Array, ...]] | None:
    """The longest of several steps that makes nothing worse, and the dual rows of the limits after it."""
    gradient, curvature = _derivatives(problem, x)
    most = problem.objective(x) * (1.0 + ROUNDING)
    for stay in STAY:
        step = solve_quadratic(problem, gradient, curvature, x, stay)
        if step is not None and problem.objective(step[0]) <= most:
            return step
    return None


def _derivatives(problem: AffineProblem, x: Array) -> tuple[Array, Array]:
    """Gradient and curvature of the objective, shapes (n,) and (n, n) (P10)."""
    gradient, curvature = np.zeros(problem.size), np.zeros((problem.size, problem.size))
    for weight, norm in problem.terms:
        along, across = norm.subgradient(x), norm.norm.across(norm.grid, norm.rows(x))
        assert across is not None
        gradient += weight * np.einsum("kd,kdn->n", along, norm.slope)
        unit = along / norm.grid.weights[:, None]
        root = np.sqrt(weight * across)
        whole = (norm.slope * root[:, None, None]).reshape(-1, problem.size)
        own = np.einsum("kd,kdn->kn", unit, norm.slope) * root[:, None]
        curvature += whole.T @ whole - own.T @ own
    return gradient, curvature
