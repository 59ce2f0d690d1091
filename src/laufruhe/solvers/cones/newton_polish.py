"""Newton steps from the optimum at some angles of the cycle to that of the whole cycle (P10).

A cone program holds as many angles as its time allows, and its dual rows between them are guessed. Where the objective
is smooth, a few steps from its answer find the optimum at many times as many angles. There every row of the design
is its own dual row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import ROUNDING, Bound, Multipliers, gap_of, levelled, lower_bound
from laufruhe.solvers.cones.conic import solve_quadratic

TARGET_GAP = 1e-6
TIMES = 16
"""Times as many angles as the cone program had."""
MOST_STEPS = 5
DAMPING = (1e-10, 1e-7, 1e-4)
"""Share of the curvature in all directions that is added in each; where nothing changes the objective, x stays."""
CONVERGED = 1e-5
"""Step in a decision's scale whose square is negligible."""
NO_STEP = 1e-9
"""Share of a decision's scale that is no step for a decision of zero."""
FEW_ROWS = 64
MOST_NUMBERS = 8_000_000


@dataclass(frozen=True, eq=False)
class Optimum:
    """A design, the bound that meets it, and its violation of limits.

    Attributes
    ----------
    problem
        Rows on the grid that the bound holds on.
    violation
        Largest relative excess over a limit, between the angles too.
    zero_level
        Objective that counts as zero.
    then
        Method that followed the cones, in words.
    """

    x: Array
    bound: Bound
    problem: AffineProblem
    gap: float
    violation: float
    samples: int
    zero_level: float
    then: str = ""


def polish(model: AffineModel, rough: Optimum) -> Optimum:
    """Return the optimum at many times as many angles, or the rough one where that is no better."""
    if rough.gap <= TARGET_GAP or not _is_smooth(rough.problem):
        return rough
    samples = TIMES * rough.samples
    fine = model.at(samples)
    steps = _newton_steps(fine, rough.x)
    if steps is None:
        return rough
    x, limits = steps
    rows = [norm.subgradient(x) for _, norm in fine.terms]
    averaged = model.at(samples, averaged=True)
    bound = lower_bound(averaged, Multipliers(tuple(rows), limits))
    value = fine.objective(x)
    if gap_of(value, bound.value, rough.zero_level) > TARGET_GAP:
        bound = max(bound, lower_bound(averaged, levelled(averaged, x, bound)), key=lambda each: each.value)
    gap, violation = gap_of(value, bound.value, rough.zero_level), fine.violation(x)
    if gap >= rough.gap or violation > max(rough.violation, FEASIBLE):
        return rough
    then = " and Newton's method"
    return replace(rough, x=x, bound=bound, problem=fine, gap=gap, violation=violation, then=then)


def _is_smooth(problem: AffineProblem) -> bool:
    if problem.groups or not problem.terms:
        return False
    if TIMES // 2 * sum(norm.slope.size for _, norm in problem.terms) > MOST_NUMBERS:
        return False
    has_curvature = all(norm.norm.across(norm.grid, norm.constant) is not None for _, norm in problem.terms)
    return has_curvature and all(len(norm.grid.weights) <= FEW_ROWS for _, norm in problem.limits)


def _newton_steps(problem: AffineProblem, x: Array) -> tuple[Array, tuple[Array, ...]] | None:
    """Return where steps from x end, and the dual rows of the limits there; None where the first step is no better."""
    end, zero = None, x == 0.0
    for _ in range(MOST_STEPS):
        gradient, curvature = derivatives(problem, x)
        maximum = problem.objective(x) * (1.0 + ROUNDING)
        steps = (solve_quadratic(problem, gradient, curvature, x, damping) for damping in DAMPING)
        step = next((step for step in steps if step is not None and problem.objective(step[0]) <= maximum), None)
        if step is None:
            break
        y = np.where(zero & (np.abs(step[0]) <= NO_STEP * problem.scales), 0.0, step[0])
        moved = float((np.abs(y - x) / problem.scales).max(initial=0.0))
        x, end = y, (y, step[1])
        if moved <= CONVERGED:
            break
    return end


def derivatives(problem: AffineProblem, x: Array) -> tuple[Array, Array]:
    """Return gradient and curvature of the objective at x, shapes (n,) and (n, n) (P10)."""
    gradient, curvature = np.zeros(problem.size), np.zeros((problem.size, problem.size))
    for weight, norm in problem.terms:
        along, across = norm.subgradient(x), norm.norm.across(norm.grid, norm.rows(x))
        assert across is not None
        gradient += weight * np.einsum("kd,kdn->n", along, norm.slope)
        unit = along / norm.grid.weights[:, None]
        root = np.sqrt(weight * across)
        rows = (norm.slope * root[:, None, None]).reshape(-1, problem.size)
        radial = np.einsum("kd,kdn->kn", unit, norm.slope) * root[:, None]
        curvature += rows.T @ rows - radial.T @ radial
    return gradient, curvature
