"""Boxes of what is not convex, the least bound first: one loop for every method that divides them (P9)."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import Any, Protocol, TypeVar

import numpy as np

from laufruhe.numerics.budget import passed
from laufruhe.numerics.foresight import foresight
from laufruhe.numerics.progress import tell
from laufruhe.prove.certificate import gap_of

# of the tolerance that counts as met
NEARLY = 0.99
# boxes that may be wanted next
AHEAD = 32


class Box(Protocol):
    """A part of what is open."""

    @property
    def bound(self) -> float:
        """What no design in it goes under."""

    @property
    def is_exact(self) -> bool:
        """Whether its bound left nothing out: no part of it has a better one."""


class Found(Protocol):
    """A design."""

    @property
    def value(self) -> float:
        """Its objective; infinite where it is not allowed."""


B = TypeVar("B", bound=Box)
F = TypeVar("F", bound=Found)


class Search(Protocol[B, F]):
    """What a method knows of its boxes and designs.

    Attributes
    ----------
    is_shared
        Whether other processes may divide its boxes.
    """

    is_shared: bool

    @property
    def conflict(self) -> tuple[str, ...]:
        """Limits that were not met in boxes."""

    def parts(self, box: B, value: float) -> Iterator[tuple[B | None, F | None]]:
        """Boxes that cover one together, and a design from each, None where none was sought.

        Of a box in which no design is allowed, or none better than a value, there is None.
        """

    def better(self, best: F, found: F) -> F:
        """The better of two designs."""

    def told(self, conflict: Sequence[str]) -> None:
        """Limits that were not met in boxes that another process divided."""


def divided(
    search: Search[B, F], root: B, best: F, nothing: float, tolerance: float, most: int, what: str
) -> tuple[F, float, int]:
    """Divide boxes until their least bound meets the best design, or as often as is worth it.

    Parameters
    ----------
    nothing
        Objective that counts as zero.
    most
        Boxes.
    what
        Is divided, in words.

    Returns
    -------
    The best design; what bounds the boxes that are left, infinite where none is; and how many there were.
    """
    number, seen = count(), 1
    heap = [(root.bound, next(number), root)]
    with foresight(_parted) as ahead:
        while heap and seen < most and not passed():
            gap = gap_of(best.value, heap[0][0], nothing)
            # a box that left nothing out has no better design, only a bound as near as its program came
            if gap <= NEARLY * tolerance or (gap < np.inf and heap[0][2].is_exact):
                break
            _, name, box = heapq.heappop(heap)
            step = search, box, best.value
            if search.is_shared:
                others = heapq.nsmallest(AHEAD, heap)
                ahead.likely([(name, step), *((other, (search, one, best.value)) for _, other, one in others)])
            parts, conflict = ahead.wanted(name, step)
            search.told(conflict)
            for part, found in parts:
                seen += 1
                if part is not None and part.bound < best.value:
                    heapq.heappush(heap, (part.bound, next(number), part))
                    best = best if found is None else search.better(best, found)
                if not search.is_shared and passed():
                    # what is left of the box is bounded by its own bound
                    heapq.heappush(heap, (box.bound, next(number), box))
                    break
            tell(what, seen, value=best.value, bound=heap[0][0] if heap else -np.inf)
    return best, heap[0][0] if heap else np.inf, seen


def _parted(step: tuple[Any, Any, float]) -> tuple[Iterable[tuple[Any, Any]], tuple[str, ...]]:
    """Parts of a box; one by one as they are wanted where nobody else divides boxes."""
    search, box, value = step
    parts = search.parts(box, value)
    return (list(parts) if search.is_shared else parts), search.conflict
