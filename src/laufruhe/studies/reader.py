"""Reader of study files: cases, sweeps and comparisons (docs/reference/study-files.md)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, Union

from pydantic import Field, ValidationError, model_validator

from laufruhe.errors import Complaint, InputError, refused
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, complaints_of
from laufruhe.files.fields import FormatNumber, Table, check_format
from laufruhe.files.reader import tables_and_path
from laufruhe.files.study_tables import MAX_POINTS, joined
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.part import Part

if TYPE_CHECKING:
    AnyPart: TypeAlias = Part
else:
    AnyPart = Annotated[Union[tuple(KINDS.values())], Field(discriminator="kind")]  # noqa: UP007


class StudyTable(Table):
    """Tables of a study file."""

    common: dict[str, Any] = f.optional("Keys of every part that does not give its own.", {})
    parts: list[AnyPart] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _common(cls, tables: Any) -> Any:
        parts = tables.get("parts") if isinstance(tables, dict) else None
        if not isinstance(parts, list) or not isinstance(tables.get("common"), dict):
            return tables
        return {
            **tables,
            "parts": [joined(tables["common"], part) if isinstance(part, dict) else part for part in parts],
        }


class StudyFile(Table):
    """A whole study file."""

    format: FormatNumber = 1
    title: Annotated[str, Field(min_length=1)]
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    study: StudyTable


def _merged(complaints: Sequence[Complaint], tables: Mapping[str, Any]) -> tuple[Complaint, ...]:
    # an error of a key in `common` is reported once, not for each part
    study = tables["study"]
    common = study.get("common") if isinstance(study, dict) else None
    keys = common if isinstance(common, dict) else {}
    first: dict[str, Complaint] = {}
    for complaint in complaints:
        key = re.sub(r"^study\.parts\[\d+\]\.", "", complaint.where)
        where = f"study.common.{key}" if re.split(r"[.\[]", key)[0] in keys else complaint.where
        first.setdefault(where, replace(complaint, where=where))
    return tuple(first.values())


def load_study(source: str | Path | Mapping[str, Any]) -> StudyFile:
    """Read and check a study from a file, its text or its tables.

    A part with several readings (interpretations of a doubtful printed number) becomes one part for each of them.

    Raise `InputError` with one line for each fault: file, key, value, rule, remedy.
    """
    tables, path = tables_and_path(source)
    check_format(tables, path)
    if "study" not in tables:
        raise refused("study", "", "is missing, so this is not a study file", "use laufruhe solve for a problem", path)
    try:
        file = StudyFile.model_validate(tables)
    except ValidationError as error:
        raise InputError(str(path), _merged(complaints_of(error, StudyFile), tables)) from None
    parts = [reading for part in file.study.parts for reading in part.by_reading()]
    names = [part.name for part in parts]
    for k, part in enumerate(file.study.parts):
        where = f"study.parts[{k + 1}]"
        if max(names.count(reading.name) for reading in part.by_reading()) > 1:
            raise refused(f"{where}.name", part.name, "is given twice", "give each part its own name", path)
        cases = [case.name for case in part.cases]
        if len(set(cases)) < len(cases):
            raise refused(f"{where}.cases", "", "has two cases with the same name", "give each its own", path)
        for key, read in part.swept_or_drawn():
            try:
                read()
            except Refused as error:
                complaint = replace(error.complaint, where=f"{where}.{key}.{error.complaint.where}")
                raise InputError(str(path), (complaint,)) from None
        if part.size() > MAX_POINTS:
            rule = f"makes {part.size()} points; a study takes {MAX_POINTS}"
            raise refused(where, "", rule, "ask for fewer", path)
    count = sum(part.size() for part in parts)
    if count > MAX_POINTS:
        rule = f"make {count} points; a study takes {MAX_POINTS}"
        raise refused("study.parts", "", rule, "make two studies of them", path)
    return file.model_copy(update={"study": file.study.model_copy(update={"parts": parts})})
