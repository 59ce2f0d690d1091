"""Reading a study file, and the scenes that it makes of problem files."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError
from laufruhe.problem.complaints import complaints_of, nearest
from laufruhe.problem.model import Problem
from laufruhe.problem.reader import load_tables, tables_of
from laufruhe.problem.study_models import CaseTable, StudyFile, Value


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
    _check(file, path)
    return file


def _check(file: StudyFile, path: Path) -> None:
    names = [part.name for part in file.study.parts]
    if not names and file.study.figures is None:
        raise _refused(path, "study.parts", "", "is missing", 'add [[study.parts]], or figures = "tractor"')
    for k, part in enumerate(file.study.parts):
        where = f"study.parts[{k + 1}]"
        if names.count(part.name) > 1:
            raise _refused(path, f"{where}.name", part.name, "is given twice", "give each part its own name")
        for j, sweep in enumerate(part.sweep):
            at = f"{where}.sweep[{j + 1}].values"
            if len(sweep.values) < 2:
                rule = "holds one value, which is no sweep" if sweep.values else "is empty"
                raise _refused(path, at, str(sweep.values), rule, "give two values or more, or leave the sweep out")
            if len(set(sweep.values)) < len(sweep.values):
                raise _refused(path, at, str(sweep.values), "names a value twice", "name each once")
        cases = [case.name for case in part.cases]
        if len(set(cases)) < len(cases):
            raise _refused(path, f"{where}.cases", "", "has two cases of one name", "give each its own")


def scene(case: CaseTable, changes: Mapping[str, Value], folder: Path) -> Problem:
    """The problem of a case, with its own changes and those of a sweep.

    Raises
    ------
    InputError
        If the problem file is bad, has no such quantity, or what is made of it is bad.
    """
    path = folder / case.problem
    tables = copy.deepcopy(tables_of(path))
    for name in case.without:
        if name not in tables:
            raise _refused(path, name, "", "is left out by the study and is not there", nearest(name, list(tables)))
        del tables[name]
    for where, value in {**case.set, **changes}.items():
        _assign(tables, where, value, path)
    return load_tables(tables, path)


def _assign(tables: dict[str, Any], where: str, value: Value, path: Path) -> None:
    here: Any = tables
    parts = where.split(".")
    for k, part in enumerate(parts):
        options = _options(here)
        if part not in options:
            seen = ".".join(parts[: k + 1])
            remedy = nearest(part, list(options)) if options else "name a quantity of the problem file"
            raise _refused(path, seen, "", "is no quantity of this scene", remedy)
        key = options[part]
        if k == len(parts) - 1:
            here[key] = value
            return
        here = here[key]


def _options(here: Any) -> dict[str, Any]:
    """Names of what a table or a list holds; a list's entries by their names, or counted from one."""
    if isinstance(here, dict):
        return {key: key for key in here}
    if isinstance(here, list):
        named = {entry["name"]: k for k, entry in enumerate(here) if isinstance(entry, dict) and "name" in entry}
        return {**{str(k + 1): k for k in range(len(here))}, **named}
    return {}


def _refused(path: Path, where: str, value: str, rule: str, remedy: str) -> InputError:
    return InputError(str(path), (Complaint(where, value, rule, remedy),))
