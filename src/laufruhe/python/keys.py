"""Keys of tables from the arguments of a call."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Self

NAMES = {"how": "as"}
"""Keys that are no names in Python, by the names of their arguments."""


def keys_of(arguments: Mapping[str, Any], fixed: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the keys of a table from the arguments of a call, without those that are None, after `fixed` ones."""
    keys = {NAMES.get(name, name): value for name, value in arguments.items() if name != "self" and value is not None}
    return {**(fixed or {}), **keys}


class Parts(ABC):
    """Base of generated methods that add tables: the method `name` at a key of the file, plural for lists."""

    @abstractmethod
    def _with(self, key: str, name: str, table: Mapping[str, Any]) -> Self: ...
