"""Branch and bound over boxes with a design from each box; worker processes prepare boxes ahead (P9)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import Speculation, speculation
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.witness import Bounder, Witness, check_near_witness

# share of the tolerance at which the gap counts as closed
NEARLY = 0.99
# boxes that workers prepare ahead
AHEAD = 32
# best points of a grid from which simplex searches begin
POLISHED = 3


class SearchBox(Protocol):
    """A box of open numbers."""

    @property
    def bound(self) -> float:
        """Lower bound of the objective in the box."""

    @property
    def is_exact(self) -> bool:
        """Tell if the bound has no relaxation error; splitting the box cannot improve it."""


class BoxDesign(Protocol):
    """A design from a box."""

    @property
    def value(self) -> float:
        """Objective; infinite if a limit is violated."""

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: feasible designs first, then by objective."""


B = TypeVar("B", bound=SearchBox)
D = TypeVar("D", bound=BoxDesign)


class BoxSearch(Generic[B, D]):
    """Boxes and designs of one method.

    Attributes
    ----------
    is_shared
        Whether worker processes may divide the boxes.
    """

    is_shared = False

    @property
    def conflict(self) -> tuple[str, ...]:
        """Names of limits that boxes without a feasible design violate."""
        raise NotImplementedError

    def parts(self, box: B, value: float) -> Iterator[tuple[B | FathomedPart, D | None]]:
        """Yield boxes that cover a box, or the level below which a part has no design, each with a design or None."""
        raise NotImplementedError

    def level(self, _: float) -> float:
        """Return the least objective of designs that bounds cut off, for the value of the incumbent."""
        return math.inf

    def known(self, _: D) -> Witness | None:
        """Return a design as a witness of bounds, or None."""
        raise NotImplementedError

    def holds(self, _box: B, _design: D) -> bool:
        """Return whether a design lies in a box."""
        return False

    def around(self, _: D) -> B | FathomedPart | None:
        """Return a thin box around a design with its bound, or None."""
        raise NotImplementedError

    def add_conflict(self, conflict: Sequence[str]) -> None:
        """Add names of limits that boxes of a worker process violate."""


class _Branching(BranchAndBound[B], Generic[B, D]):
    """Branch and bound that keeps the best design of all boxes."""

    def __init__(
        self, search: BoxSearch[B, D], best: D, zero_level: float, tolerance: float, what: str,
        ahead: Speculation[Any, Any],
    ) -> None:  # fmt: skip
        self.what, self.best, self.value = what, best, best.value
        self.witness = search.known(best)
        self._search, self._zero_level, self._tolerance, self._ahead = search, zero_level, tolerance, ahead

    @property
    def level(self) -> float:
        """Least objective of designs that bounds cut off; infinite if they cut off none."""
        return self._search.level(self.value)

    def contains_witness(self, box: B) -> bool:
        """Return whether the best design lies in a box."""
        return self._search.holds(box, self.best)

    def is_fathomed(self, node: OpenNode[B]) -> bool:
        """Return whether the gap between a box and the incumbent is closed."""
        gap = gap_of(self.value, node.bound, self._zero_level)
        # the bound of an exact box differs from its best design by no more than the tolerance of its program
        return gap <= NEARLY * self._tolerance or (gap < np.inf and node.part.is_exact)

    def branch(self, nodes: Sequence[OpenNode[B]]) -> BoundedParts[B]:
        """Yield the parts of a box, prepared by workers if the search is shared."""
        ((bound, name, box),) = nodes
        search, step = self._search, (self._search, box, self.value)
        if search.is_shared:
            others = ((number, (search, part, self.value)) for _, number, part in self.next_nodes(AHEAD))
            self._ahead.prefetch([(name, step), *others])
        parts, conflict = self._ahead.result(name, step)
        search.add_conflict(conflict)
        for part, design in parts:
            if design is not None and design.rank < self.best.rank:
                self.best, self.value, self.witness = design, design.value, search.known(design)
            yield part if isinstance(part, FathomedPart) else (part.bound, part)
            if not search.is_shared and is_time_over():
                # the remaining parts have at least the bound of the box
                yield bound, box
                return


def divided(
    search: BoxSearch[B, D], root: B, best: D, zero_level: float, tolerance: float, maximum: int, what: str
) -> tuple[D, float, int]:
    """Divide boxes until the least bound meets the best design.

    Parameters
    ----------
    root, best
        Box of all open numbers, and a design to begin with.
    zero_level
        Objective that counts as zero [SI].
    tolerance
        Relative gap at which the search ends.
    maximum
        Largest number of boxes.
    what
        Name of the boxes in progress reports.

    Returns
    -------
    The best design, the lower bound of all designs (infinite if none is feasible), and the number of boxes.
    """
    with speculation(_parted) as ahead:
        boxes = _Branching(search, best, zero_level, tolerance, what, ahead)
        bound = boxes.divide((root.bound, root), maximum)
    if boxes.witness is not None:
        around: Bounder[D, B | FathomedPart] = _Around(search, what)
        check_near_witness(around, boxes.best, boxes.witness)
    return boxes.best, bound, boxes.node_count


@dataclass(frozen=True, eq=False)
class _Around(Generic[B, D]):
    """Thin boxes of a search, to check bounds around a known design."""

    search: BoxSearch[B, D]
    what: str

    def around(self, design: D) -> B | FathomedPart | None:
        """Return a thin box around a design with its bound."""
        return self.search.around(design)

    def bound(self, box: B | FathomedPart) -> float:
        """Return the bound of a box."""
        return box.level if isinstance(box, FathomedPart) else box.bound


def _parted(step: tuple[Any, Any, float]) -> tuple[Iterable[tuple[Any, Any]], tuple[str, ...]]:
    search, box, value = step
    parts = search.parts(box, value)
    return (list(parts) if search.is_shared else parts), search.conflict


def search_from_grid(
    penalised: Callable[[Array], float], lower: Array, upper: Array, steps: int, maximum: int, most_steps: int
) -> list[Array]:
    """Return the ends of simplex searches from the best points of a grid.

    Parameters
    ----------
    penalised
        Objective with penalties on violated limits.
    lower, upper
        Bounds, shape (n,).
    steps, maximum
        Points of the grid along a side, and in all.
    most_steps
        Iterations of one search.
    """
    from scipy.optimize import minimize

    count = min(steps, max(int(maximum ** (1.0 / len(lower))), 2))
    sides = [np.linspace(a, b, count) for a, b in zip(lower, upper, strict=True)]
    points = sorted((np.array(point) for point in itertools.product(*sides)), key=penalised)
    bounds: Any = list(zip(lower, upper, strict=True))
    ends = []
    for point in points[:POLISHED]:
        simplex = np.clip(np.vstack([point, point + np.diag(0.5 * (upper - lower) / count)]), lower, upper)
        tolerance = 1e-12 * max(penalised(point), 1e-300)
        options: Any = {"initial_simplex": simplex, "xatol": 1e-8, "fatol": tolerance, "maxiter": most_steps}
        end = minimize(penalised, point, method="Nelder-Mead", bounds=bounds, options=options).x
        ends.append(np.clip(end, lower, upper))
    return ends
