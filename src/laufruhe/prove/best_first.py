"""Best first: what is open is divided, the part with the least bound first, until nothing better can be left.

The one loop of all that is proven so (T9, Z12, P8, P13, S29, S30, V13, E38, R4 to R7): its order, its limits of time
and parts, what it tells who waits, and its end. A method says what its parts are, and what bounds them.
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
from laufruhe.numerics.budget import passed
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.witness import is_over
from laufruhe.prove.witness import Known, check_around, thin

P = TypeVar("P")

# of the difference that counts as none, what is left for roundings
NEARLY = 0.9
# of a side, that a cut keeps from its ends
EDGE = 0.1
# boxes whose middles are told
MOST_PLACES = 3


class OpenNode(NamedTuple, Generic[P]):
    """A part, what no design in it goes under, and the place in which it came: of two alike the earlier goes first."""

    bound: float
    number: int
    part: P


@dataclass(frozen=True)
class Over:
    """Answer of a bound that leaves nothing of a part to divide: no design in it is under a level."""

    level: float


EMPTY = Over(math.inf)
"""No design in a part is allowed."""

Parts: TypeAlias = Iterable[tuple[float, P] | Over]
"""Parts with their raw bounds, or what is proven of a part of which nothing is left to divide."""


class BranchAndBound(Generic[P]):
    """Parts of what is open; a method says what they are, and what bounds them.

    Attributes
    ----------
    what
        Is divided, in words.
    at_once
        Parts that are divided in one round.
    value
        Objective of the best design known; infinite where none is.
    cutoff
        Parts that are not under it are not divided.
    level
        No design that bounds cut off from a part is under it.
    known
        A design whose part no bound may be over.
    of_objective
        Whether bounds are of the objective, and told to who waits.
    seen
        Parts that were looked at.
    waiting
        Parts that are left.
    complete
        Whether it ended by itself, and not for want of time or parts.
    """

    what: str
    at_once: int = 1
    value: float = math.inf
    known: Known | None = None
    of_objective: bool = True
    seen: int
    waiting: list[OpenNode[P]]
    complete: bool
    _minimum: float

    @property
    def cutoff(self) -> float:
        """Bound from which a part is not divided."""
        return self.value

    @property
    def level(self) -> float:
        """Least objective that designs may have which bounds cut off; infinite where none are."""
        return math.inf

    def holds(self, _: P) -> bool:
        """Return whether the known design lies in a part."""
        return False

    def look(self, part: P) -> None:
        """Seek a design in a part whose turn it is."""

    def is_fathomed(self, one: OpenNode[P]) -> bool:
        """Return True if neither this part nor any part with a higher bound need be divided."""
        raise NotImplementedError

    def parts(self, taken: Sequence[OpenNode[P]]) -> Parts[P]:
        """Parts that cover those taken."""
        raise NotImplementedError

    def coming(self, count: int) -> Sequence[OpenNode[P]]:
        """Return the next `count` waiting parts, or fewer, lowest bound first."""
        return heapq.nsmallest(count, self.waiting)

    def divide(self, root: tuple[float, P] | Over, maximum: int) -> float:
        """Divide parts until the least bound is high enough, no part is left, or as often as is worth it.

        Parameters
        ----------
        root
            Bound of all that is open, and that; or that nothing is left of it.
        maximum
            Parts, the root one of them.

        Returns
        -------
        What no design goes under, raw: the least of the bounds of all parts that are left, or were not worth dividing.
        """
        self.waiting, self.seen, self._minimum = [], 1, math.inf
        if isinstance(root, Over):
            self._minimum = root.level
        else:
            self._check(*root)
            self.waiting.append(OpenNode(root[0], 0, root[1]))
        return self.further(maximum)

    def further(self, maximum: int) -> float:
        """The same with what waits, up to so many parts in all."""
        queue, self.complete = self.waiting, True
        while queue:
            self.look(queue[0].part)
            if self.is_fathomed(queue[0]):
                break
            self.complete = self.seen < maximum and not passed()
            if not self.complete:
                break
            known = (self.value, queue[0].bound) if self.of_objective else (math.inf, -math.inf)
            report_progress(self.what, self.seen, 0, *known)
            taken = [heapq.heappop(queue)]
            while queue and len(taken) < self.at_once and not self.is_fathomed(queue[0]):
                taken.append(heapq.heappop(queue))
            for found in self.parts(taken):
                self.seen += 1
                if isinstance(found, Over):
                    self._minimum = min(self._minimum, found.level)
                    continue
                bound, part = found
                self._check(bound, part)
                # the one place where parts are left out by what is known
                if bound < self.cutoff:
                    heapq.heappush(queue, OpenNode(bound, self.seen, part))
                else:
                    self._minimum = min(self._minimum, bound)
        return min(queue[0].bound if queue else math.inf, self._minimum, self.level)

    def _check(self, bound: float, part: P) -> None:
        if self.known is not None and is_over(bound, self.known.value) and self.holds(part):
            self.known.check(self.what, bound)


class Box(NamedTuple):
    """Open numbers between bounds, the side that is worth halving, and whether its halves are worth narrowing."""

    lower: Array
    upper: Array
    side: int
    narrows: bool = True


def halves(box: Box, at: float | None = None) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """A box cut in the middle of its side, or near a place on it, away from its ends."""
    here, low, high = np.arange(len(box.lower)) == box.side, box.lower[box.side], box.upper[box.side]
    keep = EDGE * (high - low)
    cut = 0.5 * (low + high) if at is None else np.clip(at, low + keep, high - keep)
    return (box.lower, np.where(here, cut, box.upper)), (np.where(here, cut, box.lower), box.upper)


def widest(lower: Array, upper: Array, whole: Array) -> int:
    """The side that is longest beside that of all that is open."""
    return int(np.argmax((upper - lower) / np.maximum(whole, 1e-300)))


@dataclass(frozen=True, eq=False)
class BoxResult:
    """Outcome of dividing the bounds of open numbers.

    Attributes
    ----------
    bound
        No design allowed has a smaller objective, raw; zero where nothing is known.
    boxes
        That were looked at.
    places
        Middles of the least of those that are left.
    """

    bound: float
    boxes: int
    places: tuple[Array, ...] = ()


class BoxBisection(BranchAndBound[Box]):
    """Boxes halved until none may hold a design that is `room` better than `value`."""

    def __init__(self, value: float, room: float, known: Known | None = None) -> None:
        self.value, self.room, self.known = value, room, known

    @property
    def cutoff(self) -> float:
        """Bound from which no design of a box is better by the room."""
        return self.value - NEARLY * self.room if self.value < math.inf else math.inf

    def holds(self, box: Box) -> bool:
        """Return whether the known design lies in a box."""
        at = None if self.known is None else self.known.place
        return at is not None and bool(np.all(box.lower <= at) and np.all(at <= box.upper))

    def is_fathomed(self, one: OpenNode[Box]) -> bool:
        """Return True if no design in the box beats the known value by more than the room."""
        return not one.bound < self.cutoff

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | Over]:
        """Halves of boxes and their own bounds, or what is proven of those of which nothing is left."""
        raise NotImplementedError

    def parts(self, taken: Sequence[OpenNode[Box]]) -> Parts[Box]:
        """Halves, of which none has a bound under that of the whole."""
        for k, found in enumerate(self.halved([one.part for one in taken])):
            yield found if isinstance(found, Over) else (max(taken[k // 2].bound, found[0]), found[1])

    def run(self, root: tuple[float, Box] | Over, maximum: int) -> BoxResult:
        """Divide the root box, and return the proven bound and the middles of the least boxes left."""
        return self.found(self.divide(root, maximum))

    def found(self, bound: float) -> BoxResult:
        """Return a result with this bound, the boxes seen, and the middles of the least boxes left."""
        minimum = [one.part for one in self.coming(MOST_PLACES) if one.bound < self.cutoff]
        places = tuple(0.5 * (box.lower + box.upper) for box in minimum)
        return BoxResult(bound, self.seen, places)


class BoxBounds(Protocol):
    """Lower bounds of the objective on many boxes at once."""

    what: str

    @property
    def at_once(self) -> int:
        """Boxes of one round."""

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least objective on every box, infinite where no design is allowed; and the side worth halving."""


