"""Branch and bound: divide the set of designs into parts, lowest bound first, until no part can hold a better design.

A part is a set of designs. All proofs by division share this loop (T9, Z12, P8, P13, S29, S30, V13, E38, R4 to R7). The
loop sets the order of the parts, the limits of time and of the number of parts, the progress reports and the end. A
subclass states the parts and their bounds.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.witness import is_over
from laufruhe.prove.witness import Witness, thin_box

P = TypeVar("P")

# share of the gap tolerance that the search uses; the remainder covers rounding errors
GAP_SAFETY = 0.9
# smallest distance of a cut from both ends of a side, as a share of the side
CUT_MARGIN = 0.1
# largest number of remaining boxes whose midpoints a result lists
MAX_PLACES = 3


class OpenNode(NamedTuple, Generic[P]):
    """Set of designs that may be divided, with its lower bound [SI] and a sequence number.

    Nodes are ordered by bound, then by number, so that the earlier of two nodes with equal bounds comes first.
    """

    bound: float
    number: int
    part: P


@dataclass(frozen=True)
class FathomedPart:
    """Part that needs no division, because no design in it has an objective below a level [SI]."""

    level: float


INFEASIBLE_PART = FathomedPart(math.inf)
"""Part without any feasible design."""

BoundedParts: TypeAlias = Iterable[tuple[float, P] | FathomedPart]
"""Result of a division: a pair (lower bound [SI], part) for each part to divide further, or a fathomed part."""


class BranchAndBound(Generic[P]):
    """Search over parts in the order of their lower bounds; a subclass states the parts and bounds them.

    Attributes
    ----------
    what
        Name of the parts in progress reports and messages.
    batch_size
        Number of parts that are divided together.
    value
        Objective of the incumbent [SI]; infinite without one.
    witness
        Known design that checks the bound of every part that contains it, or None.
    reports_bounds
        Whether bounds are bounds of the objective, and appear in progress reports.
    node_count, open_nodes
        Number of parts bounded so far, the root included; heap of the parts that remain.
    complete
        Whether the search ended by its own criterion, and not by a limit of time or number.
    """

    what: str
    batch_size: int = 1
    value: float = math.inf
    witness: Witness | None = None
    reports_bounds: bool = True
    node_count: int
    open_nodes: list[OpenNode[P]]
    complete: bool
    _minimum: float

    @property
    def cutoff(self) -> float:
        """Level [SI]: a part is not divided if its lower bound is at least this level."""
        return self.value

    @property
    def level(self) -> float:
        """Lower bound of the objective of all designs that were cut off from parts [SI]; infinite if none were."""
        return math.inf

    def contains_witness(self, _: P) -> bool:
        """Return True if the witness lies in a part."""
        return False

    def propose(self, part: P) -> None:
        """Search for a better incumbent in the part with the lowest bound, or do nothing, as by default."""

    def is_fathomed(self, node: OpenNode[P]) -> bool:
        """Return True if neither this part nor any part with a higher bound need be divided."""
        raise NotImplementedError

    def branch(self, nodes: Sequence[OpenNode[P]]) -> BoundedParts[P]:
        """Divide parts, and yield smaller parts that together cover them."""
        raise NotImplementedError

    def next_nodes(self, count: int) -> Sequence[OpenNode[P]]:
        """Return up to `count` open nodes, lowest bound first."""
        return heapq.nsmallest(count, self.open_nodes)

    def divide(self, root: tuple[float, P] | FathomedPart, max_nodes: int) -> float:
        """Divide the root part until every part is fathomed, or a limit of number or time is reached.

        Parameters
        ----------
        root
            Lower bound [SI] and set of all designs as a pair, or a `FathomedPart` if that set needs no division.
        max_nodes
            Largest number of parts, the root included.

        Returns
        -------
        float
            The lowest bound of all parts that remain or were fathomed [SI], even if it is above the incumbent.
        """
        self.open_nodes, self.node_count, self._minimum = [], 1, math.inf
        if isinstance(root, FathomedPart):
            self._minimum = root.level
        else:
            self._check(*root)
            self.open_nodes.append(OpenNode(root[0], 0, root[1]))
        return self.resume(max_nodes)

    def resume(self, max_nodes: int) -> float:
        """Continue the branch and bound search up to `max_nodes` parts in total, and return its lower bound [SI]."""
        queue, self.complete = self.open_nodes, True
        while queue:
            self.propose(queue[0].part)
            if self.is_fathomed(queue[0]):
                break
            self.complete = self.node_count < max_nodes and not is_time_over()
            if not self.complete:
                break
            limits = (self.value, queue[0].bound) if self.reports_bounds else (math.inf, -math.inf)
            report_progress(self.what, self.node_count, 0, *limits)
            batch = [heapq.heappop(queue)]
            while queue and len(batch) < self.batch_size and not self.is_fathomed(queue[0]):
                batch.append(heapq.heappop(queue))
            for child in self.branch(batch):
                self.node_count += 1
                if isinstance(child, FathomedPart):
                    self._minimum = min(self._minimum, child.level)
                    continue
                bound, part = child
                self._check(bound, part)
                # the only place that drops parts because of the incumbent
                if bound < self.cutoff:
                    heapq.heappush(queue, OpenNode(bound, self.node_count, part))
                else:
                    self._minimum = min(self._minimum, bound)
        return min(queue[0].bound if queue else math.inf, self._minimum, self.level)

    def _check(self, bound: float, part: P) -> None:
        if self.witness is not None and is_over(bound, self.witness.value) and self.contains_witness(part):
            self.witness.check(self.what, bound)


class Box(NamedTuple):
    """Box of open numbers between bounds of shape (n,), with the index of the side to halve.

    Attributes
    ----------
    narrows
        Whether narrowing the sides of each half, before it is divided in turn, is expected to pay.
    """

    lower: Array
    upper: Array
    side: int
    narrows: bool = True


def halves(box: Box, cut: float | None = None) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Cut a box in two across its selected side, and return the bounds (lower, upper) of both parts.

    The cut is the middle, or a position moved at least `CUT_MARGIN` away from the ends of the side.
    """
    is_side, low, high = np.arange(len(box.lower)) == box.side, box.lower[box.side], box.upper[box.side]
    margin = CUT_MARGIN * (high - low)
    cut = 0.5 * (low + high) if cut is None else np.clip(cut, low + margin, high - margin)
    return (box.lower, np.where(is_side, cut, box.upper)), (np.where(is_side, cut, box.lower), box.upper)


