"""Engines with and without each of their balancer shafts, each set of shafts at its proven optimum."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from laufruhe.files.study_models import BalancerSizingTable
from laufruhe.problem.measure import MASSES, Quantity, counted_rotors
from laufruhe.problem.problem import Problem
from laufruhe.studies.economics import shafts_of, with_shafts
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.kinds.swept import (
    check_moved_by_loads,
    checked,
    combinations,
    refuse_open_phasing,
    refused,
)
from laufruhe.studies.outcome import axes_of, coordinates, dataset, solved
from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr

MOST_GROUPS = 6


def shaft_groups(problem: Problem) -> list[tuple[str, ...]]:
    """Shafts that are built together, because one decision drives their unbalances."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in problem.engine.rotors}
    groups = [{shaft} for shaft in shafts_of(problem)]
    for decision in problem.decisions:
        driven = {shaft_of[drive.rotor] for drive in decision.drives}
        touched = [group for group in groups if group & driven]
        if len(touched) > 1:
            groups = [group for group in groups if not group & driven] + [set().union(*touched)]
    order = {shaft: k for k, shaft in enumerate(shafts_of(problem))}
    return sorted((tuple(sorted(group, key=order.__getitem__)) for group in groups), key=lambda g: order[g[0]])


def _points(part: BalancerSizingTable, scenes: Scenes) -> list[Point]:
    """For every scene all sets of its groups of shafts, the plain engine first."""
    points = []
    problems = checked(part, scenes)
    check_moved_by_loads(problems, part, scenes, "shaft")
    for case, problem in zip(part.cases, problems, strict=True):
        groups = shaft_groups(problem)
        if not groups:
            raise refused(scenes, case, "balancer_shafts", "is missing, so there is nothing to size", "add a shaft")
        refuse_open_phasing(problem, case, scenes)
        if len(groups) > MOST_GROUPS:
            rule = f"makes {len(groups)} independent shafts, {2 ** len(groups)} sets of them"
            raise refused(scenes, case, "balancer_shafts", rule, f"study {MOST_GROUPS} or fewer")
        sets = [chosen for k in range(len(groups) + 1) for chosen in itertools.combinations(groups, k)]
        for changes in combinations(part):
            points += [Point(case, changes, part.metric, tuple(itertools.chain(*chosen))) for chosen in sets]
    return points


def _answer(_part: BalancerSizingTable, point: Point, scenes: Scenes) -> dict[str, Any]:
    with scenes.blamed(point):
        problem = _counting(with_shafts(scenes.problem(point), point.shafts or ()))
        return solved(problem).as_dict()


def _counting(problem: Problem) -> Problem:
    """Terms and limits that still count something; the mass of a shaft left out is none."""

    def counted(quantity: Quantity) -> Quantity | None:
        if quantity.subject not in MASSES:
            return quantity
        names = {rotor.name for rotor in problem.engine.rotors}
        kept = None if quantity.rotors is None else tuple(name for name in quantity.rotors if name in names)
        fewer = replace(quantity, rotors=kept)
        return fewer if counted_rotors(fewer, problem.engine.rotors) else None

    terms = [(term, counted(term.quantity)) for term in problem.objective]
    limits = [(limit, counted(limit.quantity)) for limit in problem.limits]
    limits_left = tuple(replace(limit, quantity=quantity) for limit, quantity in limits if quantity is not None)
    terms_left = tuple(replace(term, quantity=quantity) for term, quantity in terms if quantity is not None)
    if problem.objective and not terms_left and not problem.mount_design.terms:
        # the mass of no shafts is zero, whatever else is open
        return replace(problem, limits=limits_left, decisions=())
    return replace(problem, objective=terms_left, limits=limits_left)


def _dataset(part: BalancerSizingTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    extra = coordinates(axes_of(part), points)
    extra["shafts"] = ("point", [" + ".join(point.shafts or ()) or "none" for point in points])
    return dataset(part, points, records, extra)


KIND = Kind(_points, _answer, _dataset)
