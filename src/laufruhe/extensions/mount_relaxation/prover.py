"""Prover of boxes of elastic mounts by spring forces: narrow each box while it pays, then halve it (E59)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.mount_relaxation.cone_program import ROUGH, ConeProgram
from laufruhe.extensions.mount_relaxation.open_mounts import is_lifted
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.witness import EXCESS
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import (
    GAP_SAFETY,
    BoundedParts,
    Box,
    BoxBisection,
    BoxResult,
    FathomedPart,
    OpenNode,
    halves,
)
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.provers import Prover, Question
from laufruhe.prove.mounts.subdivision import is_stiffness_problem
from laufruhe.prove.witness import Witness, thin_box

# relative gaps to prove, one after the other
LEVELS = (0.1, 0.05, 0.02, 0.01, 0.003, 0.0)
# most relaxations by default; a further level starts only if at most 1 / AHEAD of them are spent
MAX_RELAXED, AHEAD = 100, 3
# further first gaps, and most relaxations, where odd multiples loosen the bound of a mean: halving gains little
FIRST, FEW_RELAXED = (0.3, 0.2, 0.15), 40
# first relative gap of one design of many: bounds of the other designs limit the total bound
IN_BATCH = 0.04
# smallest score of a side to narrow, over the largest score; smallest gain of a round, over the missing bound
MIN_SCORE, PROGRESS = 0.1, 0.1
# share of a side: a point of the relaxation this near to the end leaves little to cut off
END_SHARE = 0.3


def applies(problem: Problem) -> bool:
    """Return True if the spring relaxation may bound better than boxes of one open number."""
    is_one_number = len(problem.decisions) == 1 and not is_stiffness_problem(problem)
    return not is_one_number and not simulated_measures(problem) and is_bounded(named_part(problem))


def is_bounded(problem: Problem) -> bool:
    """Return True if the objective has mount forces or travel, and the relaxation covers all open numbers."""
    on_mounts = any(term.measure.on_mounts for term in problem.load_terms)
    return on_mounts and not problem.mount_terms and is_lifted(problem)


def bounds(question: Question) -> Iterator[BoxResult]:
    """Yield lower bounds of the objective by semidefinite relaxation of open mounts.

    If stiffness alone is open, the bound of the root box comes first.
    """
    stiffness_alone = is_stiffness_problem(question.problem)
    for root_only in (True, False) if stiffness_alone else (False,):
        result = spring_bound(question, root_only)
        if not result.boxes:
            return
        yield result if stiffness_alone else replace(result, places=())


SPRINGS = Prover("boxes of mounts and modes, by spring forces", applies, bounds, "boxes of stiffness")


def spring_bound(question: Question, root_only: bool = False) -> BoxResult:
    """Return a lower bound of the objective by branch and bound with semidefinite relaxations.

    The search ends at the gap tolerance or at the largest number of relaxations, and after the root box if `root_only`.
    Without a positive finite objective of an incumbent the bound is 0. The good design sets the units of a relaxation.
    """
    problem, value, gap_tolerance = named_part(question.problem), question.value, question.gap_tolerance
    if not is_bounded(problem) or not 0.0 < value < math.inf:
        return BoxResult(0.0, 0)
    try:
        relaxation = SdpRelaxation(with_default_sampling(problem), value, gap_tolerance, question.good_values)
        if not relaxation.max_boxes or not relaxation.is_sampled_fully:
            return BoxResult(0.0, 0)
        # prove the tolerance at once, unless a box bounds little of the value
        shares: tuple[float, ...]
        if relaxation.modes:
            shares, maximum = LEVELS, MAX_RELAXED
        elif relaxation.has_loose_mean:
            shares, maximum = (*FIRST, *LEVELS), FEW_RELAXED
        else:
            shares, maximum = (IN_BATCH, 0.0) if question.in_batch else (0.0,), relaxation.max_boxes
        maximum = 1 if root_only else problem.search.boxes_or(maximum)
        return _prove_levels(relaxation, gap_tolerance, shares, maximum, question.witness)
    except np.linalg.LinAlgError:
        # the middle of a box stands on an undamped resonance
        return BoxResult(0.0, 0)


def _prove_levels(
    relaxation: SdpRelaxation, gap_tolerance: float, shares: Sequence[float], maximum: int, witness: Witness | None
) -> BoxResult:
    """Return the highest lower bound proven, by levels that rise towards the best design's objective (E59).

    `shares` are the relative gaps to prove one after the other; `maximum` is the most relaxations.
    """

    def level_of(share: float) -> float:
        return relaxation.value - max(share * relaxation.value, GAP_SAFETY * gap_tolerance)

    def under(share: float) -> SdpRelaxation:
        # the last level includes the best design itself
        search = relaxation.under(level_of(share))
        return search if share or witness is None else search.up_to(witness.upper_value * (1.0 + EXCESS))

    # the first level near the best design bounds the root box
    root_share = next(share for share in shares if share <= LEVELS[0])
    root_search = under(root_share)
    root_bound = root_search.bound(relaxation.lower, relaxation.upper)
    if witness is not None and root_search.value > witness.upper_value:
        witness.check(_Narrowing.what, root_bound[0])
    # a bound holds only for designs up to the level
    bound, spent, places = min(root_bound[0], root_search.value), 1, tuple[Array, ...]()
    for share in shares:
        level, remaining = level_of(share), maximum - spent
        if level <= bound:
            continue
        if (spent > 1 and AHEAD * spent > maximum) or remaining <= 0 or is_time_over():
            break
        is_root = share == root_share
        narrowing = _Narrowing(
            root_search if is_root else under(share), remaining, witness, root_bound if is_root else None
        )
        result = narrowing.run(narrowing.narrow(relaxation.lower, relaxation.upper), remaining)
        spent += narrowing.spent
        bound = max(bound, result.bound)
        if result.bound < level:
            places = result.places
            break
    if witness is not None and 0.0 < bound < relaxation.cutoff:
        # at the last level the best design checked the bounds of its boxes; now it checks a thin box around it,
        # with all mode shapes
        lower, upper, sides = root_search.lower.copy(), root_search.upper.copy(), slice(0, len(witness.place))
        lower[sides], upper[sides] = thin_box(witness.place, lower[sides], upper[sides])
        thin = root_search.up_to(witness.upper_value * (1.0 + EXCESS)).bound(lower, upper)[0]
        witness.check_near("spring forces", thin)
    places = places if bound < relaxation.cutoff else ()
    return BoxResult(bound, spent, tuple(place[: relaxation.mount_numbers] for place in places))


class _Narrowing(BoxBisection):
    """Bisection that narrows each box before it halves it.

    Attributes
    ----------
    spent
        Count of relaxations solved.
    """

    what = "boxes of mounts and modes, by spring forces"

    def __init__(
        self, search: SdpRelaxation, maximum: int, witness: Witness | None, root_bound: tuple[float, Array] | None
    ) -> None:
        super().__init__(
            search.value, 0.0, witness if witness is not None and search.value > witness.upper_value else None
        )
        self._search, self._maximum, self._root_bound, self.spent = search, maximum, root_bound, 0

    @property
    def cutoff(self) -> float:
        """Bound from which a box is fathomed [SI]."""
        return self._search.cutoff

    @property
    def level(self) -> float:
        """Objective up to which bounds hold [SI]."""
        return self._search.value

    def contains_witness(self, box: Box) -> bool:
        """Return True if the known design lies in a box that spans all mode shapes."""
        mount_sides, mode_sides = slice(0, self._search.mount_numbers), slice(self._search.mount_numbers, None)
        has_all_modes = np.array_equal(box.lower[mode_sides], self._search.lower[mode_sides])
        has_all_modes = has_all_modes and np.array_equal(box.upper[mode_sides], self._search.upper[mode_sides])
        return has_all_modes and super().contains_witness(Box(box.lower[mount_sides], box.upper[mount_sides], 0))

    def narrow(self, lower: Array, upper: Array, narrows: bool = True) -> tuple[float, Box] | FathomedPart:
        """Return the bound and the narrowed box, or `FathomedPart` if no design of the box is better.

        With `narrows` False the box is bounded once, and not narrowed.
        """
        previous = best = -math.inf
        while True:
            (bound, scores), self._root_bound = self._root_bound or self._search.bound(lower, upper), None
            self.spent += 1
            previous, best = best, max(best, bound)
            if self.witness is not None and self.contains_witness(Box(lower, upper, 0)):
                self.witness.check(self.what, best)
            if best >= self.cutoff:
                return FathomedPart(min(best, self.level))
            if previous > -math.inf:
                narrows = best - previous >= PROGRESS * (self.cutoff - previous)
            if self.spent >= self._maximum or is_time_over() or not scores.any() or not narrows:
                return best, Box(lower, upper, int(np.argmax(scores)), narrows)
            box, solved = narrowed(self._search, lower, upper, scores)
            self.spent += solved
            if box is None:
                return FathomedPart(self.level)
            lower, upper = box

    def halve(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | FathomedPart]:
        """Return the halves of boxes, each narrowed if narrowing paid for its parent."""
        return [self.narrow(*half, box.narrows) for box in boxes for half in halves(box)]

    def branch(self, nodes: Sequence[OpenNode[Box]]) -> BoundedParts[Box]:
        """Return the bounded halves of nodes; each relaxation solved counts as a node."""
        parts = [*super().branch(nodes)]
        self.node_count = self.spent
        return parts


def narrowed(
    search: SdpRelaxation, lower: Array, upper: Array, scores: Array
) -> tuple[tuple[Array, Array] | None, int]:
    """Cut off the ends of a box that the relaxation proves to have no better design (E59).

    The minimum and the maximum of each side over better designs are its new ends. A side with a small branching score
    stays unchanged, and so does an end at which the best design lies.

    Returns
    -------
    The box, or None if it has no better design, and the count of relaxations solved.
    """
    program, mounts = search.cut_off(lower, upper)
    numbers, count = program.numbers, search.mode_sides[0].start if search.modes else len(lower)
    centre, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    # variables of modes are not scaled to the box
    centre[count:], half[count:] = 0.0, 1.0
    sides = [(j, side) for j, side in enumerate(mounts.single_decisions) if side is not None]
    sides += [(numbers + k, count + k) for k in range(len(lower) - count)]
    variables, side_indices = np.array(sides, dtype=np.intp).reshape(-1, 2).T
    cones, units, solved = ConeProgram(program, ROUGH), np.eye(numbers + len(lower) - count), 0
    # lower ends and negative upper ends; `nearest`: the nearest point of the relaxation to each end
    ends, nearest = np.array([lower, -upper]), np.array([upper, -lower])
    new_ends = ends.copy()
    candidates = [(*pair, k) for pair in sides if scores[pair[1]] > MIN_SCORE * scores.max() for k in (0, 1)]
    signs = (1.0, -1.0)

    def pays(side: int, k: int) -> bool:
        is_near = nearest[k, side] - ends[k, side] < END_SHARE * (upper[side] - lower[side])
        return not is_near and not search.is_at_end(lower, upper, side, signs[k])

    for number, side, k in candidates:
        if not pays(side, k):
            continue
        minimum, point = cones.minimum(signs[k] * units[number])
        solved += 1
        new_ends[k, side] = max(new_ends[k, side], signs[k] * centre[side] + half[side] * minimum)
        if new_ends[:, side].sum() > 0.0:
            return None, solved
        end_point = centre[side_indices] + half[side_indices] * point[variables]
        nearest[:, side_indices] = np.minimum(nearest[:, side_indices], [end_point, -end_point])
    return (new_ends[0], -new_ends[1]), solved