def widest(lower: Array, upper: Array, root_width: Array) -> int:
    """Return the index of the longest side of a box, relative to the root box; all arguments have the shape (n,)."""
    return int(np.argmax((upper - lower) / np.maximum(root_width, 1e-300)))


@dataclass(frozen=True, eq=False)
class BoxResult:
    """Result of branch and bound over boxes of open numbers.

    Attributes
    ----------
    bound
        Lower bound of the objective over all designs [SI]; zero if nothing is known.
    boxes
        Number of boxes bounded.
    places
        Midpoints of the remaining boxes with the lowest bounds, each of shape (n,): start points for a search.
    """

    bound: float
    boxes: int
    places: tuple[Array, ...] = ()


class BoxBisection(BranchAndBound[Box]):
    """Bisection of boxes until none can hold a design better than `value` by more than `gap_tolerance` [SI]."""

    def __init__(self, value: float, gap_tolerance: float, witness: Witness | None = None) -> None:
        self.value, self.gap_tolerance, self.witness = value, gap_tolerance, witness

    @property
    def cutoff(self) -> float:
        """Lower bound of a box from which none of its designs is better by the gap tolerance [SI]."""
        return self.value - GAP_SAFETY * self.gap_tolerance if self.value < math.inf else math.inf

    def contains_witness(self, box: Box) -> bool:
        """Return True if the witness lies in a box."""
        place = None if self.witness is None else self.witness.place
        return place is not None and bool(np.all(box.lower <= place) and np.all(place <= box.upper))

    def is_fathomed(self, node: OpenNode[Box]) -> bool:
        """Return True if no design in the box is better than `value` by more than the gap tolerance."""
        return not node.bound < self.cutoff

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Return both halves of every box in order, each with its own bound, or fathomed."""
        raise NotImplementedError

    def branch(self, nodes: Sequence[OpenNode[Box]]) -> BoundedParts[Box]:
        """Yield the halves of boxes; no half has a bound below that of its box."""
        for k, half in enumerate(self.halve([node.part for node in nodes])):
            yield half if isinstance(half, FathomedPart) else (max(nodes[k // 2].bound, half[0]), half[1])

    def run(self, root: tuple[float, Box] | FathomedPart | None, max_boxes: int) -> BoxResult:
        """Divide the root box, or the remaining boxes if `root` is None, into at most `max_boxes` boxes in total."""
        bound = self.resume(max_boxes) if root is None else self.divide(root, max_boxes)
        lowest = [node.part for node in self.next_nodes(MAX_PLACES) if node.bound < self.cutoff]
        return BoxResult(bound, self.node_count, tuple(0.5 * (box.lower + box.upper) for box in lowest))


class BoxBounds(Protocol):
    """Lower bounds of the objective on several boxes at a time."""

    what: str

    @property
    def batch_size(self) -> int:
        """Number of boxes that are bounded together."""

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return the lower bounds of boxes [SI], infinite without a feasible design, and the sides to halve.

        Boxes have bounds `lower` and `upper` of shape (boxes, n), and the results the shape (boxes,).
        """


