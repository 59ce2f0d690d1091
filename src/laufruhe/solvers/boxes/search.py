"""Branch and bound over boxes with a design from each box (P9)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Generic, Protocol, TypeVar

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


class BoxSearch(BranchAndBound[B], Generic[B, D]):
    """Branch and bound that stores the best design of all boxes; a subclass states boxes and designs.

    Attributes
    ----------
    best
        Best design so far.
    """

    best: D
    _zero_level: float
    _tolerance: float

    def parts(self, box: B, value: float) -> Iterator[tuple[B | FathomedPart, D | None]]:
        """Yield parts that together make up a box, each with a design in it, or None.

        A part is a box, or the proof that no design in it has an objective below a level. The objective of the
        incumbent is `value` [SI].
        """
        raise NotImplementedError

    def witness_of(self, _: D) -> Witness | None:
        """Return a design as a witness of bounds, or None if it violates limits."""
        raise NotImplementedError

    def around(self, _: D) -> B | FathomedPart | None:
        """Return a thin box around a design, with its bound; None if the method builds none."""
        raise NotImplementedError

    def is_fathomed(self, node: OpenNode[B]) -> bool:
        """Return True if the gap between a box and the incumbent is closed."""
        gap = gap_of(self.value, node.bound, self._zero_level)
        # the bound of an exact box differs from its best design by no more than the tolerance of its program
        return gap <= GAP_SAFETY * self._tolerance or (gap < math.inf and node.part.is_exact)

    def branch(self, nodes: Sequence[OpenNode[B]]) -> BoundedParts[B]:
        """Yield the parts of a box with their bounds."""
        ((bound, _, box),) = nodes
        for part, design in self.parts(box, self.value):
            if design is not None and design.rank < self.best.rank:
                self.best, self.value, self.witness = design, design.value, self.witness_of(design)
            yield part if isinstance(part, FathomedPart) else (part.bound, part)
            if is_time_over():
                # the remaining parts have at least the bound of the box
                yield bound, box
                return

    def search(self, root: B, best: D, zero_level: float, tolerance: float, maximum: int) -> tuple[D, float, int]:
        """Search for the best design by dividing boxes until the lowest bound closes the gap to it.

        Parameters
        ----------
        root, best
            Box of all open numbers, and the first incumbent.
        zero_level, tolerance
            Objective that counts as zero [SI], and relative gap at which the search ends.
        maximum
            Largest number of boxes.

        Returns
        -------
        The best design, the lower bound of all designs (infinite if none is feasible), and the number of boxes.
        """
        self.best, self.value, self.witness = best, best.value, self.witness_of(best)
        self._zero_level, self._tolerance = zero_level, tolerance
        bound = self.divide((root.bound, root), maximum)
        if self.witness is not None:
            thin = self.around(self.best)
            if thin is not None:
                self.witness.check_near(self.what, thin.level if isinstance(thin, FathomedPart) else thin.bound)
        return self.best, bound, self.node_count
