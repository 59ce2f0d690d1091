"""Paths into the tables of a problem file: what they hold, in which unit, and how it is changed."""

from __future__ import annotations

from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from laufruhe.files import fields
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.problem_file import ProblemFile


def at(tables: dict[str, Any], where: str) -> Any:
    """What stands at a path such as counterweights.web.balance_factor.

    Raises
    ------
    Refused
        If the scene has no such quantity.
    """
    here: Any = tables
    for key in keys_of(tables, where):
        here = here[key]
    return here


def changed(tables: dict[str, Any], where: str, value: Any) -> dict[str, Any]:
    """Tables with another value at a path; what is not on the path is shared with those given.

    Raises
    ------
    Refused
        If the scene has no such quantity.
    """
    keys = keys_of(tables, where)
    whole = here = dict(tables)
    for key in keys[:-1]:
        here[key] = here[key].copy()
        here = here[key]
    here[keys[-1]] = value
    return whole


def joined(tables: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Tables with others upon them: a table within is joined in turn, anything else is replaced."""
    both = [key for key, one in own.items() if isinstance(one, dict) and isinstance(tables.get(key), dict)]
    return {**tables, **own, **{key: joined(tables[key], own[key]) for key in both}}


def keys_of(tables: dict[str, Any], where: str) -> tuple[Any, ...]:
    """The keys and places that a path goes through.

    Raises
    ------
    Refused
        If the scene has no such quantity.
    """
    here: Any = tables
    keys = []
    parts = where.split(".")
    for k, part in enumerate(parts):
        options = _options(here)
        if part not in options:
            remedy = nearest(part, list(options)) if options else "name a quantity of the problem file"
            raise Refused(".".join(parts[: k + 1]), None, "is no quantity of this scene", remedy)
        keys.append(options[part])
        here = here[options[part]]
    return tuple(keys)


def _options(here: Any) -> dict[str, Any]:
    """Names of what a table or a list holds; a list's entries by their names, or counted from one."""
    if isinstance(here, dict):
        return {key: key for key in here}
    if isinstance(here, list):
        named = {entry["name"]: k for k, entry in enumerate(here) if isinstance(entry, dict) and "name" in entry}
        return {**{str(k + 1): k for k in range(len(here))}, **named}
    return {}


def field_at(where: str) -> fields.Number | None:
    """How the number at a path is read; None where text, a list or a choice stands there."""
    here: list[Any] = [ProblemFile]
    for part in where.split("."):
        here = [inner for annotation in here for inner in _inside(annotation, part)]
    return next((found for annotation in here for found in _numbers(annotation)), None)


def _inside(annotation: Any, part: str) -> list[Any]:
    """Annotations of what a part of a path may mean."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(part)
        return [] if field is None else [Annotated[field.annotation, *field.metadata, None]]
    if get_origin(annotation) is list:
        return list(get_args(annotation))
    if isinstance(annotation, fields.OrOpen):
        return _inside(annotation.inner, part)
    # what is annotated and its notes, or the members of a union
    return [inner for one in get_args(annotation) for inner in _inside(one, part)]


def _numbers(annotation: Any) -> list[fields.Number]:
    if isinstance(annotation, fields.Number):
        return [annotation]
    if get_origin(annotation) is list:
        return []
    return [found for one in get_args(annotation) for found in _numbers(one)]
