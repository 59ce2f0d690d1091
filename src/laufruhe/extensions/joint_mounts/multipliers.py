"""Optimal unbalances for fixed mounts, and the multipliers that prove them optimal (P1, P6, E69)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from laufruhe.extensions.joint_mounts.mounted_loads import coarser
from laufruhe.load_models.affine import AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Multipliers, best_bound, interpolate_duals, lower_bound
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.equations import refine_multipliers

ROWS, MIN_SAMPLES = (1000, 3000), 24
"""Most rows of coarse programs in the order of trials, and fewest samples."""
GAP = 1e-5
"""Relative gap at which multipliers are accepted."""


def best_at(problem: AffineProblem) -> tuple[Array, Multipliers]:
    """Return optimal unbalances, shape (columns,), and multipliers; if limits contradict, those that prove it."""
    zero = (tuple(np.zeros_like(norm.constant) for _, norm in parts) for parts in (problem.terms, problem.limits))
    x, best = problem.start, lower_bound(problem, Multipliers(*zero))
    for factor in _coarsenings(problem):
        coarse = coarser(problem, factor)
        solution = solve_cones(coarse)
        if solution.x is None:
            proof = refine_multipliers(coarse, problem, replace(solution.multipliers, terms=()))
            return x, replace(best.multipliers, limits=interpolate_duals(problem, proof).limits)
        x, best = solution.x, best_bound(problem, solution.x, refine_multipliers(coarse, problem, solution.multipliers))
        if problem.objective(x) - best.value <= GAP * best.value:
            break
    return x, best.multipliers


def _coarsenings(problem: AffineProblem) -> list[int]:
    # factors of coarser sampling in the order of trials
    rows = sum(len(norm.grid.weights) for _, norm in (*problem.terms, *problem.limits))
    divisors = [k for k in range(1, problem.samples // MIN_SAMPLES + 1) if problem.samples % k == 0] or [1]
    factors = {min((k for k in divisors if rows <= maximum * k), default=divisors[-1]) for maximum in ROWS}
    return sorted(factors, reverse=True)
