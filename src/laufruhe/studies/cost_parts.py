"""Datasets of a study's parts on what balancing costs: from tables of the study file to engines."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.errors import Complaint, InputError, ModelError
from laufruhe.problem.complaints import nearest
from laufruhe.problem.model import Problem
from laufruhe.problem.study_costs import (
    PLAIN,
    BuildTable,
    EconomicsPart,
    FreeForcesPart,
    TolerancePart,
)
from laufruhe.problem.study_models import CaseTable
from laufruhe.problem.study_reader import scene
from laufruhe.studies.economics import Build, Claim, Standing, fronts, shafts_of, with_shafts
from laufruhe.studies.equal_power import at_equal_power, check_comparable
from laufruhe.studies.free_forces import free_forces
from laufruhe.studies.tolerance import Tolerances, tolerance_study

if TYPE_CHECKING:
    import xarray as xr

Say = Callable[[int, int], None]


def economics(part: EconomicsPart, folder: Path, say: Say) -> xr.Dataset:
    """Fronts of every build, the plain engine and those with more cylinders as level lines."""
    whole = _engine(part, PLAIN, part.problem, folder)
    if not shafts_of(whole):
        raise _refused(
            folder / part.problem, "balancer_shafts", "", "is missing, so no shafts can be weighed", "add them"
        )
    plain = with_shafts(whole, ())
    builds = [Build(PLAIN, plain, Standing.PLAIN)]
    builds += [_build(part, build, whole, folder) for build in part.builds]
    builds += [_more_cylinders(part, case, plain, folder) for case in part.more_cylinders]
    return fronts(builds, part.mass_limits, say)


def _engine(part: EconomicsPart, name: str, problem: str, folder: Path) -> Problem:
    case = CaseTable(name=name, problem=problem, set=part.set, without=part.without)
    return scene(case, {}, folder)


def _build(part: EconomicsPart, table: BuildTable, whole: Problem, folder: Path) -> Build:
    own = whole if table.problem is None else _engine(part, table.name, table.problem, folder)
    for shaft in table.shafts:
        if shaft not in shafts_of(own):
            path = folder / (table.problem or part.problem)
            raise _refused(path, "balancer_shafts", shaft, "is no shaft of this engine", nearest(shaft, shafts_of(own)))
    said = table.claim
    claim = Claim() if said is None else Claim(said.says or "", said.falls_by or math.nan, said.against, said.where)
    return Build(table.name, with_shafts(own, table.shafts), Standing.SHAFTS, claim)


def _more_cylinders(part: EconomicsPart, case: CaseTable, plain: Problem, folder: Path) -> Build:
    given = scene(case.model_copy(update={"set": {**part.set, **case.set}}), {}, folder)
    path = folder / case.problem
    if shafts_of(given):
        rule = "has balancer shafts, and the engine with more cylinders is compared without"
        raise _refused(path, "balancer_shafts", case.name, rule, 'add without = ["balancer_shafts"]')
    cylinders = len(plain.engine.slider_cranks)
    if len(given.engine.slider_cranks) <= cylinders:
        rule = f"has no more cylinders than the {cylinders} that it is compared with"
        raise _refused(path, "engine", case.name, rule, "name an engine with more")
    try:
        check_comparable(given, plain)
        return Build(case.name, at_equal_power(given, cylinders), Standing.NEXT)
    except ModelError as error:
        rule, _, remedy = str(error).partition("; ")
        raise _refused(path, "more_cylinders", case.name, rule, remedy) from None


def tolerance(part: TolerancePart, folder: Path, say: Say) -> xr.Dataset:
    """What tolerances add to the free force of every case."""
    given = part.tolerances
    tolerances = Tolerances(
        given.reciprocating_mass, given.unbalance, given.planes, given.alignment, tuple(given.aligned_masses)
    )
    problems = {case.name: scene(case, {}, folder) for case in part.cases}
    data = tolerance_study(problems, tolerances, part.engines, part.seed, say)
    return data.assign_coords(
        claim=("case", [case.claim or "" for case in part.cases]),
        mark=("mark", [mark.name for mark in part.marks]),
        mark_force=("mark", [mark.force for mark in part.marks], {"units": "N"}),
    )


def layouts(part: FreeForcesPart, folder: Path, say: Say) -> xr.Dataset:
    """Free forces and couples of every case beside what tables print."""
    engines = {case.name: (scene(case, {}, folder).engine, part.spacing) for case in part.cases}
    printed = {
        case.name: {k.replace("_", " "): v for k, v in case.literature.model_dump(exclude_none=True).items()}
        for case in part.cases
    }
    return free_forces(engines, printed, say).assign_attrs(digits=part.digits)


def _refused(path: Path, where: str, value: str, rule: str, remedy: str) -> InputError:
    return InputError(str(path), (Complaint(where, value, rule, remedy),))
