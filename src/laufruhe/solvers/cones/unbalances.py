"""Solve for unbalances of counterweights and balancer shafts, with proven optimality (P1-P6)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import until_time_limit
from laufruhe.problem.channels import OF_MOUNTS
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import FINE_SAMPLES, evaluate, with_fine_sampling
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.numerical_zero import ROUNDING, numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Bound, ProofStrength, best_bound, gap_of, kkt_residual
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    FEASIBLE,
    ProofData,
    build_result,
    evaluate_design,
    failed_result,
    infeasible_result,
    smallest_conflicting,
    violated_limits,
)
from laufruhe.solvers.cones.conic import refine_multipliers, solve_cones
from laufruhe.solvers.cones.tie_break import break_ties
from laufruhe.solvers.prices import Price, affine_prices
from laufruhe.solvers.result import Result
from laufruhe.solvers.sampling_refinement import violation_at_fine_sampling

MAX_DOUBLINGS = 4
"""Number of doublings of the samples after which a gap may stay open."""
MAX_MARGINS = 3
"""Largest number of attempts with lowered limits."""
MANY_ROWS = 2000
"""Number of rows of a term from which the first program takes half the samples."""
MAX_ROWS = 60_000
"""Number of rows of a term from which the samples are not doubled."""


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
    method
        Method in words for the certificate.
    """

    x: Array
    bound: Bound
    problem: AffineProblem
    gap: float
    violation: float
    method: str


def conflict_on_any_mounts(problem: Problem) -> tuple[str, ...]:
    """Return names of limits that contradict each other for every choice of unbalances and mounts; empty if none."""
    limits = tuple(limit for limit in problem.load_limits if not depends(limit.measure.channel, OF_MOUNTS, problem))
    if not limits:
        return ()
    balance = off_resonance(replace(problem.balance, objective=(Term(limits[0].measure),), limits=limits))
    return (
        solve_unbalances(balance).conflict
        if balance.decisions
        else violated_limits(limits, with_fine_sampling(evaluate(balance)))
    )


def solve_unbalances(problem: Problem, angles: int = 0) -> Result:
    """Find the global optimum of a problem whose decisions are unbalances.

    Parameters
    ----------
    angles
        Smallest number of samples per cycle of the first program, for example of a similar problem.

    Returns
    -------
    Result with a certificate computed from the exact model, or with the limits that contradict each other.
    """
    started = time.perf_counter()
    model = AffineModel(problem)
    # the model has already evaluated the design with all decisions at zero
    initial = evaluate(problem) if any(problem.start) else model.bare
    model_time = time.perf_counter()
    fixed, violated = _fixed_limits(problem, model)
    if violated:
        return infeasible_result(problem, initial, violated, {"model": model_time - started})
    model = model.with_limits([limit for limit in problem.limits if limit not in fixed])
    start_samples = int(angles * float(problem.engine.cycle.base_order / model.base))
    zero_level = numerical_zero(problem)
    optimum, samples = _refine(model.problem, model, zero_level, start_samples)
    solved = time.perf_counter()
    timing = {"model": model_time - started, "solve": solved - model_time}
    limits = model.problem.load_limits
    if optimum is None:
        # sample averages of means, as in the proof of infeasibility (P7)
        relaxed = model.at(samples, averaged=True)
        names = [limit.name for limit in limits]
        if not is_infeasible(relaxed):
            return failed_result(problem, initial, names, timing)
        return infeasible_result(problem, initial, smallest_conflict(relaxed, names), timing)
    values = [domain.complex_value(optimum.x) for domain in model.domains]
    cycle_samples = int(optimum.problem.samples * float(model.base / problem.engine.cycle.base_order))
    design = evaluate_design(problem, values, cycle_samples)
    if fixed and design.violation > FEASIBILITY_TOL:
        design = evaluate_design(problem, values, with_fine_sampling(design.evaluation).samples)
    initial = replace(initial, samples=design.evaluation.samples)
    timing["evaluate"] = time.perf_counter() - solved
    bound = optimum.bound
    prices, bounds = affine_prices(optimum.problem, limits, optimum.x, bound)
    unit = design.value if design.value > zero_level else zero_level / ROUNDING
    proof = ProofData(
        bound=bound.value,
        strength=ProofStrength.EXACT,
        kkt_residual=kkt_residual(optimum.problem, optimum.x, bound, unit),
        method=f"{optimum.method}, dual bound at {optimum.problem.samples}",
        prices=dict.fromkeys([(limit, "at most") for limit in fixed], Price(0.0, math.inf)) | prices,
        bounds=bounds,
    )
    return build_result(design, initial, proof, timing)


def _fixed_limits(problem: Problem, model: AffineModel) -> tuple[list[Limit], tuple[str, ...]]:
    # check limits that no decision changes directly: in a program, rounding would give them an infinite price
    fixed = [limit for limit in problem.load_limits if not model.norm(limit.measure, model.full_samples).slope.any()]
    # integer refinement of the samples
    samples = model.full_samples * max(2, math.ceil(FINE_SAMPLES / model.full_samples))
    zero = np.zeros(sum(domain.width for domain in model.domains))
    values = [(limit, model.norm(limit.measure, samples).value(zero)) for limit in fixed]
    violated = [limit.name for limit, value in values if value > limit.maximum * (1.0 + FEASIBILITY_TOL)]
    return fixed, tuple(violated[:1])


