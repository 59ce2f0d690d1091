"""Solve the cone program of one crank star with one set of shafts, and derive a cut for all stars (S13, S14)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, check_dual, gap_of, gap_tolerance_of
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


# number of crank stars whose bounds are computed at once
_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class CutSearchResult:
    """Designs that a search solved, and lower bounds of all designs.

    Attributes
    ----------
    solved
        Every solved design, best first.
    lower_bound, open_bound
        Lower bounds of the objective over all designs, and over those not solved (infinite if there are none) [SI].
    complete
        True if the search ended with a proof, False if its time ended.
    designs, infeasible
        Number of crank stars times number of sets of shafts, and number of those solved without a feasible design.
    """

    solved: tuple[SolvedStar, ...]
    lower_bound: float
    open_bound: float
    complete: bool
    designs: int
    infeasible: int


def search_designs(
    model: StarModel, stars: Stars, count: int, tolerance: float, time_limit: float = math.inf, zero_level: float = 0.0
) -> CutSearchResult:
    """Return the best designs over crank stars and sets of optional shafts, with a proof (S15).

    The cone program of one star gives dual rows Z. The bound from these rows is affine in the star, so one solve bounds
    every star from below, or proves that other stars violate the limits too. The next star is the one with the lowest
    bound. The search ends with a proof when this bound reaches the best objective. Each star is solved at most once.

    Parameters
    ----------
    stars
        Steps of the throws of every crank star allowed, shape (n, throws).
    count
        Number of best designs to prove.
    time_limit
        Largest time of the search [s].
    """
    started = time.perf_counter()
    owners, shafts = shaft_owners(model), model.phasing.shafts
    # if every unbalance may be zero, the largest sets of shafts include all others
    needs_weight = any(owner >= 0 and d.set.lower > 0.0 for d, owner in zip(model.domains, owners, strict=True))
    sets = shafts.allowed if needs_weight else shafts.largest
    bounds = np.zeros((len(stars), len(sets)))
    is_open = np.ones(bounds.shape, dtype=bool)
    solved: list[SolvedStar] = []
    infeasible, complete = 0, False
    while True:
        open_bounds = np.where(is_open, bounds, np.inf)
        open_bound = float(open_bounds.min(initial=np.inf))
        lower_bound = min([open_bound, *(design.bound for design in solved)])
        values = _distinct_values(model.space, solved)
        target = values[count - 1] if len(values) >= count else math.inf
        if not is_open.any() or open_bound >= target - gap_tolerance_of(target, tolerance, zero_level):
            complete = True
            break
        has_result = bool(solved or infeasible)
        if time.perf_counter() - started > time_limit or (is_time_over() and has_result):
            break
        best = min((design.value for design in solved), default=math.inf)
        report_progress("stars and sets of shafts", len(solved) + infeasible, bounds.size, best, lower_bound)
        row, column = divmod(int(np.argmin(open_bounds)), len(sets))
        star = tuple(int(p) for p in stars[row])
        design, cut = solve_design(model, star, sets[column], tolerance, zero_level)
        is_open[row, column] = False
        if cut is not None:
            for start in range(0, len(stars), _CHUNK):
                part, designs = slice(start, start + _CHUNK), (stars[start : start + _CHUNK], sets, owners)
                proven = np.where(cut.excludes(*designs), np.inf, 0.0) if design is None else cut.bounds(*designs)
                np.maximum(bounds[part], proven, out=bounds[part])
            is_open &= np.isfinite(bounds)
        if design is None:
            infeasible += 1
        else:
            solved.append(design)
    solved.sort(key=lambda s: (s.value, s.star, s.built))
    return CutSearchResult(tuple(solved), lower_bound, open_bound, complete, bounds.size, infeasible)


def _distinct_values(space: StarSpace, solved: Sequence[SolvedStar]) -> list[float]:
    """Return the objectives of distinct designs, ascending [SI]; equally good mirror images count once (S2)."""
    if not solved:
        return []
    images = replace(space, mirror=True, reflect=True)
    stars = images.canonical(np.array([design.star for design in solved], dtype=np.uint8))
    distinct: list[tuple[bytes, tuple[int, ...], float]] = []
    for star, design in sorted(zip(stars, solved, strict=True), key=lambda pair: pair[1].value):
        key = star.tobytes(), design.built
        if not any(key == (a, b) and abs(v - design.value) <= 1e-6 * max(v, design.value) for a, b, v in distinct):
            distinct.append((*key, design.value))
    return [value for _, _, value in distinct]
