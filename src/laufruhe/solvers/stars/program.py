"""One star with one set of shafts: the cone program of everything else, and what it proves of all stars (S13, S14)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, Multipliers, best_bound, check_dual, gap_of
from laufruhe.prove.throws.star_cut import Cut, cut_of
from laufruhe.solvers.conclusion import KEPT
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.program import ConicSolution

COARSE = 48
# times as many angles, where a limit is nearly at its edge
FINER = 4


@dataclass(frozen=True, eq=False)
class Solved:
    """One star with one set of shafts, everything else at its optimum.

    Attributes
    ----------
    star
        Steps of the throws.
    built
        Which sets of optional shafts are built.
    value, bound
        Objective of the design found, and what no design of this star goes under.
    """

    star: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float


def owners_of(model: StarModel) -> tuple[int, ...]:
    """The set of optional shafts that every decision belongs to, -1 for none."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in model.problem.engine.rotors}
    sets = model.phasing.shafts.optional
    out = []
    for decision in model.problem.unbalances:
        shaft = shaft_of[decision.rotor_drives[0].rotor]
        out.append(next((k for k, names in enumerate(sets) if shaft in names), -1))
    return tuple(out)


def solve_design(
    model: StarModel,
    star: tuple[int, ...],
    built: tuple[int, ...],
    owners: Sequence[int],
    tolerance: float,
    nothing: float = 0.0,
) -> tuple[Solved | None, Cut | None]:
    """The optimum of one star with one set of shafts, and what it proves of all others.

    Returns
    -------
    None where no design of this star keeps the limits, with what shows that of others too (S45), if anything does.
    """
    full, proves = model.samples, model.problem.search.proves
    # what bounds means that are averaged bounds the whole cycle (P7)
    fine, sound = model.at(full), model.at(full, averaged=True)
    kept = _kept(owners, built)
    whole, averaged = _only(fine.at(star), kept), _only(sound.at(star), kept)
    idle = [not norm.slope.any() for _, norm in whole.limits]
    if _broken(model, star, whole, idle):
        return None, None
    if not any(kept):
        return _fixed(sound, whole, star, built)
    best: tuple[Solved, Bound, Array] | None = None
    for samples in _grids(full):
        solution = solve_cones(_acting(_only(model.at(samples).at(star), kept), idle))
        if solution.x is None:
            # a mean at a few angles may be more than over the cycle, averages never are (P7)
            rough = model.at(samples, averaged=True)
            solution, cut = _by_averages(rough, star, built, owners, idle, solution)
            if solution.x is None:
                return None, cut
            if samples < full:
                continue
        bound = best_bound(_acting(averaged, idle), solution.x, solution.multipliers)
        value, excess = whole.objective(solution.x), _acting(whole, idle).excess(solution.x)
        best = (Solved(star, built, value, bound.value), bound, solution.x)
        # what averages fall short by, no grid of this fidelity gains; a design alone is as good at few angles
        enough = gap_of(averaged.objective(solution.x), bound.value, nothing) <= 0.25 * tolerance or not proves
        if enough and excess <= FEASIBLE:
            break
    if best is None:
        return None, None
    solved, bound, x = best
    cut = cut_of(sound, _with_idle(bound.multipliers, sound, idle))
    own = float(cut.bounds(np.array([star]), [built], owners)[0, 0])
    check_dual("cuts of stars, at their own star", own, _acting(averaged, idle), x, bound)
    return solved, cut


def coarse_value(model: StarModel, star: tuple[int, ...], built: tuple[int, ...], owners: Sequence[int]) -> float:
    """The least objective of one star with one set of shafts at few angles; infinite where it keeps no limit."""
    kept = _kept(owners, built)
    affine = _only(model.at(_grids(model.samples)[0]).at(star), kept)
    if not any(kept):
        return affine.objective(np.zeros(affine.size))
    x = solve_cones(affine).x
    return math.inf if x is None else affine.objective(x)