def _refine(problem: Problem, model: AffineModel, zero_level: float, start_samples: int) -> tuple[Optimum | None, int]:
    """Return the optimal unbalances with as many samples as their proof needs (P6).

    The samples are doubled until the bound on a grid twice as fine closes the gap. The optimum is None if the limits
    contradict each other. The second result is the last number of samples per period.
    """
    # with many rows, start at half the samples: the bound is computed at twice as many
    half = model.full_samples // 2
    has_many_rows = any(len(norm.grid.weights) > MANY_ROWS for _, norm in model.at(half).terms)
    first = half if model.full_samples % 2 == 0 and has_many_rows else model.full_samples
    samples, best = max(first, start_samples), None
    # a limit close to the smallest possible mean needs many samples
    maximum = max(MAX_DOUBLINGS, math.ceil(math.log2(2 * FINE_SAMPLES / samples)))
    for k in until_time_limit(range(maximum + 1)):
        optimum = allowed_optimum(problem, model, samples, zero_level)
        if optimum is None:
            if _is_feasible(problem, best):
                return best, samples
            # sample averages of means: at few samples, a mean may exceed its value over the whole cycle (P7)
            if is_infeasible(model.at(samples, averaged=True)):
                return None, samples
            # a limit close to the smallest possible value is met within the tolerance of limits
            optimum = _attempt(problem, model, samples, zero_level, FEASIBLE - FEASIBILITY_TOL)
            best = optimum if _is_feasible(problem, optimum) else best
        else:
            best = optimum
            rows = max(len(norm.grid.weights) for _, norm in best.problem.terms)
            is_close = best.gap <= problem.tolerance or not problem.search.proves or k >= MAX_DOUBLINGS
            maximum_violation = FEASIBLE if k < MAX_DOUBLINGS else FEASIBILITY_TOL
            if rows > MAX_ROWS or (is_close and best.violation <= maximum_violation and _is_feasible(problem, best)):
                break
        samples *= 2
    return best, samples


def _is_feasible(problem: Problem, optimum: Optimum | None) -> bool:
    # a mean at few samples may be smaller than over the cycle (P7)
    if optimum is None or optimum.violation > FEASIBILITY_TOL:
        return False
    if not any(limit.measure.is_load for limit in problem.load_limits):
        return True
    values = [domain.complex_value(optimum.x) for domain in optimum.problem.domains]
    return violation_at_fine_sampling(problem, evaluate(problem, problem.design(values))) <= FEASIBILITY_TOL


def allowed_optimum(problem: Problem, model: AffineModel, samples: int, zero_level: float) -> Optimum | None:
    """Return an optimum at `samples` samples that keeps its limits between samples too; None if no design does.

    A peak between samples exceeds its limit slightly. The next attempt lowers all limits by that excess.

    Parameters
    ----------
    samples
        Samples per period of the loads.
    zero_level
        Objective that counts as zero [SI].
    """
    optimum = _attempt(problem, model, samples, zero_level, 0.0)
    margin = 0.0
    for _ in until_time_limit(range(MAX_MARGINS)):
        if optimum is None or optimum.violation <= FEASIBLE:
            break
        margin += 1.05 * optimum.violation
        optimum = _attempt(problem, model, samples, zero_level, margin) or optimum
    return optimum


def _attempt(problem: Problem, model: AffineModel, samples: int, zero_level: float, margin: float) -> Optimum | None:
    coarse, fine = model.at(samples), model.at(2 * samples)
    solver, allowed = problem.search.solver, tighten_limits(coarse, margin)
    if solver:
        from laufruhe.solvers.cones.cvxpy_program import solve_by_cvxpy

        solution, method = solve_by_cvxpy(allowed, solver), f"second-order cones by {solver}"
    else:
        solution = solve_cones(allowed)
        method = "Newton's method" if solution.by_newton else "second-order cones"
    if solution.x is None:
        return None
    x = break_ties(problem, fine, solution.x)
    relaxed = model.at(fine.samples, averaged=True)
    bound = best_bound(relaxed, x, refine_multipliers(coarse, relaxed, solution.multipliers))
    has_peaks = any(measure.is_load and measure.norm.refinement > 1 for measure in problem.measures)
    peak_model = model.at(fine.samples, finer=True) if has_peaks else fine
    gap = gap_of(peak_model.objective(x), bound.value, zero_level)
    return Optimum(x, bound, fine, gap, peak_model.violation(x), f"{method} at {samples} angles")


def tighten_limits(affine: AffineProblem, margin: float) -> AffineProblem:
    """Lower all limits by the relative margin; raise them if it is negative."""
    return replace(affine, limits=tuple((maximum * (1.0 - margin), norm) for maximum, norm in affine.limits))


def is_infeasible(affine: AffineProblem) -> bool:
    """Return True if no design keeps the limits.

    This is a proof if the rows are sample averages, which never exceed the mean over the cycle (P7).
    """
    return solve_cones(replace(affine, terms=())).x is None


def smallest_conflict(affine: AffineProblem, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of a minimal set of limits that contradict each other; `names` has the name of every limit."""

    def excluded(indices: Sequence[int]) -> bool:
        return is_infeasible(replace(affine, limits=tuple(affine.limits[k] for k in indices)))

    return tuple(names[k] for k in smallest_conflicting(range(len(affine.limits)), excluded))
