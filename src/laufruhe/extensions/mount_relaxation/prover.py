"""Prover of boxes of mounts by the forces of their springs: boxes are narrowed as far as it pays, then halved (E59)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import is_lifted
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.extensions.mount_relaxation.speculation import Objectives, bounds_ahead
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.witness import EXCESS
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import EMPTY, NEARLY, Box, BoxBisection, BoxResult, OpenNode, Over, Parts, halves
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.provers import Prover, Question
from laufruhe.prove.mounts.subdivision import divides
from laufruhe.prove.witness import Known, check_around, thin

# shares of the value that are proven to be out of reach, one after the other
LEVELS = (0.1, 0.05, 0.02, 0.01, 0.003, 0.0)
# relaxations by default, and how many times those spent so far have to be left for a further level
MOST_RELAXED, AHEAD = 100, 3
# the same where odd multiples hide a mean, so that halving gains little
FIRST, FEW_RELAXED = (0.3, 0.2, 0.15), 40
# first share for a design that is one of many, because the others have to reach it too
OF_MANY = 0.04
# least branching score of a narrowed side, as a share of the largest; least gain of a round, of the missing bound
LITTLE, PROGRESS = 0.1, 0.1
# share of a side from its end in which a design of the relaxation leaves nothing to cut off
WON = 0.3


def applies(problem: Problem) -> bool:
    """Return whether spring forces bound something that boxes of one number do not."""
    is_one_number = len(problem.decisions) == 1 and not divides(problem)
    return not is_one_number and not simulated_measures(problem) and is_bounded(named_part(problem))


def is_bounded(problem: Problem) -> bool:
    """Return whether the objective is forces or travel, and the relaxation has all open numbers."""
    on_mounts = any(term.measure.on_mounts for term in problem.load_terms)
    return on_mounts and not problem.mount_terms and is_lifted(problem)


def bounds(question: Question) -> Iterator[BoxResult]:
    """Yield bounds, where stiffness alone is open that of the root box first."""
    stiffness_alone = divides(question.problem)
    for root_only in (True, False) if stiffness_alone else (False,):
        divided = spring_bound(
            question.problem, question.value, question.room, question.near, question.of_many, root_only, question.known
        )
        if not divided.boxes:
            return
        yield divided if stiffness_alone else replace(divided, places=())


SPRINGS = Prover("boxes of mounts and modes, by spring forces", applies, bounds, "boxes of stiffness")


def spring_bound(
    problem: Problem, value: float, room: float, near: Sequence[Value], of_many: bool = False,
    root_only: bool = False, known: Known | None = None,
) -> BoxResult:  # fmt: skip
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
        Whether the same will be asked of other problems, so that a nearly as good bound comes first.
    root_only
        Whether the root box alone is bounded.
    known
        The best design, the witness of bounds.
    """
    problem = named_part(problem)
    if not is_bounded(problem) or not 0.0 < value < math.inf:
        return BoxResult(0.0, 0)
    try:
        with bounds_ahead() as ahead:
            relaxation = SdpRelaxation(with_default_sampling(problem), value, room, near, ahead)
            if not relaxation.max_boxes or not relaxation.is_sampled_fully:
                return BoxResult(0.0, 0)
            # straight for the value, but where a box shows little of it
            shares: tuple[float, ...]
            if relaxation.modes:
                shares, maximum = LEVELS, MOST_RELAXED
            elif relaxation.has_loose_mean:
                shares, maximum = (*FIRST, *LEVELS), FEW_RELAXED
            else:
                shares, maximum = (OF_MANY, 0.0) if of_many else (0.0,), relaxation.max_boxes
            maximum = 1 if root_only else problem.search.boxes_or(maximum)
            return _prove_levels(relaxation, room, shares, maximum, known)
    except np.linalg.LinAlgError:
        # a middle on a resonance that nothing damps
        return BoxResult(0.0, 0)


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin boxes of mounts, all modes in them, for designs that are no better than the best known."""

    relaxation: SdpRelaxation
    known: Known
    what: str = "spring forces"

    def around(self, place: Array) -> tuple[Array, Array]:
        """Return a thin box of numbers of mounts; the other sides keep their bounds."""
        lower, upper = self.relaxation.lower.copy(), self.relaxation.upper.copy()
        own = slice(0, len(place))
        lower[own], upper[own] = thin(place, lower[own], upper[own])
        return lower, upper

    def bound(self, box: tuple[Array, Array]) -> float:
        """Return the bound of a box, for designs that are not over the value by more than a rounding."""
        return self.relaxation.up_to(self.known.maximum * (1.0 + EXCESS)).bound(*box)[0]


def _prove_levels(
    relaxation: SdpRelaxation, room: float, shares: Sequence[float], maximum: int, known: Known | None
) -> BoxResult:
    """Prove that no design is under a value, and then under values nearer to that of the best (E59)."""

    def level_of(share: float) -> float:
        return relaxation.value - max(share * relaxation.value, NEARLY * room)

    def under(share: float) -> SdpRelaxation:
        # at the last level the best design itself is among the designs
        search = relaxation.under(level_of(share))
        return search if share or known is None else search.up_to(known.maximum * (1.0 + EXCESS))

    # the level that says much of the best design bounds the root box
    root_share = next(share for share in shares if share <= LEVELS[0])
    root_search = under(root_share)
    root_bound = root_search.bound(relaxation.lower, relaxation.upper)
    if known is not None and root_search.value > known.maximum:
        known.check(_Narrowing.what, root_bound[0])
    # a bound holds for designs that are not over the level
    bound, spent, places = min(root_bound[0], root_search.value), 1, tuple[Array, ...]()
    for share in shares:
        level, left = level_of(share), maximum - spent
        if level <= bound:
            continue
        if (spent > 1 and AHEAD * spent > maximum) or left <= 0 or passed():
            break
        is_root = share == root_share
        narrowing = _Narrowing(root_search if is_root else under(share), left, known, root_bound if is_root else None)
        divided = narrowing.run(narrowing.narrow(relaxation.lower, relaxation.upper), left)
        spent += narrowing.spent
        bound = max(bound, divided.bound)
        if divided.bound < level:
            places = divided.places
            break
    if known is not None and 0.0 < bound < relaxation.cutoff:
        # at the last level the box of the best design was compared with it
        check_around(_Around(root_search, known), known.place, known)
    count = relaxation.mount_numbers
    candidates = (*relaxation.candidates, *places) if bound < relaxation.cutoff else ()
    return BoxResult(bound, spent, tuple(place[:count] for place in candidates))


class _Narrowing(BoxBisection):
    """Boxes that are narrowed before they are halved.

    Attributes
    ----------
    spent
        Relaxations that were solved.
    """

    what = "boxes of mounts and modes, by spring forces"

    def __init__(
        self, search: SdpRelaxation, maximum: int, known: Known | None, root_bound: tuple[float, Array] | None
    ) -> None:
        super().__init__(search.value, 0.0, known if known is not None and search.value > known.maximum else None)
        self._search, self._maximum, self._root_bound, self.spent = search, maximum, root_bound, 0

    @property
    def cutoff(self) -> float:
        """Bound from which a box holds no design that is worth looking for."""
        return self._search.cutoff

    @property
    def level(self) -> float:
        """Objective up to which bounds hold."""
        return self._search.value

    def holds(self, box: Box) -> bool:
        """Return whether the known design lies in a box, whatever its modes are."""
        own, rest = slice(0, self._search.mount_numbers), slice(self._search.mount_numbers, None)
        is_full = np.array_equal(box.lower[rest], self._search.lower[rest])
        is_full = is_full and np.array_equal(box.upper[rest], self._search.upper[rest])
        return is_full and super().holds(Box(box.lower[own], box.upper[own], 0))

    def narrow(self, lower: Array, upper: Array, narrows: bool = True) -> tuple[float, Box] | Over:
        """Return a box as small as it becomes where it narrows, and its bound; or that it holds no better design."""
        before = best = -math.inf
        while True:
            part = self._search.contracted(lower, upper)
            if part is None:
                return EMPTY
            lower, upper = part
            (bound, scores), self._root_bound = self._root_bound or self._search.bound(lower, upper), None
            self.spent += 1
            before, best = best, max(best, bound)
            if self.known is not None and self.holds(Box(lower, upper, 0)):
                self.known.check(self.what, best)
            if best >= self.cutoff:
                return Over(min(best, self.level))
            if before > -math.inf:
                narrows = best - before >= PROGRESS * (self.cutoff - before)
            if self.spent >= self._maximum or passed() or not scores.any() or not narrows:
                return best, Box(lower, upper, int(np.argmax(scores)), narrows)
            box, solved = narrowed(self._search, lower, upper, scores)
            self.spent += solved
            if box is None:
                return Over(self.level)
            lower, upper = box

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | Over]:
        """Return the halves, narrowed where that paid for the whole."""
        return [self.narrow(*half, box.narrows) for box in boxes for half in halves(box)]

    def parts(self, taken: Sequence[OpenNode[Box]]) -> Parts[Box]:
        """Return the halves, and count relaxations in place of boxes."""
        parts = [*super().parts(taken)]
        self.seen = self.spent
        return parts


def narrowed(
    search: SdpRelaxation, lower: Array, upper: Array, scores: Array
) -> tuple[tuple[Array, Array] | None, int]:
    """Cut off what the relaxation proves to hold no better design (E59).

    Every side is bounded by the least and the largest number that leave room for a better design. Sides with a small
    score stay as they are, and so do ends at which the best design is.

    Returns
    -------
    The box, None where nothing of it is left, and the number of relaxations solved.
    """
    program, mounts = search.cut_off(lower, upper)
    numbers, count = program.numbers, search.mode_sides[0].start if search.modes else len(lower)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    # numbers of modes are not counted from the middle of a box
    middle[count:], half[count:] = 0.0, 1.0
    sides = [(j, side) for j, side in enumerate(mounts.straight) if side is not None]
    sides += [(numbers + k, count + k) for k in range(len(lower) - count)]
    variables, along = np.array(sides, dtype=np.intp).reshape(-1, 2).T
    objectives, units, solved = Objectives(program, search.ahead), np.eye(numbers + len(lower) - count), 0
    # lower ends, and upper ones with the other sign; and the nearest to them that designs of the relaxation have
    box, nearest = np.array([lower, -upper]), np.array([upper, -lower])
    ends = box.copy()
    tried = [(*each, k) for each in sides if scores[each[1]] > LITTLE * scores.max() for k in (0, 1)]
    signs = (1.0, -1.0)

    def pays(side: int, k: int) -> bool:
        is_near = nearest[k, side] - box[k, side] < WON * (upper[side] - lower[side])
        return not is_near and not search.is_at_end(lower, upper, side, signs[k])

    for first, (number, side, k) in enumerate(tried):
        if not pays(side, k):
            continue
        objectives.prefetch(((n, end), signs[end] * units[n]) for n, j, end in tried[first:] if pays(j, end))
        minimum, point = objectives.bound((number, k), signs[k] * units[number])
        solved += 1
        ends[k, side] = max(ends[k, side], signs[k] * middle[side] + half[side] * minimum)
        if ends[:, side].sum() > 0.0:
            return None, solved
        at = middle[along] + half[along] * point[variables]
        nearest[:, along] = np.minimum(nearest[:, along], [at, -at])
    return (ends[0], -ends[1]), solved