def _broken(model: StarModel, star: Sequence[int], whole: AffineProblem, idle: Sequence[bool]) -> bool:
    """Whether a limit that nothing open acts on is broken, its mean averaged about many angles where that matters."""
    x, over = np.zeros(whole.size), []
    for k, (maximum, norm) in enumerate(whole.limits):
        if idle[k] and norm.value(x) > maximum * (1.0 + FEASIBLE):
            over.append(k)
    if not over:
        return False
    finer = model.at(FINER * model.samples, averaged=True).at(star).limits
    return any(norm.value(np.zeros(norm.slope.shape[-1])) > maximum * (1.0 + KEPT) for maximum, norm in
               (finer[k] for k in over))  # fmt: skip


def _acting(affine: AffineProblem, idle: Sequence[bool]) -> AffineProblem:
    """The problem under those limits alone that something open acts on."""
    if not any(idle):
        return affine
    return replace(affine, limits=tuple(limit for limit, out in zip(affine.limits, idle, strict=True) if not out))


def _with_idle(multipliers: Multipliers, rows_of: StarProblem, idle: Sequence[bool]) -> Multipliers:
    rows = iter(multipliers.limits)
    limits = tuple(
        np.zeros_like(norm.constant) if out else next(rows) for (_, norm), out in zip(rows_of.limits, idle, strict=True)
    )
    return replace(multipliers, limits=limits)


def widened(averaged: StarProblem) -> StarProblem:
    """With limits wider by what a design may exceed them by."""
    return replace(averaged, limits=tuple((maximum * (1.0 + KEPT), norm) for maximum, norm in averaged.limits))


def _by_averages(
    averaged: StarProblem, star: tuple[int, ...], built: tuple[int, ...], owners: Sequence[int], idle: Sequence[bool],
    found: ConicSolution,
) -> tuple[ConicSolution, Cut]:  # fmt: skip
    """The design of a star that has none at the angles, by averages; and what dual rows prove of others (S45).

    Limits are wider by what a design may exceed them by. Where dual rows of the angles show that averages have none
    either, these are not asked.
    """
    wide = widened(averaged)
    none = tuple(np.zeros_like(norm.constant) for _, norm in wide.terms)
    cut = cut_of(wide, Multipliers(none, _with_idle(found.multipliers, wide, idle).limits))
    if cut.excludes(np.array([star]), [built], owners).all():
        return found, cut
    found = solve_cones(_acting(_only(wide.at(star), _kept(owners, built)), idle))
    return found, cut_of(wide, Multipliers(none, _with_idle(found.multipliers, wide, idle).limits))


def _fixed(
    sound: StarProblem, whole: AffineProblem, star: tuple[int, ...], built: tuple[int, ...]
) -> tuple[Solved, Cut]:
    """A star with nothing to decide: its rows are its proof."""
    averaged = sound.at(star)
    x = np.zeros(averaged.size)
    value = whole.objective(np.zeros(whole.size))
    terms = tuple(n.subgradient(x) for _, n in averaged.terms)
    limits = tuple(np.zeros_like(n.constant) for _, n in averaged.limits)
    return Solved(star, built, value, averaged.objective(x)), cut_of(sound, Multipliers(terms, limits))


def _grids(full: int) -> list[int]:
    """Numbers of samples from coarse to full, each a divisor of the full number."""
    divisors = [n for n in range(1, full + 1) if full % n == 0 and n >= min(COARSE, full)]
    chosen = [divisors[0]]
    for n in divisors:
        if n >= 3 * chosen[-1] and n % chosen[-1] == 0:
            chosen.append(n)
    return chosen


def _kept(owners: Sequence[int], built: tuple[int, ...]) -> tuple[bool, ...]:
    """Return for every decision if its shaft is built."""
    return tuple(own < 0 or own in built for own in owners)


def _only(affine: AffineProblem, kept: Sequence[bool]) -> AffineProblem:
    """The problem without the decisions of shafts that are not built."""
    if all(kept):
        return affine
    columns = np.concatenate([np.full(d.width, keep) for d, keep in zip(affine.domains, kept, strict=True)])

    def cut(norm: AffineNorm) -> AffineNorm:
        return replace(norm, slope=norm.slope[..., columns])

    domains, start = [], 0
    for domain, keep in zip(affine.domains, kept, strict=True):
        if keep:
            domains.append(replace(domain, start=start))
            start += domain.width
    return AffineProblem(
        tuple((w, cut(n)) for w, n in affine.terms),
        tuple((m, cut(n)) for m, n in affine.limits),
        tuple(domains),
        affine.samples,
    )
