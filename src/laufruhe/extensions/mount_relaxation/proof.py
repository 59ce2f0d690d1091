"""What boxes of mounts prove by the forces of their springs: narrowed as far as that pays, then halved (E59)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.mount_relaxation.ends import Aims, ends_ahead
from laufruhe.extensions.mount_relaxation.open_mounts import is_lifted
from laufruhe.extensions.mount_relaxation.search import SpringBoxes
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.witness import EXCESS
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import EMPTY, NEARLY, Box, Divided, Halving, Over, Parts, Waiting, halves
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.provers import Prover, Question
from laufruhe.prove.mounts.subdivision import divides
from laufruhe.prove.witness import Known, check_around, thin

# shares of the value that are shown one after the other to be out of reach
LEVELS = (0.1, 0.05, 0.02, 0.01, 0.003, 0.0)
# relaxations where none are asked for, and how many times those that were needed so far have to be left for a level
MOST_RELAXED, AHEAD = 100, 3
# the same where odd multiples hide a mean: whole boxes alone are worth it
FIRST, FEW_RELAXED = (0.3, 0.2, 0.15), 40
# of a design that is one of many, what is shown first, because the others have to come to it too
OF_MANY = 0.04
# of the largest, pulls of sides that are not narrowed; of what is to be shown, what a round of these has to bring
LITTLE, PROGRESS = 0.1, 0.1
# share of a side from its end in which a design of the relaxation leaves nothing to win there
WON = 0.3


def applies(problem: Problem) -> bool:
    """Return whether forces of springs bound something that boxes of one number do not."""
    alone = len(problem.decisions) == 1 and not divides(problem)
    return not alone and not simulated_measures(problem) and is_bounded(named_part(problem))


def bounds(question: Question) -> Iterator[Divided]:
    """Yield bounds, where stiffness alone is open that of all that is open first."""
    asked = question.problem, question.value, question.room, question.near
    alone = divides(question.problem)
    for whole in (True, False) if alone else (False,):
        found = spring_bound(*asked, question.of_many, whole, question.known)
        if not found.boxes:
            return
        yield found if alone else replace(found, places=())


SPRINGS = Prover("boxes of mounts and modes, by spring forces", applies, bounds, "boxes of stiffness")


def spring_bound(
    problem: Problem, value: float, room: float, near: Sequence[Value], of_many: bool = False,
    whole: bool = False, known: Known | None = None,
) -> Divided:  # fmt: skip
    """Divide the bounds until no design is more than `room` better than `value`, or as often as is worth it.

    Parameters
    ----------
    value
        Objective of the best design known; nothing is done where none is.
    room
        Difference that counts as none [SI].
    near
        Decisions of a design near which most boxes will be.
    of_many
        Whether the same will be asked of other problems, so that a bound that is nearly as good comes first.
    whole
        Whether all that is open is looked at alone.
    known
        The best design, the witness of bounds.
    """
    problem = named_part(problem)
    if not is_bounded(problem) or not 0.0 < value < math.inf:
        return Divided(0.0, 0)
    try:
        with ends_ahead() as ahead:
            boxes = SpringBoxes(with_default_sampling(problem), value, room, near, ahead)
            if not boxes.most_boxes or not boxes.is_sampled_fully:
                return Divided(0.0, 0)
            ladder = _ladder(boxes, of_many)
            return _by_levels(boxes, room, replace(ladder, most=1) if whole else ladder, known)
    except np.linalg.LinAlgError:
        # a middle on a resonance that nothing damps
        return Divided(0.0, 0)


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin boxes of mounts, all modes in them, for designs that are no better than the best known."""

    boxes: SpringBoxes
    known: Known
    what: str = "spring forces"

    def around(self, place: Array) -> tuple[Array, Array]:
        """Return a thin box of numbers of mounts; what else is divided keeps its bounds."""
        lower, upper = self.boxes.lower.copy(), self.boxes.upper.copy()
        own = slice(0, len(place))
        lower[own], upper[own] = thin(place, lower[own], upper[own])
        return lower, upper

    def bound(self, box: tuple[Array, Array]) -> float:
        """Return the bound of a box, for designs that are not over the value by more than a rounding."""
        return self.boxes.up_to(self.known.most * (1.0 + EXCESS)).look(*box)[0]


