"""Lower bounds of designs on open mounts, and proofs that limits contradict each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, until_time_limit
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import GAP_SAFETY, BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of, make_certificate
from laufruhe.prove.mounts.provers import Question, proven
from laufruhe.prove.mounts.subdivision import divided_bounds, divides
from laufruhe.solvers.conclusion import KEPT, Design, known_of, values_of
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.mounts.search import MountSearch
from laufruhe.solvers.result import Result
from laufruhe.solvers.sampling_refinement import over_read

MOST_DIVISIONS = 3
# share of the boxes of a problem that each set of limits may use up
FEW = 0.1


def mount_numbers(design: Design) -> Array:
    """Return the open numbers of the mounts of a design."""
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])


def divided_by(problem: Problem, search: MountSearch, among: bool) -> BoxResult:
    """Bound the result of a search by all provers; continue the search where their bounds are least.

    Parameters
    ----------
    among
        Whether the problem is one of several. Those with more than stiffness open then wait for `bounded_under`.
    """
    divided = BoxResult(0.0, 0)
    if search.moves is not None or not problem.search.proves or (among and not divides(problem)):
        return divided
    for _ in until_time_limit(range(MOST_DIVISIONS)):
        design = search.chosen.design if search.chosen is not None else None
        value, known = math.inf, None
        if design is not None and design.violation <= KEPT:
            # boxes cannot bound what few samples overestimate
            value = design.value - over_read(problem, design.evaluation)
            known = known_of(design, mount_numbers(design))
        room = gap_tolerance_of(
            value, problem.tolerance, numerical_zero(problem, design.evaluation.engine if design else None)
        )
        near = design.values if design is not None else ()
        question, count = Question(problem, value, room, near, known), len(problem.mount_decisions)
        divided = proven(question)
        places = [(place[:count].tolist(), place[count:] if len(place) > count else None) for place in divided.places]
        if not places or is_time_over() or not search.again(places):
            break
        # the bound also serves a value that differs by less than the gap tolerance
        if search.best is not None and search.best.design.value > question.value - room:
            break
    return divided


def bounded_under(result: Result, value: float, cutoff: float = math.inf, of_many: bool = False) -> Result:
    """Return a result with a lower bound by all provers of its mounts.

    Parameters
    ----------
    value
        Objective of a design known from elsewhere; the bound need not be higher [SI].
    cutoff
        Bound at which the proof stops [SI].
    of_many
        Whether many results are bounded, so that cheap bounds come first.
    """
    problem, certificate = result.problem, result.certificate
    if certificate is None or result.objective is None or divides(problem) or problem.phasing is not None:
        return result
    zero_level = numerical_zero(problem, result.final.engine)
    room = max(gap_tolerance_of(value, problem.tolerance, zero_level), (value - min(cutoff, value)) / GAP_SAFETY)
    question = Question(problem, value, room, values_of(problem, result), of_many=of_many)
    divided = proven(question)
    if divided.bound <= certificate.lower_bound:
        return result
    text = f"{certificate.method}; bounds of mounts looked at in {divided.boxes} box{'es' if divided.boxes > 1 else ''}"
    certificate = make_certificate(
        result.objective.value,
        divided.bound,
        zero_level,
        problem.tolerance,
        ProofStrength.PARTIAL,
        certificate.kkt_residual,
        text,
    )
    return replace(result, certificate=certificate)


def excludes(problem: Problem, limits: Sequence[Limit]) -> bool:
    """Return whether boxes prove that no stiffness keeps some limits of a problem that `divides`."""
    alone = replace(problem, objective=(), limits=tuple(limits))
    return bool(limits) and any(divided.bound == math.inf for divided in divided_bounds(alone, math.inf, 0.0, (FEW,)))


def conflict_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of limits that contradict each other, without those that boxes prove to be needless for that.

    Parameters
    ----------
    problem
        That `divides`, proven to have no design that keeps all limits.
    """
    return smallest_conflict(problem.limits, lambda limits: excludes(problem, limits))
