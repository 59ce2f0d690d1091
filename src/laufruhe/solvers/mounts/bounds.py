"""What boxes prove of designs that a search of mounts has found (E37-E45, E52-E54, E68, E69)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.run_look import asks_runs
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import at_least, in_time, passed
from laufruhe.problem.decision import domains_of, vector_of
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import NEARLY, Divided
from laufruhe.prove.certificate import Reach, certified, room_of
from laufruhe.prove.mounts.design_boxes import DesignBoxes, designed_bound, mixes_corners
from laufruhe.prove.mounts.load_boxes import load_bound
from laufruhe.prove.mounts.subdivision import divided_bound, divided_bounds, divides
from laufruhe.prove.springs.proof import spring_bound
from laufruhe.prove.witness import Known
from laufruhe.solvers.conclusion import KEPT, Design, known_of, values_of
from laufruhe.solvers.mounts.corners import best_at
from laufruhe.solvers.mounts.places import started_at
from laufruhe.solvers.mounts.search import MountSearch
from laufruhe.solvers.result import Result
from laufruhe.solvers.told_limits import over_read

MOST_DIVISIONS = 3
# share of the expansions that are worth it which are tried first
EARLY = 0.2
# seconds that a first bound has where time is over
LEAST_SECONDS = 0.5


def mount_numbers(design: Design) -> Array:
    """Return the open numbers of the mounts of a design."""
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])


def divided_by(problem: Problem, search: MountSearch, among: bool) -> Divided:
    """A bound by boxes of mounts; where stiffness alone is open, searches from where they are least as well.

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
        room = room_of(value, problem.tolerance, nothing_of(problem, found.design.evaluation.engine if found else None))
        near = found.design.values if found is not None else ()
        known = None if found is None or not met else known_of(found.design, mount_numbers(found.design))
        if found is not None and met and len(problem.decisions) == 1 and not divides(problem):
            # boxes of one number are few, and need no multipliers
            alone = _by_loads(problem, value, room, Divided(0.0, 0), near, known)
            if alone.bound >= value - room:
                return alone
        if found is not None and met and mixes_corners(problem) and not divides(problem):
            return _by_corners(problem, search, value, room, near, known)
        divided = _by_boxes(problem, value, room, near, known)
        places = [(place.tolist(), None) for place in divided.places]
        if not places or passed() or not divides(problem) or not search.again(places):
            break
        # what is shown of a value is so of one that differs from it by less than counts
        if search.best is not None and search.best.design.value > value - room:
            break
    return divided


def _by_corners(
    problem: Problem, search: MountSearch, value: float, room: float, near: Sequence[Value], known: Known | None
) -> Divided:  # fmt: skip
    """By multipliers of corners, which meet better designs on their way; else by the forces of springs."""

    def judge(mounts: Array, columns: Array) -> float:
        design = started_at(problem, (mounts.tolist(), columns))
        if design is None or design.excess > 0.0:
            return math.inf
        return design.value - over_read(problem, design.evaluation)

    boxes = DesignBoxes(problem, value, best_at, judge)
    with at_least(LEAST_SECONDS):
        found = designed_bound(boxes, room, known)
    if boxes.best is not None:
        mounts, columns = boxes.best
        search.again([(mounts.tolist(), columns)])
    if passed() or found.bound >= boxes.value - room:
        return found
    few = spring_bound(problem, value, room, near, known=known)
    told = Divided(max(few.bound, found.bound), few.boxes + found.boxes)
    return _by_loads(problem, value, room, told, near, known)


def _by_loads(
    problem: Problem, value: float, room: float, told: Divided, near: Sequence[Value], known: Known | None
) -> Divided:  # fmt: skip
    """Return what boxes of mounts and unbalances add to what is told."""
    if passed() or told.bound >= value - room:
        return told
    place = np.zeros(0)
    if known is not None:
        own = [value for value, decision in zip(near, problem.decisions, strict=True) if decision.is_affine]
        place = np.append(known.place, vector_of(domains_of(problem.unbalances), own))
    more = load_bound(problem, value, room, told.bound, None if known is None else replace(known, place=place))
    return Divided(max(more.bound, told.bound), more.boxes + told.boxes, told.places)


def _by_boxes(problem: Problem, value: float, room: float, near: Sequence[Value], known: Known | None) -> Divided:
    """By the forces of springs, a few boxes of which close many stiffnesses; by expansions what these leave open.

    Expansions need more boxes of less time: some are tried once the springs of all that is open do not close it. Of
    run-ups they alone tell anything, and springs have told what they know without these.
    """
    if asks_runs(problem):
        of_runs = divided_bound(problem, value, room, known)
        if of_runs.boxes or passed():
            return of_runs
    alone = divides(problem)
    with at_least(LEAST_SECONDS):
        few = spring_bound(problem, value, room, near, whole=alone, known=known)
    if not alone:
        return _by_loads(problem, value, room, few, near, known)
    if passed() or (few.boxes and few.bound >= value - room):
        return few
    expanded = divided_bounds(problem, value, room, (EARLY, 1.0), known)
    many = next(expanded)
    if few.boxes and many.bound < value - room and not passed():
        few = spring_bound(problem, value, room, near, known=known)
        if few.bound >= value - room:
            return few
    if many.bound < value - room and not passed():
        many = next(expanded)
    return Divided(max(few.bound, many.bound), few.boxes + many.boxes, many.places or few.places)


def bounded_under(result: Result, value: float, enough: float = math.inf, of_many: bool = False) -> Result:
    """A result with what boxes prove of its mounts, designs worse than a value known from elsewhere left out.

    No more is proven than is enough, and of the first of many what is worth proving of them all.
    """
    problem, certificate = result.problem, result.certificate
    if certificate is None or result.objective is None or divides(problem) or problem.phasing is not None:
        return result
    nothing = nothing_of(problem, result.final.engine)
    room = max(room_of(value, problem.tolerance, nothing), (value - min(enough, value)) / NEARLY)
    found = spring_bound(problem, value, room, values_of(problem, result), of_many)
    if found.bound <= certificate.lower_bound:
        return result
    text = f"{certificate.method}; bounds of mounts looked at in {found.boxes} box{'es' if found.boxes > 1 else ''}"
    told = certified(
        result.objective.value, found.bound, nothing, problem.tolerance, Reach.NEAR, certificate.kkt_residual, text
    )
    return replace(result, certificate=told)
