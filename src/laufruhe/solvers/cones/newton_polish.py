"""Newton steps from the optimum at few samples per cycle to the optimum at many (P10).

A cone program has as many samples as its time allows, and its dual rows between the samples are guesses. If the
objective is smooth, a few Newton steps from its solution reach the optimum at many more samples. There, the subgradient
of the design gives the dual rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import ROUNDING, Bound, Multipliers, flatten_interior, gap_of, lower_bound
from laufruhe.solvers.cones.conic import solve_quadratic

TARGET_GAP = 1e-6
"""Gap below which an optimum is not refined."""
REFINEMENT = 16
"""Factor of samples over the cone program."""
MAX_STEPS = 5
"""Largest number of Newton steps."""
DAMPING = (1e-10, 1e-7, 1e-4)
"""Shares of the trace of the curvature on its diagonal; x stays in directions that do not change the objective."""
CONVERGED = 1e-5
"""Step relative to a decision's scale whose square is negligible."""
NO_STEP = 1e-9
"""Step relative to a decision's scale that counts as zero if the decision is zero."""
FEW_ROWS = 64
"""Largest number of rows of a limit for which Newton steps are tried."""
MAX_NUMBERS = 8_000_000
"""Largest size of the slopes of all terms for which Newton steps are tried."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A design with its lower bound and its violation of limits.

    Attributes
    ----------
    x
        Decision vector, shape (n,).
    bound
        Lower bound of all designs, with its multipliers.
    problem
        Affine problem, sampled on the grid of the bound.
    gap
        Gap between objective and bound, relative to the objective.
    violation
        Largest relative excess over a limit, between the samples too.
    samples
        Samples per period of the cone program.
    zero_level
        Objective that counts as zero [SI].
    refinement
        Method after the cones, in words for the certificate.
    """

    x: Array
    bound: Bound
    problem: AffineProblem
    gap: float
    violation: float
    samples: int
    zero_level: float
    refinement: str = ""


def polish(model: AffineModel, coarse: Optimum) -> Optimum:
    """Return a more accurate optimum at `REFINEMENT` times as many samples; the coarse one if Newton steps fail."""
    if coarse.gap <= TARGET_GAP or not _is_smooth(coarse.problem):
        return coarse
    samples = REFINEMENT * coarse.samples
    fine = model.at(samples)
    steps = _newton_steps(fine, coarse.x)
    if steps is None:
        return coarse
    x, limits = steps
    rows = [norm.subgradient(x) for _, norm in fine.terms]
    averaged = model.at(samples, averaged=True)
    bound = lower_bound(averaged, Multipliers(tuple(rows), limits))
    value = fine.objective(x)
    if gap_of(value, bound.value, coarse.zero_level) > TARGET_GAP:
        bound = max(bound, lower_bound(averaged, flatten_interior(averaged, x, bound)), key=lambda proven: proven.value)
    gap, violation = gap_of(value, bound.value, coarse.zero_level), fine.violation(x)
    if gap >= coarse.gap or violation > max(coarse.violation, FEASIBLE):
        return coarse
    refinement = " and Newton's method"
    return replace(coarse, x=x, bound=bound, problem=fine, gap=gap, violation=violation, refinement=refinement)


def _is_smooth(problem: AffineProblem) -> bool:
    if problem.groups or not problem.terms:
        return False
    if REFINEMENT // 2 * sum(norm.slope.size for _, norm in problem.terms) > MAX_NUMBERS:
        return False
    has_curvature = all(norm.norm.second_derivative(norm.grid, norm.constant) is not None for _, norm in problem.terms)
    return has_curvature and all(len(norm.grid.weights) <= FEW_ROWS for _, norm in problem.limits)


def _newton_steps(problem: AffineProblem, x: Array) -> tuple[Array, tuple[Array, ...]] | None:
    """Return the end of Newton steps from x, and the dual rows of limits there; None if the first step is no better."""
    end, is_zero = None, x == 0.0
    for _ in range(MAX_STEPS):
        gradient, curvature = derivatives(problem, x)
        maximum = problem.objective(x) * (1.0 + ROUNDING)
        steps = (solve_quadratic(problem, gradient, curvature, x, damping) for damping in DAMPING)
        step = next((step for step in steps if step is not None and problem.objective(step[0]) <= maximum), None)
        if step is None:
            break
        y = np.where(is_zero & (np.abs(step[0]) <= NO_STEP * problem.scales), 0.0, step[0])
        change = float((np.abs(y - x) / problem.scales).max(initial=0.0))
        x, end = y, (y, step[1])
        if change <= CONVERGED:
            break
    return end


def derivatives(problem: AffineProblem, x: Array) -> tuple[Array, Array]:
    """Return gradient and curvature of the objective at x, shapes (n,) and (n, n) (P10)."""
    gradient, curvature = np.zeros(problem.size), np.zeros((problem.size, problem.size))
    for weight, norm in problem.terms:
        duals, curvatures = norm.subgradient(x), norm.norm.second_derivative(norm.grid, norm.rows(x))
        assert curvatures is not None
        gradient += weight * np.einsum("kd,kdn->n", duals, norm.slope)
        directions = duals / norm.grid.weights[:, None]
        factors = np.sqrt(weight * curvatures)
        rows = (norm.slope * factors[:, None, None]).reshape(-1, problem.size)
        radial = np.einsum("kd,kdn->kn", directions, norm.slope) * factors[:, None]
        curvature += rows.T @ rows - radial.T @ radial
    return gradient, curvature