def is_bounded(problem: Problem) -> bool:
    """Whether all that is minimised are forces or travel, and what is open is in the relaxation."""
    on_mounts = any(term.measure.on_mounts for term in problem.load_terms)
    return on_mounts and not problem.mount_terms and is_lifted(problem)


@dataclass(frozen=True)
class _Ladder:
    """Shares of the value that are shown one after the other to be out of reach, in so many relaxations at most."""

    shares: tuple[float, ...]
    most: int

    @property
    def look(self) -> float:
        """With which the whole is looked at before all: the first that says much of the best design."""
        return next(share for share in self.shares if share <= LEVELS[0])


def _ladder(boxes: SpringBoxes, of_many: bool) -> _Ladder:
    """Straight for the value, but where a box tells little of it: where modes count, or odd multiples hide a mean."""
    if boxes.modes:
        found = _Ladder(LEVELS, MOST_RELAXED)
    elif boxes.takes_off:
        found = _Ladder((*FIRST, *LEVELS), FEW_RELAXED)
    else:
        found = _Ladder((OF_MANY, 0.0) if of_many else (0.0,), boxes.most_boxes)
    return replace(found, most=boxes.problem.search.boxes_or(found.most))


def _by_levels(boxes: SpringBoxes, room: float, ladder: _Ladder, known: Known | None) -> Divided:
    """Show that no design is under a value, and then under one that is nearer to that of the best (E59)."""
    first = _under(boxes, ladder.look, room, known)
    looked = first.look(boxes.lower, boxes.upper)
    if known is not None and first.level > known.most:
        known.check(_Narrowing.what, looked[0])
    # what is shown is so of designs that are not over the level
    bound, spent, places = min(looked[0], first.level), 1, tuple[Array, ...]()
    for share in ladder.shares:
        shown, left = _level(boxes, share, room), ladder.most - spent
        if shown <= bound:
            continue
        if (spent > 1 and AHEAD * spent > ladder.most) or left <= 0 or passed():
            break
        search = first if share == ladder.look else _under(boxes, share, room, known)
        narrowing = _Narrowing(search, left, known)
        if share == ladder.look:
            narrowing.looked = looked
        found = narrowing.run(narrowing.looked_at(boxes.lower, boxes.upper), left)
        spent += narrowing.spent
        bound = max(bound, found.bound)
        if found.bound < shown:
            places = found.places
            break
    if known is not None and 0.0 < bound < boxes.enough:
        # where the last level was shown, the box of the best design was compared with it
        check_around(_Around(first, known), known.place, known)
    count = len(boxes.problem.mount_decisions)
    kept = (*boxes.places, *places) if bound < boxes.enough else ()
    return Divided(bound, spent, tuple(place[:count] for place in kept))


def _under(boxes: SpringBoxes, share: float, room: float, known: Known | None) -> SpringBoxes:
    """Bound designs under a level; at the last one the best design itself is among them."""
    found = boxes.under(_level(boxes, share, room))
    return found if share or known is None else found.up_to(known.most * (1.0 + EXCESS))


def _level(boxes: SpringBoxes, share: float, room: float) -> float:
    return boxes.value - max(share * boxes.value, NEARLY * room)


