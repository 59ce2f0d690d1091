"""A table of numbers as a file: heads with their units, and rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from laufruhe.problem.curves import Fields
from laufruhe.solvers.result import Result

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


Sheets: TypeAlias = Mapping[str, tuple[Callable[[Result], object], Callable[[Result], Sheet]]]
"""By the names of their files: whether a result may have a sheet, and the sheet, which is none without rows."""
