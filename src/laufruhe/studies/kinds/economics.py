"""Which shafts are worth building: fronts of mass against force, and engines with more cylinders at equal power."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from laufruhe.errors import ModelError, SolverError
from laufruhe.files.complaints import nearest
from laufruhe.files.study_costs import PLAIN, BuildTable, EconomicsTable
from laufruhe.files.study_parts import CaseTable
from laufruhe.problem.problem import Problem
from laufruhe.studies.economics import (
    Build,
    Claim,
    Front,
    FrontPoint,
    Standing,
    compared,
    front,
    shafts_of,
    with_shafts,
)
from laufruhe.studies.equal_power import check_comparable
from laufruhe.studies.kinds.kind import Kind
from laufruhe.studies.kinds.swept import refuse_open_phasing, refused
from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr


def _points(part: EconomicsTable, scenes: Scenes) -> list[Point]:
    """The plain engine, every build, and every engine with more cylinders rebuilt at equal power."""
    base = part.cases[0]
    whole = scenes.problem(Point(base))
    if not shafts_of(whole):
        raise refused(scenes, base, "balancer_shafts", "is missing, so no shafts can be weighed", "add them")
    points = [Point(base, shafts=())]
    points += [_build(part, build, scenes) for build in part.builds]
    points += [_more_cylinders(case, whole, scenes) for case in part.more_cylinders]
    _check_objectives(points, scenes)
    return points


def _build(part: EconomicsTable, build: BuildTable, scenes: Scenes) -> Point:
    case = next((case for case in part.cases if case.name == build.case), part.cases[0])
    own = shafts_of(scenes.problem(Point(case)))
    for shaft in build.shafts:
        if shaft not in own:
            rule = f"has no shaft '{shaft}', which '{build.name}' builds"
            raise refused(scenes, case, "balancer_shafts", rule, nearest(shaft, own))
    return Point(case, shafts=tuple(build.shafts))


def _more_cylinders(case: CaseTable, whole: Problem, scenes: Scenes) -> Point:
    given = scenes.problem(Point(case))
    cylinders = len(whole.engine.slider_cranks)
    if shafts_of(given):
        rule = f"is there, and '{case.name}' is compared without"
        raise refused(scenes, case, "balancer_shafts", rule, 'add without = ["balancer_shafts"] to its case')
    if len(given.engine.slider_cranks) <= cylinders:
        rule = f"has no more cylinders in '{case.name}' than the {cylinders} that it is compared with"
        raise refused(scenes, case, "engine", rule, "name an engine with more")
    with scenes.blamed(Point(case), "more_cylinders"):
        check_comparable(given, whole)
    return Point(case.model_copy(update={"equal_power_to": cylinders}), shafts=())


def _check_objectives(points: Sequence[Point], scenes: Scenes) -> None:
    asked: dict[str, Point] = {}
    for point in points:
        problem = scenes.problem(point)
        refuse_open_phasing(problem, point.case, scenes)
        objective = tuple(problem.objective)
        if not objective:
            rule = f"is {problem.objective_name}, which is no load" if problem.objective_name else "is missing"
            remedy = "minimise a load, such as mean mount force"
            raise refused(scenes, point.case, "objective", f"{rule}, so shafts have nothing to lower", remedy)
        asked.setdefault(str(objective), point)
    if len(asked) > 1:
        first, second = list(asked.values())[:2]
        rule = f"differs between '{first.case.name}' and '{second.case.name}'"
        raise refused(scenes, second.case, "objective", rule, "give all engines the same")


def _answer(part: EconomicsTable, point: Point, scenes: Scenes) -> dict[str, Any]:
    with scenes.blamed(point):
        try:
            return asdict(front(with_shafts(scenes.problem(point), point.shafts or ()), part.mass_limits))
        except SolverError as error:
            raise ModelError(f"{error}; leave more to its decisions, or name larger mass limits") from None


def _dataset(part: EconomicsTable, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:  # noqa: ARG001
    builds = [Build(PLAIN, Standing.PLAIN)]
    builds += [Build(build.name, Standing.SHAFTS, _claim(build)) for build in part.builds]
    builds += [Build(case.name, Standing.NEXT) for case in part.more_cylinders]
    found = compared(builds, [_front(record) for record in records])
    return found.assign_attrs(title=part.title, source=part.source)


def _claim(build: BuildTable) -> Claim:
    said = build.claim
    return Claim() if said is None else Claim(said.says or "", said.falls_by or math.nan, said.against, said.where)


def _front(record: Mapping[str, Any]) -> Front:
    points = tuple(FrontPoint(**point) for point in record["points"])
    return Front(**{**record, "points": points, "optimum": FrontPoint(**record["optimum"])})


KIND = Kind(_points, _answer, _dataset)
