"""Drawings of one problem file with other numbers at some of its places."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.problem.decision import Decision

Path: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True)
class Drawing:
    """Parts of a problem that follow from numbers of its file."""

    engine: Engine
    points: tuple[OperatingPoint, ...]
    decisions: tuple[Decision, ...]
    mount_numbers: tuple[tuple[float, ...], ...]


Rebuild: TypeAlias = Callable[[Mapping[Path, str | float]], Drawing]
"""Return the drawing of a problem file with other numbers at some of its places."""


@dataclass(frozen=True)
class Beside:
    """A rebuild in which some numbers stand at other values already."""

    rebuild: Rebuild
    changes: Mapping[Path, str | float]

    def __call__(self, changes: Mapping[Path, str | float]) -> Drawing:
        """Return the drawing with further numbers changed."""
        return self.rebuild({**self.changes, **changes})


def no_file(changes: Mapping[Path, str | float]) -> Drawing:
    """Refuse to draw a problem that was not read from a file."""
    raise ModelError(f"{', '.join(map(str, changes))} is a number of a problem file, and there is none")
