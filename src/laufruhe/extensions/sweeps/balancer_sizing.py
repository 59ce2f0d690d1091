"""Study kind `balancer sizing`: engines with every subset of their balancer shafts, each at its proven optimum."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from laufruhe.extensions.sweeps.swept import SweptPart
from laufruhe.extensions.sweeps.swept_report import bars, by_point, over_sweep, swept_names
from laufruhe.files.study_tables import MAX_POINTS
from laufruhe.present.picture import Picture
from laufruhe.problem.measure import Measure, counted_rotors
from laufruhe.problem.problem import Problem
from laufruhe.studies.part import Record
from laufruhe.studies.scenes import Point, ProblemFiles, shafts_of
from laufruhe.studies.solved import solve_scene
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr

MAX_GROUPS = 6


def shaft_groups(problem: Problem) -> list[tuple[str, ...]]:
    """Return the balancer shafts in groups: shafts with a common decision are built together."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in problem.engine.rotors}
    groups = [{shaft} for shaft in shafts_of(problem)]
    for decision in problem.decisions:
        driven = {shaft_of[drive.rotor] for drive in decision.rotor_drives}
        touched = [group for group in groups if group & driven]
        if len(touched) > 1:
            groups = [group for group in groups if not group & driven] + [set().union(*touched)]
    order = {shaft: k for k, shaft in enumerate(shafts_of(problem))}
    return sorted((tuple(sorted(group, key=order.__getitem__)) for group in groups), key=lambda g: order[g[0]])


class BalancerSizing(SweptPart):
    """Engines with and without each of their balancer shafts, every set at its proven optimum."""

    kind: Literal["balancer sizing"]

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points of every case: one for each set of its groups of shafts, without shafts first."""
        points = []
        problems = self.checked(problem_files)
        self.check_moved_by_loads(problems, problem_files, "shaft")
        for case, problem in zip(self.cases, problems, strict=True):
            groups = shaft_groups(problem)
            if not groups:
                raise problem_files.refused(
                    case, "balancer_shafts", "is missing, so the study has no balancer shaft to size", "add a shaft"
                )
            problem_files.refuse_open_phasing(problem, case)
            if len(groups) > MAX_GROUPS:
                rule = f"makes {len(groups)} independent shafts, {2 ** len(groups)} sets of them"
                raise problem_files.refused(case, "balancer_shafts", rule, f"use at most {MAX_GROUPS} groups of shafts")
            count = 2 ** len(groups) * self.size()
            if count > MAX_POINTS:
                rule = f"makes {count} points; a study takes {MAX_POINTS}"
                raise problem_files.refused(case, "balancer_shafts", rule, "ask for fewer")
            sets = [chosen for k in range(len(groups) + 1) for chosen in itertools.combinations(groups, k)]
            for changes in self.combinations():
                points += [Point(case, changes, self.metric, tuple(itertools.chain(*chosen))) for chosen in sets]
        return points

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of one set of shafts at its proven optimum."""
        return solve_scene(_counting(problem_files.problem(point)))

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the dataset of a sweep with the shafts of every point."""
        sets = [" + ".join(point.shafts or ()) or "none" for point in points]
        return super().dataset(points, records).assign_coords(shafts=("point", sets))

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a row per point, with its shafts."""
        return by_point(data, "shafts")

    @staticmethod
    def picture(data: xr.Dataset) -> Picture:
        """Return a bar chart of every set of shafts, the engine without shafts once; lines if a number is swept."""
        words = "Every set of shafts at its own optimum."
        if swept_names(data):
            return over_sweep(data, ["shafts"], words)
        plain = data["shafts"].values == "none"
        # cases that differ only in their shafts share the plain engine
        shared = bool(np.ptp(data["objective"].values[plain]) == 0.0)
        if shared:
            data = data.isel(point=np.concatenate([np.flatnonzero(plain)[:1], np.flatnonzero(~plain)]))
        has_one_case = len(set(data["case"].values.tolist())) == 1
        labels = [
            _wrapped(shafts) if has_one_case or (shared and shafts == "none") else f"{case}\n{_wrapped(shafts)}"
            for case, shafts in zip(data["case"].values.tolist(), data["shafts"].values.tolist(), strict=True)
        ]
        return bars(data, labels, words, data["shafts"].values == "none")


def _counting(problem: Problem) -> Problem:
    """Return the problem without objective terms and limits on the masses of shafts that are not built."""

    def counted(quantity: Measure) -> Measure | None:
        if not quantity.is_mass:
            return quantity
        names = {rotor.name for rotor in problem.engine.rotors}
        remaining = None if quantity.rotors is None else tuple(name for name in quantity.rotors if name in names)
        narrowed = replace(quantity, rotors=remaining)
        return narrowed if counted_rotors(narrowed, problem.engine.rotors) else None

    terms = [(term, counted(term.measure)) for term in problem.objective]
    limits = [(limit, counted(limit.measure)) for limit in problem.limits]
    limits_left = tuple(replace(limit, measure=quantity) for limit, quantity in limits if quantity is not None)
    terms_left = tuple(replace(term, measure=quantity) for term, quantity in terms if quantity is not None)
    if problem.objective and not terms_left:
        # the mass of no shafts is zero, whatever else is open
        return replace(problem, limits=limits_left, decisions=())
    return replace(problem, objective=terms_left, limits=limits_left)


def _wrapped(shafts: str) -> str:
    names = shafts.split(" + ")
    lines = [" + ".join(names[k : k + 2]) for k in range(0, len(names), 2)]
    return "no shafts" if shafts == "none" else "\n".join(lines)
