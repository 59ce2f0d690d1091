"""Cone program of one star with one set of shafts, and the cut that it gives for all stars (S13, S14)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, check_dual, gap_of
from laufruhe.prove.throws.star_cuts import Cut, cut_of
from laufruhe.solvers.conclusion import KEPT
from laufruhe.solvers.cones.conic import solve_cones

COARSE = 48
FINER = 4
"""Times as many angles, where a limit is nearly at its edge."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Design of one star with one set of shafts, everything else at its optimum.

    Attributes
    ----------
    star
        Steps of the throws.
    built
        Numbers of the sets of optional shafts that are built.
    value, bound
        Objective of the design, and its bound over all designs of this star [SI].
    """

    star: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float


def shaft_owners(model: StarModel) -> tuple[int, ...]:
    """Return the set of optional shafts that every decision belongs to, -1 for none."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in model.problem.engine.rotors}
    sets = model.phasing.shafts.optional
    shafts = [shaft_of[decision.rotor_drives[0].rotor] for decision in model.problem.unbalances]
    return tuple(next((k for k, names in enumerate(sets) if shaft in names), -1) for shaft in shafts)


def solve_design(
    model: StarModel,
    star: tuple[int, ...],
    built: tuple[int, ...],
    owners: Sequence[int],
    tolerance: float,
    zero_level: float = 0.0,
) -> tuple[Solved | None, Cut | None]:
    """Find the optimum of one star with one set of shafts, and its bound of all others.

    Parameters
    ----------
    built
        Numbers of the sets of optional shafts that are built.
    owners
        Set of optional shafts that every decision belongs to, -1 for none.

    Returns
    -------
    No design where none of this star keeps the limits, with a cut that shows it of others too (S45), if any does.
    """
    full, proves = model.samples, model.problem.search.proves
    # what bounds averaged means bounds the whole cycle (P7)
    fine, sound = model.at(full), model.at(full, averaged=True)
    fine_rows, averaged = (_with_shafts(rows.at(star), owners, built) for rows in (fine, sound))
    fixed = [not norm.slope.any() for _, norm in fine_rows.limits]
    if _breaks_fixed_limit(model, star, fine_rows, fixed):
        return None, None
    if not fine_rows.size:
        # nothing to decide: the star's rows are its proof
        every = sound.at(star)
        zero = np.zeros(every.size)
        terms = tuple(norm.subgradient(zero) for _, norm in every.terms)
        limits = tuple(np.zeros_like(norm.constant) for _, norm in every.limits)
        value = fine_rows.objective(np.zeros(0))
        return Solved(star, built, value, every.objective(zero)), cut_of(sound, Multipliers(terms, limits))
    best: tuple[Solved, Bound, Array] | None = None
    for samples in _sample_counts(full):
        solution = solve_cones(_without_fixed_limits(_with_shafts(model.at(samples).at(star), owners, built), fixed))
        if solution.x is None:
            # a mean at a few angles may be more than over the cycle, averages never are (P7)
            rough = model.at(samples, averaged=True)
            wide = replace(rough, limits=tuple((maximum * (1.0 + KEPT), norm) for maximum, norm in rough.limits))
            cut = _limit_cut(wide, solution.multipliers, fixed)
            if cut.excludes(np.array([star]), [built], owners).all():
                return None, cut
            solution = solve_cones(_without_fixed_limits(_with_shafts(wide.at(star), owners, built), fixed))
            if solution.x is None:
                return None, _limit_cut(wide, solution.multipliers, fixed)
            if samples < full:
                continue
        bound = best_bound(_without_fixed_limits(averaged, fixed), solution.x, solution.multipliers)
        value, violation = (
            fine_rows.objective(solution.x),
            _without_fixed_limits(fine_rows, fixed).violation(solution.x),
        )
        best = (Solved(star, built, value, bound.value), bound, solution.x)
        # what averages fall short by, no grid of this fidelity gains; a design alone is as good at few angles
        is_close = gap_of(averaged.objective(solution.x), bound.value, zero_level) <= 0.25 * tolerance or not proves
        if is_close and violation <= FEASIBLE:
            break
    if best is None:
        return None, None
    design, bound, x = best
    cut = cut_of(sound, _with_fixed_multipliers(bound.multipliers, sound, fixed))
    bound_here = float(cut.bounds(np.array([star]), [built], owners)[0, 0])
    check_dual("cuts of stars, at their own star", bound_here, _without_fixed_limits(averaged, fixed), x, bound)
    return design, cut


