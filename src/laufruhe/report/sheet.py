"""A table of numbers as a file: heads with their units, and rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from laufruhe.problem.curves import Fields

Cells: TypeAlias = list[Any]


@dataclass(frozen=True)
class Sheet:
    """Heads with their units, and rows of numbers and names."""

    head: Sequence[str]
    rows: Sequence[Cells]

    @classmethod
    def of(cls, found: Fields) -> Sheet:
        """Of labelled fields."""
        head, rows = found.table()
        return cls(head, list(rows))
