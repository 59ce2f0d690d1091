"""Lower bounds of designs on open mounts, and proofs that limits contradict each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time, passed
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import NEARLY, Divided
from laufruhe.prove.certificate import Reach, certified, room_of
from laufruhe.prove.mounts.provers import Question, proven
from laufruhe.prove.mounts.subdivision import divided_bounds, divides
from laufruhe.solvers.conclusion import KEPT, Design, known_of, values_of
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.mounts.search import MountSearch
from laufruhe.solvers.result import Result
from laufruhe.solvers.told_limits import over_read

MOST_DIVISIONS = 3
# share of the boxes of a problem that each set of limits may use up
FEW = 0.1


def mount_numbers(design: Design) -> Array:
    """Return the open numbers of the mounts of a design."""
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])


def divided_by(problem: Problem, search: MountSearch, among: bool) -> Divided:
    """Return what provers tell of a search; where stiffness alone is open, search on where their boxes are least.

    Parameters
    ----------
    among
        Whether the problem is one of several; those in which more than stiffness is open are then left to
        `bounded_under`.
    """
    divided = Divided(0.0, 0)
    if search.moves is not None or not problem.search.proves or (among and not divides(problem)):
        return divided
    for _ in in_time(range(MOST_DIVISIONS)):
        found = search.chosen
        met = found is not None and found.design.excess <= KEPT
        # of what few angles read too much no box can take anything
        value = found.design.value - over_read(problem, found.design.evaluation) if found and met else math.inf
        room = room_of(
            value, problem.tolerance, numerical_zero(problem, found.design.evaluation.engine if found else None)
        )
        near = found.design.values if found is not None else ()
        known = None if found is None or not met else known_of(found.design, mount_numbers(found.design))
        question, count = Question(problem, value, room, near, known), len(problem.mount_decisions)
        divided = proven(question)
        places = [(place[:count].tolist(), place[count:] if len(place) > count else None) for place in divided.places]
        if not places or passed() or not search.again(places):
            break
        # what is shown of a value is so of one that differs from it by less than counts
        if search.best is not None and search.best.design.value > question.value - room:
            break
    return divided


def bounded_under(result: Result, value: float, enough: float = math.inf, of_many: bool = False) -> Result:
    """Return a result with what provers tell of its mounts, designs over a value known from elsewhere left out.

    No more is proven than is enough, and of the first of many what is worth proving of them all.
    """
    problem, certificate = result.problem, result.certificate
    if certificate is None or result.objective is None or divides(problem) or problem.phasing is not None:
        return result
    nothing = numerical_zero(problem, result.final.engine)
    room = max(room_of(value, problem.tolerance, nothing), (value - min(enough, value)) / NEARLY)
    question = Question(problem, value, room, values_of(problem, result), of_many=of_many)
    found = proven(question)
    if found.bound <= certificate.lower_bound:
        return result
    text = f"{certificate.method}; bounds of mounts looked at in {found.boxes} box{'es' if found.boxes > 1 else ''}"
    told = certified(
        result.objective.value, found.bound, nothing, problem.tolerance, Reach.NEAR, certificate.kkt_residual, text
    )
    return replace(result, certificate=told)


def excludes(problem: Problem, limits: Sequence[Limit]) -> bool:
    """Return whether a share of the boxes of a problem that `divides` proves that no stiffness keeps some limits."""
    alone = replace(problem, objective=(), limits=tuple(limits))
    return bool(limits) and any(found.bound == math.inf for found in divided_bounds(alone, math.inf, 0.0, (FEW,)))


def conflict_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of limits that contradict each other, without those that boxes prove to be needless for that.

    Parameters
    ----------
    problem
        That `divides`, proven to have no design that keeps all limits.
    """
    return smallest_conflict(problem.limits, lambda limits: excludes(problem, limits))