def coarse_value(model: StarModel, star: tuple[int, ...], built: tuple[int, ...], owners: Sequence[int]) -> float:
    """Return the least objective of one star with one set of shafts at few angles, infinite where it breaks limits."""
    affine = _with_shafts(model.at(_sample_counts(model.samples)[0]).at(star), owners, built)
    if not affine.size:
        return affine.objective(np.zeros(0))
    x = solve_cones(affine).x
    return math.inf if x is None else affine.objective(x)


def _breaks_fixed_limit(model: StarModel, star: Sequence[int], affine: AffineProblem, fixed: Sequence[bool]) -> bool:
    # a limit without open decisions; its mean is checked again at more angles
    x = np.zeros(affine.size)
    over = [
        k for k, (maximum, norm) in enumerate(affine.limits) if fixed[k] and norm.value(x) > maximum * (1.0 + FEASIBLE)
    ]
    if not over:
        return False
    finer = model.at(FINER * model.samples, averaged=True).at(star).limits
    return any(norm.value(np.zeros(norm.slope.shape[-1])) > maximum * (1.0 + KEPT) for maximum, norm in
               (finer[k] for k in over))  # fmt: skip


def _limit_cut(wide: StarProblem, multipliers: Multipliers, fixed: Sequence[bool]) -> Cut:
    # multipliers of the limits alone may show that stars cannot keep them (S45)
    zero = tuple(np.zeros_like(norm.constant) for _, norm in wide.terms)
    return cut_of(wide, Multipliers(zero, _with_fixed_multipliers(multipliers, wide, fixed).limits))


def _without_fixed_limits(affine: AffineProblem, fixed: Sequence[bool]) -> AffineProblem:
    if not any(fixed):
        return affine
    return replace(affine, limits=tuple(limit for limit, out in zip(affine.limits, fixed, strict=True) if not out))


def _with_fixed_multipliers(multipliers: Multipliers, problem: StarProblem, fixed: Sequence[bool]) -> Multipliers:
    rows = iter(multipliers.limits)
    limits = tuple(
        np.zeros_like(norm.constant) if out else next(rows)
        for (_, norm), out in zip(problem.limits, fixed, strict=True)
    )
    return replace(multipliers, limits=limits)


def _sample_counts(full: int) -> list[int]:
    divisors = [n for n in range(1, full + 1) if full % n == 0 and n >= min(COARSE, full)]
    chosen = [divisors[0]]
    for n in divisors:
        if n >= 3 * chosen[-1] and n % chosen[-1] == 0:
            chosen.append(n)
    return chosen


def _with_shafts(affine: AffineProblem, owners: Sequence[int], built: tuple[int, ...]) -> AffineProblem:
    """Leave out the decisions of shafts that are not built."""
    used = [owner < 0 or owner in built for owner in owners]
    if all(used):
        return affine
    columns = np.concatenate([np.full(d.width, keep) for d, keep in zip(affine.domains, used, strict=True)])
    terms, limits = (
        tuple((number, replace(norm, slope=norm.slope[..., columns])) for number, norm in pairs)
        for pairs in (affine.terms, affine.limits)
    )
    domains, start = [], 0
    for domain, keep in zip(affine.domains, used, strict=True):
        if keep:
            domains.append(replace(domain, start=start))
            start += domain.width
    return AffineProblem(terms, limits, tuple(domains), affine.samples)
