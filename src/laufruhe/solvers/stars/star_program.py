"""Solve the cone program of one crank star with one set of shafts, and derive a cut for all stars (S13, S14)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, check_dual, gap_of
from laufruhe.prove.throws.star_cuts import Cut, cut_of
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.solvers.cones.conic import solve_cones

# smallest number of samples, and factor of samples to check a limit that is nearly violated
COARSE, FINER = 48, 4


@dataclass(frozen=True, eq=False)
class SolvedStar:
    """Design of one crank star with one set of shafts, and unbalances at their optimum.

    Attributes
    ----------
    star, built
        Steps of the throws, and indices of the sets of optional shafts that are built.
    value, bound
        Objective of the design, and its lower bound over all designs of this star [SI].
    """

    star: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float


def shaft_owners(model: StarModel) -> tuple[int, ...]:
    """Return for every open unbalance the index of the set of optional shafts that carries it, or -1."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in model.problem.engine.rotors}
    sets = model.phasing.shafts.optional
    shafts = [shaft_of[decision.rotor_drives[0].rotor] for decision in model.problem.unbalances]
    return tuple(next((k for k, names in enumerate(sets) if shaft in names), -1) for shaft in shafts)


def solve_design(
    model: StarModel, star: tuple[int, ...], built: tuple[int, ...], tolerance: float, zero_level: float = 0.0
) -> tuple[SolvedStar | None, Cut | None]:
    """Find the optimum of one crank star with one set of shafts, and a cut that bounds all other stars.

    Parameters
    ----------
    model
        Norms of the objective and limits for every crank star.
    star, built
        Steps of the throws, and indices of the sets of optional shafts that are built.
    tolerance
        Relative gap that counts as closed.
    zero_level
        Objective that counts as zero [SI].

    Returns
    -------
    Design and cut. The design is None if this star has none; the cut then excludes other stars too (S45). The cut is
    None if nothing is proven about other stars.
    """
    full, proves, owners = model.samples, model.problem.search.proves, shaft_owners(model)
    # a lower bound of sample averages is a lower bound of the means (P7)
    fine, relaxed = model.at(full), model.at(full, averaged=True)
    fine_rows, averaged = (_with_shafts(rows.at(star), owners, built) for rows in (fine, relaxed))
    if not fine_rows.size:
        if _violates_limit(model, star, fine_rows):
            return None, None
        # without decisions, the rows of the star prove its value
        star_rows = relaxed.at(star)
        zero = np.zeros(star_rows.size)
        terms = tuple(norm.subgradient(zero) for _, norm in star_rows.terms)
        limits = tuple(np.zeros_like(norm.constant) for _, norm in star_rows.limits)
        value = fine_rows.objective(np.zeros(0))
        return SolvedStar(star, built, value, star_rows.objective(zero)), cut_of(relaxed, Multipliers(terms, limits))
    best: tuple[SolvedStar, Bound, Array] | None = None
    for samples in _sample_counts(full):
        solution = solve_cones(_with_shafts(model.at(samples).at(star), owners, built))
        if solution.x is None:
            # at few samples, a mean may exceed its value over the cycle; sample averages never do (P7)
            averages = model.at(samples, averaged=True)
            loose_problem = replace(
                averages, limits=tuple((maximum * (1.0 + FEASIBILITY_TOL), norm) for maximum, norm in averages.limits)
            )
            cut = _limit_cut(loose_problem, solution.multipliers)
            if cut.excludes(np.array([star]), [built], owners).all():
                return None, cut
            solution = solve_cones(_with_shafts(loose_problem.at(star), owners, built))
            if solution.x is None:
                return None, _limit_cut(loose_problem, solution.multipliers)
            if samples < full:
                continue
        bound = best_bound(averaged, solution.x, solution.multipliers)
        violation = fine_rows.violation(solution.x)
        best = (SolvedStar(star, built, fine_rows.objective(solution.x), bound.value), bound, solution.x)
        # more samples cannot close the gap between averages and means; without a proof, few samples suffice
        is_close = gap_of(averaged.objective(solution.x), bound.value, zero_level) <= 0.25 * tolerance or not proves
        if is_close and violation <= FEASIBLE:
            break
    if best is None:
        return None, None
    design, bound, x = best
    cut = cut_of(relaxed, bound.multipliers)
    cut_bound = float(cut.bounds(np.array([star]), [built], owners)[0, 0])
    check_dual("cuts of stars, at their own star", cut_bound, averaged, x, bound)
    return design, cut


def coarse_value(model: StarModel, star: tuple[int, ...], built: tuple[int, ...]) -> float:
    """Return the optimal objective of one crank star, estimated at few samples [SI]; infinite if infeasible."""
    affine = _with_shafts(model.at(_sample_counts(model.samples)[0]).at(star), shaft_owners(model), built)
    if not affine.size:
        return affine.objective(np.zeros(0))
    x = solve_cones(affine).x
    return math.inf if x is None else affine.objective(x)


def _violates_limit(model: StarModel, star: Sequence[int], affine: AffineProblem) -> bool:
    # without decisions; means that violate limits are computed again at more samples
    def violates(limit: tuple[float, AffineNorm], tolerance: float) -> bool:
        maximum, norm = limit
        return norm.value(np.zeros(norm.slope.shape[-1])) > maximum * (1.0 + tolerance)

    violated = [k for k, limit in enumerate(affine.limits) if violates(limit, FEASIBLE)]
    if not violated:
        return False
    finer = model.at(FINER * model.samples, averaged=True).at(star).limits
    return any(violates(finer[k], FEASIBILITY_TOL) for k in violated)


def _limit_cut(problem: StarProblem, multipliers: Multipliers) -> Cut:
    # multipliers of the limits may prove that stars violate them (S45)
    return cut_of(problem, replace(multipliers, terms=tuple(np.zeros_like(norm.constant) for _, norm in problem.terms)))


def _sample_counts(full: int) -> list[int]:
    divisors = [n for n in range(1, full + 1) if full % n == 0 and n >= min(COARSE, full)]
    counts = [divisors[0]]
    for n in divisors:
        if n >= 3 * counts[-1] and n % counts[-1] == 0:
            counts.append(n)
    return counts


def _with_shafts(affine: AffineProblem, owners: Sequence[int], built: tuple[int, ...]) -> AffineProblem:
    """Return the problem without the unbalances of optional shafts that are not built."""
    is_built = [owner < 0 or owner in built for owner in owners]
    if all(is_built):
        return affine
    columns = np.concatenate(
        [np.full(d.width, has_shaft) for d, has_shaft in zip(affine.domains, is_built, strict=True)]
    )
    terms, limits = (
        tuple((number, replace(norm, slope=norm.slope[..., columns])) for number, norm in pairs)
        for pairs in (affine.terms, affine.limits)
    )
    domains, start = [], 0
    for domain, has_shaft in zip(affine.domains, is_built, strict=True):
        if has_shaft:
            domains.append(replace(domain, start=start))
            start += domain.width
    return AffineProblem(terms, limits, tuple(domains), affine.samples)
