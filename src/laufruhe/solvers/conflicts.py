"""Find a smallest set of conflicting limits: without any of them there is no conflict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from laufruhe.problem.measure import Limit

T = TypeVar("T")


def smallest_conflicting(conflicting: Iterable[T], conflicts: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return a smallest subset that still conflicts: without any of its elements there is no conflict.

    Parameters
    ----------
    conflicts
        Return True if a subset conflicts.
    """
    subset = list(conflicting)
    for element in tuple(subset):
        reduced = [other for other in subset if other is not element]
        if conflicts(reduced):
            subset = reduced
    return subset


def smallest_conflict(limits: Sequence[Limit], conflicts: Callable[[Sequence[Limit]], bool]) -> tuple[str, ...]:
    """Return the names of a smallest set of limits that no design meets together."""
    return tuple(limit.name for limit in smallest_conflicting(limits, conflicts))
