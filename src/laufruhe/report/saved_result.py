"""Write `result.json` and read it back as `SavedResult`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ValidationError

from laufruhe.errors import InputError, refused, wrong_call
from laufruhe.files.complaints import complaints_of
from laufruhe.files.fields import check_format
from laufruhe.prove.certificate import Certificate
from laufruhe.report.files import RESULT, write
from laufruhe.report.json_result import as_json
from laufruhe.solvers.result import Result, ResultContent, Status
from laufruhe.solvers.values import DecisionValue, LimitValue, ObjectiveValue


def _numbers(entry: Any) -> Any:
    if not isinstance(entry, dict):
        return entry
    # an equal tightening price is stored twice
    is_same = entry.get("tightening_price") in (None, entry.get("shadow_price"))
    entries = {k: v for k, v in entry.items() if not (is_same and k == "tightening_price")}
    return {k: math.nan if v is None else v for k, v in entries.items()}


def _named(entries: Any) -> Any:
    if not isinstance(entries, dict):
        return entries
    return {name: {"name": name, **values} if isinstance(values, dict) else values for name, values in entries.items()}


_NULLS = BeforeValidator(_numbers)


class _File(BaseModel):
    """Keys of `result.json` that are read by name; other keys are retained unchanged."""

    problem: str
    title: str
    status: Status
    message: str
    conflict: list[str]
    objective: Annotated[ObjectiveValue | None, _NULLS]
    certificate: Annotated[Certificate, _NULLS]
    decisions: Annotated[dict[str, Annotated[DecisionValue, _NULLS]], BeforeValidator(_named)]
    constraints: list[Annotated[LimitValue, _NULLS]]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SavedResult(ResultContent):
    """A result as read from its `result.json` [SI].

    Attributes
    ----------
    problem, title
        Name of the problem file without its ending, and its title.
    record
        Whole content of the file, as plain Python values.
    """

    problem: str
    title: str
    record: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.problem

    @property
    def values(self) -> dict[str, str]:
        """Decided values as a problem file writes them; `problem.with_values` takes them."""
        return {d.name: f"{d.value!r} {d.unit}".rstrip() for d in self.decisions}


def write_result(result: Result, path: str | Path, series: bool = False) -> None:
    """Write a result as the commands write their `result.json`.

    Parameters
    ----------
    path
        Path of the file, which is overwritten.
    series
        True to add the loads over the cycle.
    """
    write(Path(path), as_json(result, series))


def read_result(path: str | Path) -> SavedResult:
    """Read the `result.json` of `laufruhe solve` or `evaluate`.

    Parameters
    ----------
    path
        Path of the file, or of its folder of results.

    Raises
    ------
    InputError
        If the file is missing, or is not such a result.
    """
    if not isinstance(path, str | Path):
        raise wrong_call("path", path, f"is of type {type(path).__name__}", "give the path of a result.json file")
    place = Path(path)
    place = place / RESULT if place.is_dir() else place
    try:
        record = json.loads(place.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise refused("file", "", "does not exist", "check the path", place) from None
    except OSError as error:
        raise refused("file", "", f"cannot be read ({error.strerror})", "check its permissions", place) from None
    except (ValueError, RecursionError):
        raise refused("file", "", "is no JSON", "name a result.json of laufruhe solve or evaluate", place) from None
    if not isinstance(record, dict) or not {"problem", "status"} <= record.keys():
        rule = "is no result of laufruhe solve or evaluate"
        raise refused("file", "", rule, "give a result.json of one of these commands, or its folder", place)
    check_format(record, place)
    try:
        file = _File.model_validate(record)
    except ValidationError as error:
        raise InputError(str(place), complaints_of(error, _File)) from None
    has_design = file.status.has_design
    return SavedResult(
        problem=file.problem,
        title=file.title,
        status=file.status,
        # a result without a design has no value
        objective=file.objective if has_design else None,
        certificate=file.certificate if file.certificate.method else None,
        decisions=tuple(file.decisions.values()),
        limits=tuple(file.constraints) if has_design else (),
        message=file.message,
        conflict=tuple(file.conflict),
        record=record,
    )
