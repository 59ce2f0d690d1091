"""Which limits contradict each other: a smallest set of them, each needed for the contradiction."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from laufruhe.problem.measure import Limit

T = TypeVar("T")


def smallest(conflicting: Iterable[T], excluded: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return a smallest subset that still conflicts: leaving out any element ends the conflict."""
    kept = list(conflicting)
    for one in tuple(kept):
        without = [other for other in kept if other is not one]
        if excluded(without):
            kept = without
    return kept


def smallest_conflict(limits: Sequence[Limit], excluded: Callable[[Sequence[Limit]], bool]) -> tuple[str, ...]:
    """A smallest set of limits that no design keeps together, by name."""
    return tuple(limit.name for limit in smallest(limits, excluded))
