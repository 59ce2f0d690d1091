"""Branch and bound over boxes with a design from each box (P9)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from laufruhe.numerics.budget import is_time_over
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.witness import Witness

# share of the tolerance at which the gap counts as closed
GAP_SAFETY = 0.99


class SearchBox(Protocol):
    """A box: a range for every open number, with its lower bound, as `divide_boxes` needs it."""

    @property
    def bound(self) -> float:
        """Lower bound of the objective in the box."""

    @property
    def is_exact(self) -> bool:
        """True if the bound has no relaxation error, so that splitting the box cannot improve it."""


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
    """Boxes and designs of a method."""

    def parts(self, box: B, value: float) -> Iterator[tuple[B | FathomedPart, D | None]]:
        """Yield parts that together make up a box, each with a design in it, or None.

        A part is a box, or the proof that no design in it has an objective below a level. The objective of the
        incumbent is `value` [SI].
        """
        raise NotImplementedError

    def level(self, _: float) -> float:
        """Return the smallest objective that designs in cut-off boxes may have [SI]; infinite if none is cut off."""
        return math.inf

    def witness_of(self, _: D) -> Witness | None:
        """Return a design as a witness of bounds, or None if it violates limits."""
        raise NotImplementedError

    def contains(self, _box: B, _design: D) -> bool:
        """Return True if a design lies in a box."""
        return False

    def around(self, _: D) -> B | FathomedPart | None:
        """Return a thin box around a design, with its bound; None if the method builds none."""
        raise NotImplementedError


class _Branching(BranchAndBound[B], Generic[B, D]):
    """Branch and bound that stores the best design of all boxes."""

    def __init__(self, search: BoxSearch[B, D], best: D, zero_level: float, tolerance: float, what: str) -> None:
        self.what, self.best, self.value = what, best, best.value
        self.witness = search.witness_of(best)
        self._search, self._zero_level, self._tolerance = search, zero_level, tolerance

    @property
    def level(self) -> float:
        """Smallest objective that designs in cut-off boxes may have [SI]; infinite if none is cut off."""
        return self._search.level(self.value)

    def contains_witness(self, box: B) -> bool:
        """Return True if the best design lies in a box."""
        return self._search.contains(box, self.best)

    def is_fathomed(self, node: OpenNode[B]) -> bool:
        """Return True if the gap between a box and the incumbent is closed."""
        gap = gap_of(self.value, node.bound, self._zero_level)
        # the bound of an exact box differs from its best design by no more than the tolerance of its program
        return gap <= GAP_SAFETY * self._tolerance or (gap < np.inf and node.part.is_exact)

    def branch(self, nodes: Sequence[OpenNode[B]]) -> BoundedParts[B]:
        """Yield the parts of a box with their bounds."""
        ((bound, _, box),) = nodes
        for part, design in self._search.parts(box, self.value):
            if design is not None and design.rank < self.best.rank:
                self.best, self.value, self.witness = design, design.value, self._search.witness_of(design)
            yield part if isinstance(part, FathomedPart) else (part.bound, part)
            if is_time_over():
                # the remaining parts have at least the bound of the box
                yield bound, box
                return


def divide_boxes(
    search: BoxSearch[B, D], root: B, best: D, zero_level: float, tolerance: float, maximum: int, what: str
) -> tuple[D, float, int]:
    """Search for the best design by dividing boxes until the lowest bound closes the gap to it.

    Parameters
    ----------
    root, best
        Box of all open numbers, and the first incumbent.
    zero_level, tolerance
        Objective that counts as zero [SI], and relative gap at which the search ends.
    maximum, what
        Largest number of boxes, and their name in progress reports.

    Returns
    -------
    The best design, the lower bound of all designs (infinite if none is feasible), and the number of boxes.
    """
    boxes = _Branching(search, best, zero_level, tolerance, what)
    bound = boxes.divide((root.bound, root), maximum)
    if boxes.witness is not None:
        thin = search.around(boxes.best)
        if thin is not None:
            boxes.witness.check_near(what, thin.level if isinstance(thin, FathomedPart) else thin.bound)
    return boxes.best, bound, boxes.node_count