class BatchBisection(BoxBisection):
    """Bisection of boxes that a `BoxBounds` bounds in batches."""

    def __init__(self, bounder: BoxBounds, value: float, gap_tolerance: float, witness: Witness | None = None) -> None:
        super().__init__(value, gap_tolerance, witness)
        # the two halves of a box fill two places of a batch
        self._bounder, self.what, self.batch_size = bounder, bounder.what, -(-bounder.batch_size // 2)

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Halve all boxes, and return the halves with their lower bounds."""
        return [*self.bound_boxes([half for box in boxes for half in halves(box)])]

    def bound_boxes(self, boxes: Sequence[tuple[Array, Array]]) -> list[tuple[float, Box]]:
        """Return pairs (lower bound [SI], box) for boxes (lower, upper); each returned box has its side to halve."""
        lower, upper = (np.array([box[k] for box in boxes]) for k in (0, 1))
        results = zip(boxes, *self._bounder.bounds(lower, upper), strict=True)
        return [(float(bound), Box(*box, int(side))) for box, bound, side in results]

    def check_near(self, lower: Array, upper: Array, witness: Witness) -> None:
        """Check the bound of a thin box around the witness, within the root box between `lower` and `upper`."""
        witness.check_near(self.what, self.bound_boxes([thin_box(witness.place, lower, upper)])[0][0])


def bisect_box(
    bounder: BoxBounds, lower: Array, upper: Array, value: float, gap_tolerance: float, max_boxes: int,
    witness: Witness | None = None,
) -> BoxResult:  # fmt: skip
    """Halve a box until no part can hold a design better than `value` by more than `gap_tolerance`.

    Parameters
    ----------
    bounder
        Method that returns lower bounds of the objective on boxes.
    lower, upper
        Bounds of the open numbers, shape (n,).
    value
        Objective of the incumbent [SI]; infinite without one.
    gap_tolerance
        Improvement that counts as none [SI].
    max_boxes
        Largest number of boxes.
    witness
        Known design that checks the bounds, or None.
    """
    return next(bisect_in_stages(bounder, lower, upper, value, gap_tolerance, max(max_boxes, 1), (1.0,), witness))


def bisect_in_stages(
    bounder: BoxBounds, lower: Array, upper: Array, value: float, gap_tolerance: float, max_boxes: int,
    shares: Sequence[float], witness: Witness | None = None,
) -> Iterator[BoxResult]:  # fmt: skip
    """Yield the result of `bisect_box` after each share of `max_boxes` boxes; yield nothing if `max_boxes` is zero.

    The shares rise and are at most one. The other parameters are those of `bisect_box`.
    """
    bisection = BatchBisection(bounder, value, gap_tolerance, witness)
    for k, share in enumerate(shares if max_boxes else ()):
        root = None if k else bisection.bound_boxes([(lower, upper)])[0]
        result = bisection.run(root, math.ceil(share * max_boxes))
        if witness is not None and not k:
            bisection.check_near(lower, upper, witness)
        yield result