class BoundedBoxes(BoxBisection):
    """Boxes with bounds found by someone else."""

    def __init__(self, search: BoxBounds, value: float, room: float, known: Known | None = None) -> None:
        super().__init__(value, room, known)
        # two halves make two boxes of a round
        self._search, self.what, self.at_once = search, search.what, -(-search.at_once // 2)

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | Over]:
        """Halve all boxes, and return the halves with their lower bounds."""
        return [*self.bounded([half for box in boxes for half in halves(box)])]

    def bounded(self, boxes: Sequence[tuple[Array, Array]]) -> list[tuple[float, Box]]:
        """Return pairs of lower bound and box, the box with the side worth halving."""
        lower, upper = (np.array([box[k] for box in boxes]) for k in (0, 1))
        found = zip(boxes, *self._search.bounds(lower, upper), strict=True)
        return [(float(bound), Box(*box, int(side))) for box, bound, side in found]


@dataclass(frozen=True, eq=False)
class Around:
    """Bounder of thin boxes, by whoever bounds boxes."""

    search: BoxBounds
    lower: Array
    upper: Array

    @property
    def what(self) -> str:
        """Name of the parts that are bounded."""
        return self.search.what

    def around(self, place: Array) -> tuple[Array, Array]:
        """Return a thin box around a place."""
        return thin(place, self.lower, self.upper)

    def bound(self, box: tuple[Array, Array]) -> float:
        """Return the bound of a box."""
        low, high = box
        return float(self.search.bounds(low[None], high[None])[0][0])


def divide(
    search: BoxBounds, lower: Array, upper: Array, value: float, room: float, maximum: int, known: Known | None = None
) -> BoxResult:  # fmt: skip
    """Halve boxes, the least first, until none may hold a design that is `room` better than `value`."""
    return next(divide_in_rounds(search, lower, upper, value, room, [maximum], known))


def divide_in_rounds(
    search: BoxBounds, lower: Array, upper: Array, value: float, room: float, maximum: Sequence[int],
    known: Known | None = None,
) -> Iterator[BoxResult]:  # fmt: skip
    """The same up to each of these numbers of boxes, one after the other."""
    division = BoundedBoxes(search, value, room, known)
    for k, count in enumerate(maximum):
        found = (
            division.found(division.further(count)) if k else division.run(division.bounded([(lower, upper)])[0], count)
        )
        if known is not None and not k:
            check_around(Around(search, lower, upper), known.place, known)
        yield found
