"""Places of a file by its models: the tables on the way there, and how a number is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from laufruhe.files import fields as f


def number_at(model: type[BaseModel], path: Sequence[str | int]) -> f.Number | None:
    """Return how the number at a path is read; None where text, a count, a list or a choice stands there."""
    return next((found for annotation in annotations_at(model, path) for found in _numbers(annotation)), None)


def annotations_at(model: type[BaseModel], path: Sequence[str | int]) -> list[Any]:
    """Return the annotations of what may stand at a path; none where the models have no such key."""
    here: list[Any] = [model]
    for part in path:
        here = [inner for annotation in here for inner in _inside(annotation, part)]
    return here


def tables_on(model: type[BaseModel], path: Sequence[str | int]) -> list[type[f.Table]]:
    """Return the tables that may hold what stands at a path, the outermost first."""
    found: list[type[f.Table]] = []
    for count in range(len(path)):
        found += [table for annotation in annotations_at(model, path[:count]) for table in _tables(annotation)]
    return found


def _inside(annotation: Any, part: str | int) -> list[Any]:
    """Annotations of what a part of a path may mean."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(str(part))
        return [] if field is None else [Annotated[field.annotation, *field.metadata, None]]
    if get_origin(annotation) is list:
        return list(get_args(annotation))
    if isinstance(annotation, f.OneOrEach):
        # a list, or its one table alone
        return [annotation.inner, *_inside(annotation.inner, part)]
    if isinstance(annotation, f.OrOpen):
        return _inside(annotation.inner, part)
    # what is annotated and its notes, or the members of a union
    return [inner for one in get_args(annotation) for inner in _inside(one, part)]


def _numbers(annotation: Any) -> list[f.Number]:
    if isinstance(annotation, f.Number):
        return [annotation]
    if isinstance(annotation, f.OneOrEach):
        return _numbers(annotation.inner)
    if get_origin(annotation) is list:
        return []
    return [found for one in get_args(annotation) for found in _numbers(one)]


def _tables(annotation: Any) -> list[type[f.Table]]:
    if isinstance(annotation, type) and issubclass(annotation, f.Table):
        return [annotation]
    if isinstance(annotation, f.OneOrEach):
        return _tables(annotation.inner)
    if get_origin(annotation) is list:
        return []
    return [found for one in get_args(annotation) for found in _tables(one)]
