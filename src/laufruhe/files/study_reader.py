"""Reading a study file, and the scenes that it makes of problem files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError
from laufruhe.files.complaints import Refused, complaints_of, nearest
from laufruhe.files.reader import tables_of
from laufruhe.files.study_models import AnyPart, StudyFile
from laufruhe.files.study_parts import CaseTable, SweptPartTable
from laufruhe.files.study_paths import changed
from laufruhe.files.study_sweeps import axis_of


def load_study(path: Path) -> StudyFile:
    """Read and check a study file.

    Raises
    ------
    InputError
        With one line for everything wrong: file, key, value, rule, remedy.
    """
    tables = tables_of(path)
    if "study" not in tables:
        raise _refused(path, "study", "", "is missing, so this is no study file", "use laufruhe solve for a problem")
    try:
        file = StudyFile.model_validate(tables)
    except ValidationError as error:
        raise InputError(str(path), complaints_of(error, StudyFile)) from None
    if not file.study.parts and file.study.figures is None:
        raise _refused(path, "study.parts", "", "is missing", 'add [[study.parts]], or figures = "tractor"')
    names = [part.name for part in file.study.parts]
    for k, part in enumerate(file.study.parts):
        where = f"study.parts[{k + 1}]"
        if names.count(part.name) > 1:
            raise _refused(path, f"{where}.name", part.name, "is given twice", "give each part its own name")
        _check_cases(part, path, where)
        if isinstance(part, SweptPartTable):
            _check_sweeps(part, path, where)
    return file


def _check_cases(part: AnyPart, path: Path, where: str) -> None:
    cases = [case.name for case in part.cases]
    if len(set(cases)) < len(cases):
        raise _refused(path, f"{where}.cases", "", "has two cases of one name", "give each its own")


def _check_sweeps(part: SweptPartTable, path: Path, where: str) -> None:
    paths = [sweep.quantity for sweep in part.sweep]
    for k, sweep in enumerate(part.sweep):
        at = f"{where}.sweep[{k + 1}]"
        if paths.count(sweep.quantity) > 1:
            raise _refused(path, f"{at}.quantity", sweep.quantity, "is swept twice", "sweep it once")
        for j, case in enumerate(part.cases):
            if sweep.quantity in case.set:
                rule = f"is swept, and set by cases[{j + 1}] too"
                raise _refused(path, f"{at}.quantity", sweep.quantity, rule, "leave out one of the two")
        try:
            axis_of(sweep)
        except Refused as refused:
            found = refused.complaint
            raise _refused(path, f"{at}.{found.where}", found.value, found.rule, found.remedy) from None


def scene_tables(
    given: Mapping[str, Any], case: CaseTable, changes: Mapping[str, Any], path: Path, metric: str | None = None
) -> dict[str, Any]:
    """Tables of the problem of a case, with its own changes and those of a sweep.

    Raises
    ------
    InputError
        If the problem file has no such table or quantity.
    """
    tables = dict(given)
    for name in case.without:
        if name not in tables:
            raise _refused(path, name, "", "is left out by the study and is not there", nearest(name, list(tables)))
        del tables[name]
    try:
        for where, value in {**case.set, **changes}.items():
            tables = changed(tables, where, value)
    except Refused as refused:
        raise InputError(str(path), (refused.complaint,)) from None
    if metric is not None:
        tables["objective"] = {"minimise": metric}
    return tables


def _refused(path: Path, where: str, value: str, rule: str, remedy: str) -> InputError:
    return InputError(str(path), (Complaint(where, value, rule, remedy),))
