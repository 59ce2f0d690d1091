"""Problem files of a study: read once, changed for each point, and identified by a hash of all inputs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from laufruhe.errors import Complaint, InputError, ModelError, refused
from laufruhe.files.complaints import Refused, errors_in_file, nearest, nearest_file
from laufruhe.files.nested import texts_in
from laufruhe.files.phasing import without_shafts
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.files.study_tables import CaseTable, changed, without
from laufruhe.machine import Role
from laufruhe.numerics.libraries import library_versions
from laufruhe.problem.problem import Problem
from laufruhe.studies.equal_power import at_equal_power

if TYPE_CHECKING:
    from collections.abc import Iterator

DISPLAY = {"report", "plots", "cli"}
"""Folders of the package that only show answers, so that their code does not enter the fingerprint."""


@dataclass(frozen=True)
class Point:
    """Point of a study: a problem file, changed values by their paths, and a metric in place of its objective.

    `shafts` names the balancer shafts that remain, all if None. `base` replaces the tables of the
    case's problem file. `span` is the range of draws, first number and end.
    """

    case: CaseTable
    changes: Mapping[str, Any] = field(default_factory=dict)
    metric: str | None = None
    shafts: tuple[str, ...] | None = None
    base: Mapping[str, Any] | None = None
    span: tuple[int, int] | None = None

    def __str__(self) -> str:
        return ", ".join([self.case.name, *(f"{path} = {value}" for path, value in self.changes.items())])


class ProblemFiles:
    """Problem files of a study, paths relative to its folder, each read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[Path, dict[str, Any]] = {}

    def tables(self, point: Point) -> dict[str, Any]:
        """Return the tables of the problem file of a point with its changes; do not modify them.

        `InputError` names missing tables or keys.
        """
        case = point.case
        tables = dict(self.file(case.problem) if point.base is None else point.base)
        for where in case.without:
            try:
                tables = without(tables, where)
            except Refused:
                rule = "is listed under without, but the problem does not have it"
                raise self.refused(case, where, rule, nearest(where, list(tables))) from None
        with self.named(case):
            for where, value in {**case.set, **point.changes}.items():
                tables = changed(tables, where, value)
        if point.metric is not None:
            tables["objective"] = {"minimise": point.metric}
        return tables

    def file(self, name: str) -> dict[str, Any]:
        """Return the tables of a problem file, not to be modified."""
        path = self.folder / name
        if path not in self._files:
            if not path.exists():
                advice = nearest_file(path, "paths begin in the folder of the study")
                raise refused("file", "", "is named by the study, but does not exist", advice, path)
            self._files[path] = tables_of(path)
            if "study" in self._files[path]:
                raise refused("study", "", "makes this a study file", "name a problem file in the case", path)
        return self._files[path]

    def refused(self, case: CaseTable, where: str, rule: str, remedy: str) -> InputError:
        """Return the error about the key `where` in the problem file of a case."""
        return refused(where, "", rule, remedy, self.folder / case.problem)

    def problem(self, point: Point) -> Problem:
        """Return the problem of a point: its file with swept values, scaled to equal power if the case asks for it."""
        problem = load_tables(self.tables(point), self.folder / point.case.problem)
        if point.shafts is not None:
            problem = with_shafts(problem, point.shafts)
        reference = point.case.equal_power_to
        if reference is None:
            return problem
        with self.blamed(point, "equal_power_to"):
            return at_equal_power(problem, reference)

    def refuse_open_phasing(self, problem: Problem, case: CaseTable) -> None:
        """Raise `InputError` for an open crank star, whose search selects shafts by itself."""
        if problem.phasing is not None:
            rule, remedy = "is open, and decides on shafts by itself", "use laufruhe solve, or fix it"
            raise self.refused(case, "phasing", rule, remedy)

    def named(self, case: CaseTable) -> AbstractContextManager[None]:
        """Prefix errors about the problem of a case with the name of its problem file."""
        return errors_in_file(self.folder / case.problem)

    @contextmanager
    def blamed(self, point: Point, where: str = "point") -> Iterator[None]:
        """Report a `ModelError` in the block as an `InputError` about this point of the study."""
        try:
            yield
        except ModelError as error:
            path = self.folder / point.case.problem
            raise InputError(str(path), (Complaint.from_error(error, where, f'"{point}"'),)) from None

    def fingerprint(self, point: Point, settings: Mapping[str, Any]) -> str:
        """Return a hash of everything that a point depends on: problem, files that it names, settings, program.

        Every text of the problem file that names a file counts, so that no key has to be known here.
        """
        tables = self.tables(point)
        case = point.case.model_dump(exclude={"name", "sweep"})
        span = [point.case.name, *point.span] if point.span is not None else None
        about = [settings, case, point.shafts, span, tables, program()]
        digest = hashlib.sha256(json.dumps(about, sort_keys=True, default=str).encode())
        folder = (self.folder / point.case.problem).parent
        for text in sorted({text for _, text in texts_in(tables)}):
            with suppress(OSError, ValueError):
                if (folder / text).is_file():
                    digest.update(text.encode() + hashlib.sha256((folder / text).read_bytes()).digest())
        return digest.hexdigest()[:32]


@cache
def program() -> str:
    """Return a hash of the program: its code and the libraries on which results depend.

    The version alone would retain the points of a changed working copy.
    """
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(json.dumps(library_versions()).encode())
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if place.parts[0] not in DISPLAY:
            digest.update(place.as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()


def shafts_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of the balancer shafts, in the order of the engine."""
    return tuple(dict.fromkeys(r.shaft.name for r in problem.engine.rotors if r.role is Role.BALANCER))


def with_shafts(problem: Problem, names: Sequence[str]) -> Problem:
    """Return the problem with only the named balancer shafts."""
    unknown = set(names) - set(shafts_of(problem))
    if unknown:
        raise ModelError(f"'{min(unknown)}' is no balancer shaft of this engine; name one that is")
    return without_shafts(problem, set(shafts_of(problem)) - set(names))


Scenes = ProblemFiles
"""Earlier name of `ProblemFiles`, for extensions of other packages."""