class _Narrowing(Halving):
    """Boxes that are narrowed before they are halved.

    Attributes
    ----------
    spent
        Relaxations that were solved.
    looked
        What is known of the first of all boxes.
    """

    what = "boxes of mounts and modes, by spring forces"

    def __init__(self, search: SpringBoxes, most: int, known: Known | None) -> None:
        super().__init__(search.value, 0.0, known if known is not None and search.value > known.most else None)
        self._search, self._most, self.spent = search, most, 0
        self.looked: tuple[float, Array] | None = None

    @property
    def enough(self) -> float:
        """Bound from which a box holds no design that is worth looking for."""
        return self._search.enough

    def holds(self, box: Box) -> bool:
        """Return whether the known design lies in a box, whatever its modes are."""
        own, beside = slice(0, self._search.mount_numbers), slice(self._search.mount_numbers, None)
        kept = np.array_equal(box.lower[beside], self._search.lower[beside])
        kept = kept and np.array_equal(box.upper[beside], self._search.upper[beside])
        return kept and super().holds(Box(box.lower[own], box.upper[own], 0))

    @property
    def level(self) -> float:
        """All that is shown is so of designs that are not over it."""
        return self._search.level

    def looked_at(self, lower: Array, upper: Array, narrows: bool = True) -> tuple[float, Box] | Over:
        """A box as small as it becomes where it narrows, and its bound; or that it holds no better design."""
        before = best = -math.inf
        while True:
            kept = self._search.kept(lower, upper)
            if kept is None:
                return EMPTY
            lower, upper = kept
            (bound, pull), self.looked = self.looked or self._search.look(lower, upper), None
            self.spent += 1
            before, best = best, max(best, bound)
            if self.known is not None and self.holds(Box(lower, upper, 0)):
                self.known.check(self.what, best)
            if best >= self.enough:
                return Over(min(best, self.level))
            over = self.spent >= self._most or passed()
            if before > -math.inf:
                narrows = best - before >= PROGRESS * (self.enough - before)
            if over or not pull.any() or not narrows:
                return best, Box(lower, upper, int(np.argmax(pull)), narrows)
            found, solved = narrowed(self._search, lower, upper, pull)
            self.spent += solved
            if found is None:
                return Over(self.level)
            lower, upper = found

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | Over]:
        """Halves, each looked at by itself, and narrowed where that paid for the whole."""
        return [self.looked_at(*half, box.narrows) for box in boxes for half in halves(box)]

    def parts(self, taken: Sequence[Waiting[Box]]) -> Parts[Box]:
        """Halves; what counts are the relaxations."""
        found = [*super().parts(taken)]
        self.seen = self.spent
        return found


def narrowed(boxes: SpringBoxes, lower: Array, upper: Array, pull: Array) -> tuple[tuple[Array, Array] | None, int]:
    """A box without what the relaxation shows to hold no better design, none where that is all of it (E59).

    Of every side the least and the largest number that leave room for one, as multipliers prove them. Sides that hardly
    keep the relaxation from a design stay as they are, and so do ends at which the best design is.

    Returns
    -------
    The box, and how many relaxations that took.
    """
    program, mounts = boxes.left(lower, upper)
    numbers, count = program.numbers, boxes.own[0].start if boxes.own else len(lower)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    # numbers of shapes are not counted from the middle of a box
    middle[count:], half[count:] = 0.0, 1.0
    sides = [(j, side) for j, side in enumerate(mounts.straight) if side is not None]
    sides += [(numbers + k, count + k) for k in range(len(lower) - count)]
    own, along = np.array(sides, dtype=np.intp).reshape(-1, 2).T
    aims, units, solved = Aims(program, boxes.ahead), np.eye(numbers + len(lower) - count), 0
    # lower ends and upper ones, these with the other sign; and the nearest to them that designs of the relaxation have
    whole, seen = np.array([lower, -upper]), np.array([upper, -lower])
    ends = whole.copy()
    asked = [(*each, k) for each in sides if pull[each[1]] > LITTLE * pull.max() for k in (0, 1)]
    signs = (1.0, -1.0)

    def pays(side: int, k: int) -> bool:
        near = seen[k, side] - whole[k, side] < WON * (upper[side] - lower[side])
        return not near and not boxes.is_at(lower, upper, side, signs[k])

    for first, (number, side, k) in enumerate(asked):
        if not pays(side, k):
            continue
        aims.prefetch(((n, end), signs[end] * units[n]) for n, j, end in asked[first:] if pays(j, end))
        share, stands = aims.least((number, k), signs[k] * units[number])
        solved += 1
        ends[k, side] = max(ends[k, side], signs[k] * middle[side] + half[side] * share)
        if ends[:, side].sum() > 0.0:
            return None, solved
        at = middle[along] + half[along] * stands[own]
        seen[:, along] = np.minimum(seen[:, along], [at, -at])
    return (ends[0], -ends[1]), solved
