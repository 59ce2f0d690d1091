"""Compute lower bounds of designs on open mounts, and prove that limits contradict each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.errors import counted
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, until_time_limit
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import GAP_SAFETY, BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of, make_certificate
from laufruhe.prove.mounts.provers import Question, run_provers
from laufruhe.prove.mounts.subdivision import is_stiffness_problem, stiffness_bounds
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, Design, smallest_conflict, values_of, witness_of
from laufruhe.solvers.mounts.search import MountSearch
from laufruhe.solvers.result import Result
from laufruhe.solvers.sampling_refinement import sampling_overestimate

# largest number of bounds by all provers, with searches from their lowest boxes in between
MAX_DIVISIONS = 3
# share of the problem's largest number of boxes for a test of one set of limits
CONFLICT_SHARE = 0.1


def mount_numbers(design: Design) -> Array:
    """Return the open numbers of the mounts of a design [SI], shape (n,)."""
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])


def bound_search(problem: Problem, search: MountSearch, defer_bounds: bool) -> BoxResult:
    """Return the lower bound of a mount search by all provers, which also tell where to search on.

    The search continues where the bounds are lowest. Bounds are left to `with_mount_bounds` if `defer_bounds` is True,
    unless only stiffness is open.
    """
    division = BoxResult(0.0, 0)
    if search.moves is not None or not problem.search.proves or (defer_bounds and not is_stiffness_problem(problem)):
        return division
    for _ in until_time_limit(range(MAX_DIVISIONS)):
        design = search.best_or_initial.design if search.best_or_initial is not None else None
        value, witness = math.inf, None
        if design is not None and design.violation <= FEASIBILITY_TOL:
            # bounds exclude errors of coarse sampling
            value = design.value - sampling_overestimate(problem, design.evaluation)
            witness = witness_of(design, mount_numbers(design))
        gap_tolerance = gap_tolerance_of(
            value, problem.tolerance, numerical_zero(problem, design.evaluation.engine if design else None)
        )
        values = design.values if design is not None else ()
        question, count = Question(problem, value, gap_tolerance, values, witness), len(problem.mount_decisions)
        division = run_provers(question)
        starts = [(start[:count].tolist(), start[count:] if len(start) > count else None) for start in division.places]
        if not starts or is_time_over() or not search.search_from(starts):
            break
        # after a small improvement, the bound still closes the gap
        if search.best is not None and search.best.design.value > question.value - gap_tolerance:
            break
    return division


def with_mount_bounds(result: Result, value: float, cutoff: float = math.inf, in_batch: bool = False) -> Result:
    """Return a result with a better lower bound, by all provers of its open mounts.

    Parameters
    ----------
    value
        Objective of the best design of all crank stars, which the bound need not exceed [SI].
    cutoff
        Lower bound at which the proof stops [SI].
    in_batch
        True if many results are bounded, so that cheap bounds come first.
    """
    problem, certificate = result.problem, result.certificate
    if certificate is None or result.objective is None or is_stiffness_problem(problem) or problem.phasing is not None:
        return result
    zero_level = numerical_zero(problem, result.final.engine)
    gap_tolerance = max(
        gap_tolerance_of(value, problem.tolerance, zero_level), (value - min(cutoff, value)) / GAP_SAFETY
    )
    question = Question(problem, value, gap_tolerance, values_of(problem, result), in_batch=in_batch)
    division = run_provers(question)
    if division.bound <= certificate.lower_bound:
        return result
    text = f"{certificate.method}; bounds of mounts from {counted(division.boxes, 'box')}"
    value, residual = result.objective.value, certificate.kkt_residual
    strength = ProofStrength.PARTIAL
    certificate = make_certificate(value, division.bound, zero_level, problem.tolerance, strength, residual, text)
    return replace(result, certificate=certificate)


def are_contradictory(problem: Problem, limits: Sequence[Limit]) -> bool:
    """Return True if boxes prove that these limits of an `is_stiffness_problem` contradict each other."""
    without_terms = replace(problem, objective=(), limits=tuple(limits))
    divisions = stiffness_bounds(without_terms, math.inf, 0.0, (CONFLICT_SHARE,))
    return bool(limits) and any(division.bound == math.inf for division in divisions)


def minimal_conflict(problem: Problem) -> tuple[str, ...]:
    """Return the names of a minimal set of contradicting limits of an infeasible `is_stiffness_problem`."""
    return smallest_conflict(problem.limits, lambda limits: are_contradictory(problem, limits))
