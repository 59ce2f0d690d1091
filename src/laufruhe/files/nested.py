"""Nested tables of a TOML file: values at addresses, and the pydantic annotations of these addresses."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, TypeAlias, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from laufruhe import units
from laufruhe.files import fields as f

Place: TypeAlias = tuple[str | int, ...]
"""Address of a value: keys, and indices in lists from zero."""


def at(node: Any, place: Sequence[Any]) -> Any:
    """Return the value at an address; None if a table lacks the key."""
    for key in place:
        node = node.get(key) if isinstance(node, Mapping) else node[key]
    return node


def with_value_at(tables: Mapping[str, Any], place: Sequence[Any], value: Any) -> dict[str, Any]:
    """Return a copy of the tables with another value at an address; unchanged parts are shared.

    Tables on the way that are missing are added.
    """
    result = dict(tables)
    table: Any = result
    for key in place[:-1]:
        table[key] = {} if isinstance(table, dict) and key not in table else table[key].copy()
        table = table[key]
    table[place[-1]] = value
    return result


def walk(tables: Any) -> Iterator[tuple[Place, Any]]:
    """Yield (address, value) of all values in nested tables, outer ones first."""
    left = deque[tuple[Place, Any]]([((), tables)])
    while left:
        place, node = left.popleft()
        yield place, node
        pairs = node.items() if isinstance(node, Mapping) else enumerate(node) if isinstance(node, list) else ()
        left.extend(((*place, key), entry) for key, entry in pairs)


def texts_in(tables: Any) -> Iterator[tuple[Place, str]]:
    """Yield (address, text) of all texts in nested tables."""
    return ((place, node) for place, node in walk(tables) if isinstance(node, str))


def plain(raw: Any, depth: int) -> Any:
    """Return a copy of nested tables, down to a depth, with values as a file has them.

    Tuples and arrays become lists, numbers of NumPy plain numbers, quantities of pint texts with a unit.
    """
    if isinstance(raw, Mapping) and depth:
        return {key: plain(value, depth - 1) for key, value in raw.items()}
    if isinstance(raw, list | tuple) and depth:
        return [plain(value, depth - 1) for value in raw]
    if hasattr(raw, "magnitude") and hasattr(raw, "units"):
        return _with_unit(np.asarray(raw.magnitude).tolist(), format(raw.units, "~C"))
    return raw.tolist() if isinstance(raw, np.ndarray | np.generic) else raw


def _with_unit(magnitude: Any, unit: str) -> Any:
    if isinstance(magnitude, list):
        return [_with_unit(entry, unit) for entry in magnitude]
    return f"{magnitude!r} {unit}".rstrip()


@lru_cache(maxsize=4096)
def number_at(model: type[BaseModel], path: Place) -> f.Number | None:
    """Return the field that reads the number at a path of a model; None for a text, count, list or choice."""
    leaves = (leaf for annotation in annotations_at(model, path) for leaf in _leaves(annotation))
    return next((leaf for leaf in leaves if isinstance(leaf, f.Number)), None)


def example_at(model: type[BaseModel], path: Place) -> str | float | None:
    """Return an example of the number or count at a path of a model; None for other values."""
    number = number_at(model, path)
    if number is not None:
        return units.example(number.unit) if number.unit else 0.25
    return 4 if int in (leaf for note in annotations_at(model, path) for leaf in _leaves(note)) else None


def least_length(model: type[BaseModel], path: Place) -> int:
    """Return the least number of entries of the list at a path of a model."""
    leaves = [leaf for annotation in annotations_at(model, path) for leaf in _leaves(annotation)]
    notes = [note for leaf in leaves for note in (*getattr(leaf, "metadata", ()), leaf)]
    return max(int(getattr(note, "min_length", None) or 1) for note in [*notes, None])


@lru_cache(maxsize=4096)
def annotations_at(model: type[BaseModel], path: Place) -> tuple[Any, ...]:
    """Return the type annotations of the key at a path of a pydantic model; empty if there is no such key."""
    if not path:
        return (model,)
    return tuple(inner for annotation in annotations_at(model, path[:-1]) for inner in _inside(annotation, path[-1]))


def tables_on(model: type[BaseModel], path: Place) -> list[type[f.Table]]:
    """Return the models of all tables that contain a path, the outermost first."""
    leaves = (leaf for k in range(len(path)) for note in annotations_at(model, path[:k]) for leaf in _leaves(note))
    return [leaf for leaf in leaves if isinstance(leaf, type) and issubclass(leaf, f.Table)]


def _inside(annotation: Any, part: str | int) -> list[Any]:
    """Return the annotations of one key or index within an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(str(part))
        return [] if field is None else [Annotated[field.annotation, *field.metadata, None]]
    if get_origin(annotation) is list:
        return list(get_args(annotation))
    if isinstance(annotation, f.ListOrSingle):
        # the value is a list, or a single table without a list
        return [annotation.inner, *_inside(annotation.inner, part)]
    if isinstance(annotation, f.OrWord):
        return _inside(annotation.inner, part)
    # the members are those of a union, or an annotated type and its notes
    return [inner for member in get_args(annotation) for inner in _inside(member, part)]


def _leaves(annotation: Any) -> Iterator[Any]:
    # leaves are members of a union and notes of annotated types, but no entries of lists
    if isinstance(annotation, f.ListOrSingle):
        yield from _leaves(annotation.inner)
    elif get_origin(annotation) is not list:
        yield annotation
        for part in get_args(annotation):
            yield from _leaves(part)
