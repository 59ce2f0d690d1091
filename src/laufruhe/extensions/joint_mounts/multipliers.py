"""Optimal unbalances for fixed mounts, and the multipliers that prove them optimal (P1, P6, E69)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.joint_mounts.mounted_loads import coarser
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, interpolate_duals, lower_bound
from laufruhe.solvers.cones.cone_program import restrict_rows, rows_near
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.equations import refine_multipliers

ROWS, MIN_SAMPLES = (1000, 3000), 24
"""Most rows of coarse programs in the order of trials, and fewest samples."""
GAP = 1e-5
"""Relative gap at which multipliers are accepted."""
ROOM, STEEPEST = 0.02, 20.0
"""Relative slack of widened limits; largest price of contradicting limits, as a multiple of the objective."""
NEAR, ROUNDS = 0.98, 3
"""Share of a peak above which rows are included, and rounds of this selection."""


def best_at(problem: AffineProblem) -> tuple[Array, Multipliers]:
    """Return optimal unbalances, shape (columns,), and multipliers; contradicting limits are relaxed."""
    x, best = _solve(problem)
    if x is not None:
        return x, best.multipliers
    contradicting = best.multipliers.limits
    if all(maximum > 0.0 for maximum, _ in problem.limits):
        x, best = _solve(replace(problem, limits=_wider(problem)))
    if x is None:
        return problem.start, best.multipliers
    return x, _with_contradiction(problem, best.multipliers, contradicting, problem.objective(x))


def _wider(problem: AffineProblem) -> tuple[tuple[float, AffineNorm], ...]:
    # limits that some unbalances keep with slack, so that prices stay small
    shares = tuple((1.0 / maximum, norm) for maximum, norm in problem.limits)
    coarse = coarser(replace(problem, terms=shares, limits=(), groups=tuple(range(len(shares)))), _times(problem)[0])
    x = solve_cones(coarse).x
    scale = ROOM + max(weight * norm.value(problem.start if x is None else x) for weight, norm in shares)
    return tuple((scale * maximum, norm) for maximum, norm in problem.limits)


def _solve(problem: AffineProblem) -> tuple[Array | None, Bound]:
    """Return optimal unbalances and a lower bound with its multipliers; None if the limits contradict each other."""
    zero = (tuple(np.zeros_like(norm.constant) for _, norm in parts) for parts in (problem.terms, problem.limits))
    x, best = None, lower_bound(problem, Multipliers(*zero))
    for factor in _times(problem):
        coarse = coarser(problem, factor)
        solution = solve_cones(coarse)
        if solution.x is None:
            limits = interpolate_duals(
                problem, refine_multipliers(coarse, problem, replace(solution.multipliers, terms=()))
            ).limits
            return None, replace(best, multipliers=replace(best.multipliers, limits=limits))
        x, best = solution.x, best_bound(problem, solution.x, refine_multipliers(coarse, problem, solution.multipliers))
        limit_rows = sum(len(norm.grid.weights) for _, norm in problem.limits)
        if factor > 1 and limit_rows <= ROWS[-1] and all(norm.norm.is_largest for _, norm in problem.terms):
            x, best = _solve_by_peaks(problem, x, best)
        if problem.objective(x) - best.value <= GAP * best.value:
            break
    return x, best


def _with_contradiction(
    problem: AffineProblem, multipliers: Multipliers, contradicting: Sequence[Array], value: float
) -> Multipliers:  # fmt: skip
    # scaled so that the bound of mounts with contradicting limits exceeds `value`
    proof = lower_bound(replace(problem, terms=()), Multipliers((), tuple(contradicting)))
    prices = proof.multipliers.shadow_prices(problem)
    size = sum(price * maximum for price, (maximum, _) in zip(prices, problem.limits, strict=True))
    if not proof.value > 0.0:
        return multipliers
    factor = min(value / proof.value, STEEPEST * value / size)
    rows = zip(multipliers.limits, proof.multipliers.limits, strict=True)
    return replace(multipliers, limits=tuple(z + factor * price_row for z, price_row in rows))


def _times(problem: AffineProblem) -> list[int]:
    # factors of coarser sampling in the order of trials
    rows = sum(len(norm.grid.weights) for _, norm in (*problem.terms, *problem.limits))
    divisors = [k for k in range(1, problem.samples // MIN_SAMPLES + 1) if problem.samples % k == 0] or [1]
    factors = {min((k for k in divisors if rows <= maximum * k), default=divisors[-1]) for maximum in ROWS}
    return sorted(factors, reverse=True)


def _solve_by_peaks(problem: AffineProblem, x: Array, best: Bound) -> tuple[Array, Bound]:
    """Return better unbalances and their bound for all samples, by programs of the samples near peaks (P10)."""
    selected = [np.zeros(0, dtype=np.intp) for _ in problem.terms]
    for _ in range(ROUNDS):
        selected = [
            np.union1d(rows, rows_near(norm.value(x), norm, x, NEAR))
            for rows, (_, norm) in zip(selected, problem.terms, strict=True)
        ]
        terms = [
            (weight, restrict_rows(norm, rows)) for rows, (weight, norm) in zip(selected, problem.terms, strict=True)
        ]
        solution = solve_cones(replace(problem, terms=tuple(terms)))
        if solution.x is None:
            break
        duals = [np.zeros_like(norm.constant) for _, norm in problem.terms]
        for z, rows, dual in zip(duals, selected, solution.multipliers.terms, strict=True):
            z[rows] = dual
        bound = lower_bound(problem, replace(solution.multipliers, terms=tuple(duals)))
        best = max(best, bound, key=lambda candidate: candidate.value)
        x = min(x, solution.x, key=problem.objective)
        if problem.objective(x) - best.value <= GAP * best.value:
            break
        x = solution.x
    return x, best
