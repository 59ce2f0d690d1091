"""Boxes of what is not convex with a design from each, some worked out ahead by others (P9)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.foresight import Foresight, foresight
from laufruhe.prove.best_first import Division, Over, Parts, Waiting
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.witness import Bounder, Known, check_around

# of the tolerance that counts as met
NEARLY = 0.99
# boxes that may be wanted next
AHEAD = 32
# points of a grid from which searches begin
POLISHED = 3


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

    @property
    def rank(self) -> tuple[bool, float]:
        """By what breaks limits least, then by what is least."""


B = TypeVar("B", bound=Box)
F = TypeVar("F", bound=Found)


class Search(Generic[B, F]):
    """What a method knows of its boxes and designs.

    Attributes
    ----------
    is_shared
        Whether other processes may divide its boxes.
    """

    is_shared = False

    @property
    def conflict(self) -> tuple[str, ...]:
        """Limits that were not met in boxes."""
        raise NotImplementedError

    def parts(self, box: B, value: float) -> Iterator[tuple[B | Over, F | None]]:
        """Boxes that cover one together, and a design from each, None where none was sought.

        Of a box in which no design is allowed, or none under a level, there is what is proven of it.
        """
        raise NotImplementedError

    def level(self, _: float) -> float:
        """Least objective that designs may have which bounds cut off where one of a value is known."""
        return math.inf

    def known(self, _: F) -> Known | None:
        """Return a design as a witness of bounds; None where it is none."""
        raise NotImplementedError

    def holds(self, _box: B, _design: F) -> bool:
        """Return whether a design lies in a box."""
        return False

    def around(self, _: F) -> B | Over | None:
        """Return a thin box that holds a design, and its bound; None where the box cannot be stated."""
        raise NotImplementedError

    def told(self, conflict: Sequence[str]) -> None:
        """Limits that were not met in boxes that another process divided."""


class _Designed(Division[B], Generic[B, F]):
    """Boxes of a search, and the best design found in them."""

    def __init__(
        self, search: Search[B, F], best: F, nothing: float, tolerance: float, what: str, ahead: Foresight[Any, Any]
    ) -> None:  # fmt: skip
        self.what, self.best, self.value = what, best, best.value
        self.known = search.known(best)
        self._search, self._nothing, self._tolerance, self._ahead = search, nothing, tolerance, ahead

    @property
    def level(self) -> float:
        """Least objective that designs may have which bounds cut off; infinite where none are."""
        return self._search.level(self.value)

    def holds(self, box: B) -> bool:
        """Return whether the best design lies in a box."""
        return self._search.holds(box, self.best)

    def is_done(self, one: Waiting[B]) -> bool:
        """Whether it meets the best design."""
        gap = gap_of(self.value, one.bound, self._nothing)
        # a box that left nothing out has no better design, only a bound as near as its program came
        return gap <= NEARLY * self._tolerance or (gap < np.inf and one.part.is_exact)

    def _take(self, found: F) -> None:
        if found.rank < self.best.rank:
            self.best, self.value, self.known = found, found.value, self._search.known(found)

    def parts(self, taken: Sequence[Waiting[B]]) -> Parts[B]:
        """Parts of a box, worked out ahead where others divide boxes too."""
        ((known, name, box),) = taken
        search, step = self._search, (self._search, box, self.value)
        if search.is_shared:
            others = ((number, (search, part, self.value)) for _, number, part in self.coming(AHEAD))
            self._ahead.likely([(name, step), *others])
        parts, conflict = self._ahead.wanted(name, step)
        search.told(conflict)
        for part, found in parts:
            if found is not None:
                self._take(found)
            yield part if isinstance(part, Over) else (part.bound, part)
            if not search.is_shared and passed():
                # what is left of the box is bounded by its own bound
                yield known, box
                return


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
    The best design; what no design goes under, infinite where none is allowed; and how many boxes there were.
    """
    with foresight(_parted) as ahead:
        boxes = _Designed(search, best, nothing, tolerance, what, ahead)
        bound = boxes.divide((root.bound, root), most)
    if boxes.known is not None:
        around: Bounder[F, B | Over] = _Around(search, what)
        check_around(around, boxes.best, boxes.known)
    return boxes.best, bound, boxes.seen


@dataclass(frozen=True, eq=False)
class _Around(Generic[B, F]):
    """Bounder of thin boxes of a search."""

    search: Search[B, F]
    what: str

    def around(self, design: F) -> B | Over | None:
        """Return a thin box around a design, with its bound."""
        return self.search.around(design)

    def bound(self, box: B | Over) -> float:
        """Return the bound of a box."""
        return box.level if isinstance(box, Over) else box.bound


def _parted(step: tuple[Any, Any, float]) -> tuple[Iterable[tuple[Any, Any]], tuple[str, ...]]:
    """Parts of a box; one by one as they are wanted where nobody else divides boxes."""
    search, box, value = step
    parts = search.parts(box, value)
    return (list(parts) if search.is_shared else parts), search.conflict


def searched(
    penalised: Callable[[Array], float], lower: Array, upper: Array, steps: int, most: int, most_steps: int
) -> list[Array]:
    """Where simplex searches end that begin at the best points of a grid, of so many steps a side and points in all."""
    from scipy.optimize import minimize

    count = min(steps, max(int(most ** (1.0 / len(lower))), 2))
    sides = [np.linspace(a, b, count) for a, b in zip(lower, upper, strict=True)]
    points = sorted((np.array(point) for point in itertools.product(*sides)), key=penalised)
    bounds: Any = list(zip(lower, upper, strict=True))
    found = []
    for point in points[:POLISHED]:
        simplex = np.clip(np.vstack([point, point + np.diag(0.5 * (upper - lower) / count)]), lower, upper)
        least = 1e-12 * max(penalised(point), 1e-300)
        told: Any = {"initial_simplex": simplex, "xatol": 1e-8, "fatol": least, "maxiter": most_steps}
        end = minimize(penalised, point, method="Nelder-Mead", bounds=bounds, options=told).x
        found.append(np.clip(end, lower, upper))
    return found
