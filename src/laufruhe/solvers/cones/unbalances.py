"""Sizing counterweights and balancer shafts to a proven optimum (P1-P6)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time
from laufruhe.problem.channels import OF_MOUNTS
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import FINE_SAMPLES, evaluate, with_fine_sampling
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.numerical_zero import ROUNDING, numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Reach, best_bound, gap_of, kkt_residual
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, Shown, broken_limits, concluded, judged, none_within, not_found
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.equations import on_grid
from laufruhe.solvers.cones.lightest import SAME_LOAD, lightest
from laufruhe.solvers.cones.sharpening import Optimum, sharpened
from laufruhe.solvers.conflicts import smallest
from laufruhe.solvers.prices import Price, affine_prices
from laufruhe.solvers.result import Result
from laufruhe.solvers.told_limits import told_excess

MOST_DOUBLINGS = 4
MOST_MARGINS = 3
MANY_ROWS = 2000
MOST_ROWS = 60_000
NEGLIGIBLE = 1e-6


def beyond_mounts(problem: Problem) -> tuple[str, ...]:
    """Limits that no unbalances keep together, whatever the open mounts are."""
    limits = tuple(limit for limit in problem.load_limits if not depends(limit.measure.channel, OF_MOUNTS, problem))
    if not limits:
        return ()
    apart = off_resonance(replace(problem.balance, objective=(Term(limits[0].measure),), limits=limits))
    return (
        solve_unbalances(apart).conflict
        if apart.decisions
        else broken_limits(limits, with_fine_sampling(evaluate(apart)))
    )


def solve_sharply(problem: Problem) -> Result:
    """As `solve_unbalances`, with a gap of a millionth where that is asked for and the optimum is smooth (P10)."""
    return solve_unbalances(problem, problem.sharply)


def solve_unbalances(problem: Problem, sharply: bool = False, angles: int = 0) -> Result:
    """Global optimum of a problem whose decisions are unbalances.

    Parameters
    ----------
    angles
        Of a cycle, at which the first program stands at least: as many as problems like it needed.

    Returns
    -------
    Result with a certificate computed from the exact model, or with the limits that
    cannot be met together.
    """
    started = time.perf_counter()
    model = AffineModel(problem)
    # most designs are given with what is open at zero, and that one is known
    initial = evaluate(problem) if any(problem.start) else model.bare
    modelled = time.perf_counter()
    idle, hopeless = _idle(problem, model)
    if hopeless:
        return none_within(problem, initial, hopeless, {"model": modelled - started})
    model = model.with_limits([limit for limit in problem.limits if limit not in idle])
    begin = int(angles * float(problem.engine.cycle.base_order / model.base))
    optimum, samples = _refine(model.problem, model, numerical_zero(problem), begin)
    solved = time.perf_counter()
    timing = {"model": modelled - started, "solve": solved - modelled}
    if optimum is None:
        # means averaged, as what was proven of all limits together was (P7)
        sound = model.at(samples, averaged=True)
        names = [limit.name for limit in model.problem.load_limits]
        if not is_empty(sound):
            return not_found(problem, initial, names, timing)
        return none_within(problem, initial, conflict_of(sound, names), timing)
    if sharply:
        optimum = sharpened(model, optimum)
    values = [domain.complex_value(optimum.x) for domain in model.domains]
    cycle_samples = int(optimum.problem.samples * float(model.base / problem.engine.cycle.base_order))
    design = judged(problem, values, cycle_samples)
    if idle and design.excess > KEPT:
        design = judged(problem, values, with_fine_sampling(design.evaluation).samples)
    initial = replace(initial, samples=design.evaluation.samples)
    timing["evaluate"] = time.perf_counter() - solved
    return concluded(design, initial, _shown(model.problem.load_limits, idle, optimum, design.value), timing)


def _refine(problem: Problem, model: AffineModel, nothing: float, begin: int) -> tuple[Optimum | None, int]:
    """Solve at more and more angles until the bound on a grid twice as fine meets the design (P6).

    Parameters
    ----------
    begin
        Angles of a period of the loads at which it begins, at least.

    Returns
    -------
    The optimum, None where the limits cannot be met, and the angles that told.
    """
    samples, best = max(_first_samples(model), begin), None
    # a mean that is all but as little as can be is kept at no few angles
    most = max(MOST_DOUBLINGS, math.ceil(math.log2(2 * FINE_SAMPLES / samples)))
    for k in in_time(range(most + 1)):
        found = _allowed(problem, model, samples, nothing)
        if found is None:
            if best is not None and best.excess <= KEPT and _is_kept(problem, best):
                return best, samples
            # means averaged, for at a few angles alone one may be more than over the whole cycle (P7)
            if is_empty(model.at(samples, averaged=True)):
                return None, samples
            # a limit that is all but the least of what it limits is kept by what counts as kept
            found = _attempt(problem, model, samples, nothing, FEASIBLE - KEPT)
            best = found if found is not None and found.excess <= KEPT and _is_kept(problem, found) else best
            samples *= 2
            continue
        best = found
        rows = max(len(norm.grid.weights) for _, norm in best.problem.terms)
        enough = best.gap <= problem.tolerance or not problem.search.proves
        kept = best.excess <= (FEASIBLE if k < MOST_DOUBLINGS else KEPT)
        is_told = kept and (enough or k >= MOST_DOUBLINGS)
        if rows > MOST_ROWS or (is_told and _is_kept(problem, found)):
            break
        samples *= 2
    return best, samples


def _is_kept(problem: Problem, found: Optimum) -> bool:
    """Whether many angles tell so of the limits too: a mean at a few may be less than over the cycle (P7)."""
    if not any(limit.measure.is_load for limit in problem.load_limits):
        return True
    values = [domain.complex_value(found.x) for domain in found.problem.domains]
    return told_excess(problem, evaluate(problem, problem.design(values))) <= KEPT


def _first_samples(model: AffineModel) -> int:
    """Angles of the first program: of many half, for it is judged at twice as many, and these are all of a cycle."""
    half = model.full_samples // 2
    many = model.full_samples % 2 == 0 and any(len(norm.grid.weights) > MANY_ROWS for _, norm in model.at(half).terms)
    return half if many else model.full_samples


def _allowed(problem: Problem, model: AffineModel, samples: int, nothing: float) -> Optimum | None:
    """An optimum at `samples` angles that keeps its limits between them too.

    A peak between the angles breaks its limit by a little; the next attempt asks for
    that little less at the angles.
    """
    found = _attempt(problem, model, samples, nothing, 0.0)
    margin = 0.0
    for _ in in_time(range(MOST_MARGINS)):
        if found is None or found.excess <= FEASIBLE:
            break
        margin += 1.05 * found.excess
        found = _attempt(problem, model, samples, nothing, margin) or found
    return found


def _attempt(problem: Problem, model: AffineModel, samples: int, nothing: float, margin: float) -> Optimum | None:
    coarse, fine = model.at(samples), model.at(2 * samples)
    solution = solve_cones(tightened(coarse, margin))
    if solution.x is None:
        return None
    x = settled(problem, fine, solution.x)
    averaged = model.at(fine.samples, averaged=True)
    bound = best_bound(averaged, x, on_grid(coarse, averaged, solution.multipliers))
    has_peaks = any(measure.is_load and measure.norm.refinement > 1 for measure in problem.measures)
    judge = model.at(fine.samples, finer=True) if has_peaks else fine
    value = judge.objective(x)
    return Optimum(x, bound, fine, gap_of(value, bound.value, nothing), judge.excess(x), samples, nothing)


def tightened(affine: AffineProblem, margin: float) -> AffineProblem:
    """Limits a little lower; higher where the margin is less than none."""
    return replace(affine, limits=tuple((maximum * (1.0 - margin), norm) for maximum, norm in affine.limits))


def _idle(problem: Problem, model: AffineModel) -> tuple[list[Limit], tuple[str, ...]]:
    """Limits that nothing open acts on, and the first of them that is broken.

    They are judged like any design, and are in no program: there a rounding would have a price without end.
    """
    still = [limit for limit in problem.load_limits if not model.norm(limit.measure, model.full_samples).slope.any()]
    # a whole number of times as fine
    samples = model.full_samples * max(2, math.ceil(FINE_SAMPLES / model.full_samples))
    none = np.zeros(sum(domain.width for domain in model.domains))
    idle = [(limit, model.norm(limit.measure, samples).value(none)) for limit in still]
    broken = [limit.name for limit, value in idle if value > limit.maximum * (1.0 + KEPT)]
    return still, tuple(broken[:1])


def settled(problem: Problem, affine: AffineProblem, x: Array) -> Array:
    """Of designs that no load can tell apart the lightest, what is negligible in it left out."""
    still = _indistinguishable(problem, affine)
    if still.shape[1]:
        sizes = [sum(abs(drive.gain) for drive in domain.decision.rotor_drives) for domain in affine.domains]
        x = lightest(affine, x, still, sizes)
    return _cancelling(affine, _without_negligible(affine, x))


def _cancelling(affine: AffineProblem, x: Array) -> Array:
    """Decisions at which what is minimised cancels to the last digit, where a solver left less than its own."""
    norms = [norm for _, norm in affine.terms]
    parts = sum(weight * replace(norm, constant=0.0 * norm.constant).value(x) for weight, norm in affine.terms)
    if not 0.0 < affine.objective(x) <= NEGLIGIBLE * parts:
        return x
    slope = np.concatenate([norm.slope.reshape(-1, affine.size) * affine.units for norm in norms])
    rest = np.concatenate([norm.rows(x).reshape(-1) for norm in norms])
    # what is left out stays out
    found = x - affine.units * np.linalg.lstsq(slope * (x != 0.0), rest)[0]
    for domain in affine.domains:
        found[domain.columns] = domain.project(found)
    is_better = affine.objective(found) < affine.objective(x) and _keeps_limits(affine, x, found)
    return found if is_better else x


def _without_negligible(affine: AffineProblem, x: Array) -> Array:
    """Decisions at zero that hardly load anything, or whose absence makes nothing worse.

    Judged by their loads and not by their bounds, which may be a million times what is needed.
    """
    x = x.copy()
    nothing = np.zeros_like(x)
    may_be_nothing = all(domain.set.lower <= 0.0 for domain in affine.domains)
    if may_be_nothing and affine.objective(nothing) <= affine.objective(x) and _keeps_limits(affine, x, nothing):
        return nothing
    # without their constants: what decisions alone make
    norms = [
        (replace(norm, constant=np.zeros_like(norm.constant)), max(norm.value(x), norm.value(nothing)))
        for _, norm in affine.terms
    ]
    for domain in affine.domains:
        if domain.set.lower > 0.0 or not x[domain.columns].any():
            continue
        alone, without = nothing.copy(), x.copy()
        alone[domain.columns] = x[domain.columns]
        without[domain.columns] = 0.0
        faint = all(norm.value(alone) <= NEGLIGIBLE * size for norm, size in norms)
        if (faint or affine.objective(without) <= affine.objective(x)) and _keeps_limits(affine, x, without):
            x = without
    return x


def _keeps_limits(affine: AffineProblem, x: Array, without: Array) -> bool:
    """Whether no limit is broken that was kept, and none that was broken is broken more."""
    return all(
        norm.value(without) <= (1.0 + 0.1 * FEASIBLE) * max(maximum, norm.value(x)) for maximum, norm in affine.limits
    )


def _indistinguishable(problem: Problem, affine: AffineProblem) -> Array:
    """Directions in which no load of the problem changes, shape (n, m); none if a mass is minimised."""
    if not affine.size or any(term.measure.is_mass for term in problem.objective):
        return np.zeros((affine.size, 0))
    loads = [norm for _, norm in affine.terms]
    loads += [
        norm for limit, (_, norm) in zip(problem.load_limits, affine.limits, strict=True)
        if not limit.measure.is_mass
    ]  # fmt: skip
    # each decision in the size of what it loads: bounds may be far apart, and far from what is needed
    sizes = np.sqrt(np.sum([np.sum(norm.slope**2, axis=(0, 1)) for norm in loads], axis=0))
    units = np.where(sizes > 0.0, 1.0 / np.where(sizes > 0.0, sizes, 1.0), affine.scales)
    slopes = [(norm.slope * units).reshape(-1, affine.size) for norm in loads]
    stacked = np.concatenate([_triangle(flat) for flat in slopes])
    _, values, rows = np.linalg.svd(stacked, full_matrices=True)
    small = np.ones(affine.size, dtype=bool)
    small[: len(values)] = values <= SAME_LOAD * values[0]
    still = rows[small].T * units[:, None]
    return np.asarray(still / np.abs(still).max(axis=0, initial=1e-300))


def _triangle(slope: Array) -> Array:
    """R of a QR factorisation, scaled: the same directions in as few rows as there are columns."""
    triangle: Array = np.asarray(np.linalg.qr(slope, mode="r"))
    return triangle / (float(np.abs(triangle).max()) or 1.0)


def _shown(limits: Sequence[Limit], idle: Sequence[Limit], optimum: Optimum, value: float) -> Shown:
    bound = optimum.bound
    prices, bounds = affine_prices(optimum.problem, limits, optimum.x, bound)
    unit = value if value > optimum.nothing else optimum.nothing / ROUNDING
    return Shown(
        bound=bound.value,
        reach=Reach.WHOLE,
        kkt_residual=kkt_residual(optimum.problem, optimum.x, bound, unit),
        method=f"second-order cones at {optimum.samples} angles{optimum.then}, dual bound at {optimum.problem.samples}",
        prices=dict.fromkeys([(limit, "at most") for limit in idle], Price(0.0, math.inf)) | prices,
        bounds=bounds,
    )


def is_empty(affine: AffineProblem) -> bool:
    """Whether no design keeps its limits; proven by rows that are never more than what they stand for."""
    return solve_cones(replace(affine, terms=())).x is None


def conflict_of(affine: AffineProblem, names: Sequence[str]) -> tuple[str, ...]:
    """A smallest set of limits that no design meets together: each is needed for the contradiction."""

    def excluded(kept: Sequence[int]) -> bool:
        return is_empty(replace(affine, limits=tuple(affine.limits[k] for k in kept)))

    return tuple(names[k] for k in smallest(range(len(affine.limits)), excluded))
