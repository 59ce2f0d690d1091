"""Unbalances that are best on the mounts of a corner, and multipliers that prove it (P1, P6, E69)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.joint_mounts.corner_loads import coarser
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, lower_bound, spread
from laufruhe.solvers.cones.conic import rows_near, rows_of, solve_cones
from laufruhe.solvers.cones.equations import refine_multipliers

ROWS, LEAST_SAMPLES = (1000, 3000), 24
"""Rows of all norms at fewer samples, in the order in which they are tried; and samples that are left at the least."""
ENOUGH = 1e-5
"""Gap with which multipliers of a corner are good enough."""
ROOM, STEEPEST = 0.02, 20.0
"""Share of a limit by which it is wider than any unbalances need it; what all of a limit is worth that none keep."""
NEAR, ROUNDS = 0.98, 3
"""Share of a peak from which rows may become one, and how often such rows are chosen."""


def best_at(problem: AffineProblem) -> tuple[Array, Multipliers]:
    """Best unbalances, and multipliers that prove it; where none keep the limits, those of limits a little wider."""
    x, best = _best(problem)
    if x is not None:
        return x, best.multipliers
    against = best.multipliers.limits
    if all(most > 0.0 for most, _ in problem.limits):
        x, best = _best(replace(problem, limits=_wider(problem)))
    if x is None:
        return problem.start, best.multipliers
    return x, _with(problem, best.multipliers, against, problem.objective(x))


def _wider(problem: AffineProblem) -> tuple[tuple[float, AffineNorm], ...]:
    """Limits that some unbalances keep with room, so that their prices stay small."""
    shares = tuple((1.0 / most, norm) for most, norm in problem.limits)
    coarse = coarser(replace(problem, terms=shares, limits=(), groups=tuple(range(len(shares)))), _times(problem)[0])
    x = solve_cones(coarse).x
    times = ROOM + max(weight * norm.value(problem.start if x is None else x) for weight, norm in shares)
    return tuple((times * most, norm) for most, norm in problem.limits)


def _best(problem: AffineProblem) -> tuple[Array | None, Bound]:
    """Best unbalances, none where the limits are not kept, and their bound."""
    x, best = None, lower_bound(problem, _none(problem))
    for times in _times(problem):
        coarse = coarser(problem, times)
        found = solve_cones(coarse)
        if found.x is None:
            limits = spread(problem, refine_multipliers(coarse, problem, replace(found.multipliers, terms=()))).limits
            return None, replace(best, multipliers=replace(best.multipliers, limits=limits))
        x, best = found.x, best_bound(problem, found.x, refine_multipliers(coarse, problem, found.multipliers))
        if times > 1 and _few_count(problem):
            x, best = _peaks(problem, x, best)
        if problem.objective(x) - best.value <= ENOUGH * best.value:
            break
    return x, best


def _with(problem: AffineProblem, found: Multipliers, against: Sequence[Array], value: float) -> Multipliers:
    """Multipliers with as much of those by which limits contradict each other as makes such mounts bad designs."""
    proof = lower_bound(replace(problem, terms=()), Multipliers((), tuple(against)))
    prices = proof.multipliers.shadow_prices(problem)
    whole = sum(price * most for price, (most, _) in zip(prices, problem.limits, strict=True))
    if not proof.value > 0.0:
        return found
    times = min(value / proof.value, STEEPEST * value / whole)
    rows = zip(found.limits, proof.multipliers.limits, strict=True)
    return replace(found, limits=tuple(z + times * other for z, other in rows))


def _times(problem: AffineProblem) -> list[int]:
    """How many times as few samples are tried, most first: cones of all would take longer than many corners."""
    rows = sum(len(norm.grid.weights) for _, norm in (*problem.terms, *problem.limits))
    whole = [k for k in range(1, problem.samples // LEAST_SAMPLES + 1) if problem.samples % k == 0] or [1]
    found = {min((k for k in whole if rows <= most * k), default=whole[-1]) for most in ROWS}
    return sorted(found, reverse=True)


def _none(problem: AffineProblem) -> Multipliers:
    terms, limits = (
        tuple(np.zeros_like(norm.constant) for _, norm in each) for each in (problem.terms, problem.limits)
    )
    return Multipliers(terms, limits)


def _few_count(problem: AffineProblem) -> bool:
    """Whether all but few rows have no part in the objective, and limits have few."""
    whole = sum(len(norm.grid.weights) for _, norm in problem.limits)
    return all(norm.norm.is_largest for _, norm in problem.terms) and whole <= ROWS[-1]


def _peaks(problem: AffineProblem, x: Array, best: Bound) -> tuple[Array, Bound]:
    """The same at all samples, by rows alone that come near the peaks: the others have no part in them (P10)."""
    kept = [np.zeros(0, dtype=np.intp) for _ in problem.terms]
    for _ in range(ROUNDS):
        kept = [
            np.union1d(rows, rows_near(norm.value(x), norm, x, NEAR))
            for rows, (_, norm) in zip(kept, problem.terms, strict=True)
        ]
        few = [(weight, rows_of(norm, rows)) for rows, (weight, norm) in zip(kept, problem.terms, strict=True)]
        found = solve_cones(replace(problem, terms=tuple(few)))
        if found.x is None:
            break
        whole = [np.zeros_like(norm.constant) for _, norm in problem.terms]
        for z, rows, own in zip(whole, kept, found.multipliers.terms, strict=True):
            z[rows] = own
        bound = lower_bound(problem, replace(found.multipliers, terms=tuple(whole)))
        best = max(best, bound, key=lambda each: each.value)
        x = min(x, found.x, key=problem.objective)
        if problem.objective(x) - best.value <= ENOUGH * best.value:
            break
        x = found.x
    return x, best
