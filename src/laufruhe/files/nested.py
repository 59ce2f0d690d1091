"""Tables within tables, as a TOML file has them: what stands where, another value there, and all that stands inside."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

Place: TypeAlias = tuple[str | int, ...]
"""Keys, and numbers in lists from zero."""


def at(node: Any, place: Sequence[Any]) -> Any:
    """What stands there; None where a table has no such key."""
    for key in place:
        node = node.get(key) if isinstance(node, Mapping) else node[key]
    return node


def put(tables: Mapping[str, Any], place: Sequence[Any], value: Any) -> dict[str, Any]:
    """Tables with another value there; the rest is shared with those given."""
    whole = dict(tables)
    here: Any = whole
    for key in place[:-1]:
        here[key] = here[key].copy()
        here = here[key]
    here[place[-1]] = value
    return whole


def inside(tables: Any) -> Iterator[tuple[Place, Any]]:
    """Everything that stands in tables, and where; what is nested comes after what holds it."""
    left = deque[tuple[Place, Any]]([((), tables)])
    while left:
        place, node = left.popleft()
        yield place, node
        pairs = node.items() if isinstance(node, Mapping) else enumerate(node) if isinstance(node, list) else ()
        left.extend(((*place, key), entry) for key, entry in pairs)


def texts_in(tables: Any) -> Iterator[tuple[Place, str]]:
    """All texts of tables, and where they stand."""
    return ((place, node) for place, node in inside(tables) if isinstance(node, str))


def plain(given: Any, deepest: int) -> Any:
    """A copy as a file has it: lists of tuples and arrays, numbers of NumPy's, down to a depth."""
    if isinstance(given, Mapping) and deepest:
        return {key: plain(value, deepest - 1) for key, value in given.items()}
    if isinstance(given, list | tuple) and deepest:
        return [plain(value, deepest - 1) for value in given]
    return given.tolist() if isinstance(given, np.ndarray | np.generic) else given
