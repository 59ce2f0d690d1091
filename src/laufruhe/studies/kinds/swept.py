"""What the kinds that sweep have in common: every case at every combination, each solved."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from laufruhe.errors import Complaint, InputError
from laufruhe.files.study_parts import CaseTable, SweptPartTable
from laufruhe.problem.mount_design import MountMeasure
from laufruhe.problem.problem import Problem
from laufruhe.studies.outcome import axes_of, solved
from laufruhe.studies.scenes import Point, Scenes


def combinations(part: SweptPartTable, without: str | None = None) -> list[dict[str, Any]]:
    """Every combination of the swept values, the last sweep fastest; one empty one without sweeps."""
    axes = [axis for axis in axes_of(part) if axis.quantity != without]
    grids = [[(axis.quantity, value) for value in axis.values] for axis in axes]
    return [dict(grid) for grid in itertools.product(*grids)]


def answer(_part: SweptPartTable, point: Point, scenes: Scenes) -> dict[str, Any]:
    """The proven optimum of one scene, or its numbers as given where nothing is open."""
    problem = scenes.problem(point)
    with scenes.blamed(point):
        return solved(problem).as_dict()


def checked(part: SweptPartTable, scenes: Scenes) -> list[Problem]:
    """The first scene of every case, after the ends of every sweep were tried on each.

    Raises
    ------
    InputError
        If a scene cannot be made, or the cases' metrics are of different dimensions.
    """
    axes = axes_of(part)
    found = []
    for case in part.cases:
        first = {axis.quantity: axis.values[0] for axis in axes}
        found.append(scenes.problem(Point(case, first, part.metric)))
        for axis in axes:
            scenes.problem(Point(case, {**first, axis.quantity: axis.values[-1]}, part.metric))
        _check_asked(found[-1], case, scenes)
    units = {problem.objective_unit: case for problem, case in zip(found, part.cases, strict=True)}
    if len(units) > 1:
        (one, first_case), (two, second_case) = list(units.items())[:2]
        said = [unit or "several units together" for unit in (one, two)]
        rule = f"minimises in {said[0]} in '{first_case.name}' and in {said[1]} in '{second_case.name}'"
        raise refused(scenes, part.cases[0], "objective", rule, "give the part one metric")
    return found


def _check_asked(problem: Problem, case: CaseTable, scenes: Scenes) -> None:
    if problem.objective_unit is None:
        raise refused(scenes, case, "objective", "is missing, so a study has nothing to compare", "give a metric")


def refuse_open_phasing(problem: Problem, case: CaseTable, scenes: Scenes) -> None:
    """Of sets of shafts: an open star has a choice of its own.

    Raises
    ------
    InputError
        If something of the phasing is open.
    """
    if problem.phasing is not None:
        rule, remedy = "is open, and decides on shafts by itself", "use laufruhe solve, or fix it"
        raise refused(scenes, case, "phasing", rule, remedy)


def check_moved_by_loads(problems: Sequence[Problem], part: SweptPartTable, scenes: Scenes, what: str) -> None:
    """Whether balancing can change what is minimised: the sag of a block, or the stiffness under it, knows no loads.

    Raises
    ------
    InputError
        If loads neither make up an objective nor are limited beside it.
    """
    for case, problem in zip(part.cases, problems, strict=True):
        design = problem.mount_design
        asked = [quantity for quantity, _ in design.terms] + [limit.quantity for limit in design.limits]
        transmitted = any(quantity.measure is MountMeasure.TRANSMISSIBILITY for quantity in asked)
        if not (problem.objective or problem.limits or transmitted):
            rule = f"is {problem.objective_name}, which no {what} changes"
            raise refused(scenes, case, "objective", rule, "minimise a mount force or transmissibility")


def refused(scenes: Scenes, case: CaseTable, where: str, rule: str, remedy: str) -> InputError:
    """One line about the scene of a case."""
    return InputError(str(scenes.folder / case.problem), (Complaint(where, "", rule, remedy),))
