"""A lower bound of mount forces, travel and transmissibility by dividing the bounds of stiffness into boxes (E38-E40).

On a box every quantity has a linear function under it that differs from it by the square of the box's size. Boxes
whose least value is not under the design found, or on which a limit cannot be kept, are dropped, the others halved:
the least value on what is left bounds the objective of every design allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.processes import call_by_name
from laufruhe.problem import channels
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import NEARLY, Divided, divided_on
from laufruhe.prove.mounts.box_lines import BoxLines
from laufruhe.prove.mounts.box_norms import Under, under
from laufruhe.prove.mounts.box_numbers import RANGES, SAID, UNDER, breaks
from laufruhe.prove.mounts.box_response import BoxModel, Lines
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.ranges import SLACK
from laufruhe.prove.mounts.ratios import groups_of, is_ratio, ratio_under
from laufruhe.prove.witness import Known

# open numbers that are divided without being asked for, and what all boxes may cost together
MOST_OPEN = 6
WORK = 2e7
MOST_BOXES = 60_000
# numbers held at once
HELD = 3e6
# numbers of a motion in time that cost as much as one of an order
SIMULATED_SHARE = 18
# of the gap that counts as proven, what small orders may take of it
LEFT_OUT = 0.05
# of the length of a side, what counts where nothing is told of it
EVEN = 1e-12


def divides(problem: Problem) -> bool:
    """Whether stiffness alone is open, and more of it is never less of a mount's own."""
    stiffness = all(d.is_stiffness and all(drive.gain > 0.0 for drive in d.mount_drives) for d in problem.decisions)
    return bool(problem.decisions) and stiffness


def divided_bounds(
    problem: Problem, value: float, room: float, shares: Sequence[float], known: Known | None = None
) -> Iterator[Divided]:  # fmt: skip
    """Yield bounds of boxes, each after a share of what is worth it, until none is `room` better than `value`.

    Parameters
    ----------
    problem
        That `divides`.
    value
        Objective of the best design known; infinite where none is, and then the bound tells whether there is one.
    room
        Difference that counts as none [SI].
    shares
        Of the boxes that are worth it.
    known
        The design, the witness of bounds.
    """
    search = StiffnessBoxes(problem, LEFT_OUT * room, value - NEARLY * room if value < math.inf else math.inf)
    most = search.most_boxes
    if most and search.is_sampled_fully:
        counts = [math.ceil(share * most) for share in shares]
        yield from divided_on(search, search.model.lower, search.model.upper, value, room, counts, known)


def worth_halving(pull: Array, lower: Array, upper: Array) -> NDArray[np.intp]:
    """Of every box the side that pulls most; the longest where nothing is told."""
    return np.asarray(np.argmax(np.nan_to_num(pull) + EVEN * (upper - lower) / upper.max(), axis=1))


class SimulatedBoxes(Protocol):
    """Bounds of simulated measures over boxes of stiffness."""

    measures: tuple[Measure, ...]

    @property
    def cost(self) -> int:
        """Work of one box, in numbers."""

    def under(self, measure: Measure, lower: Array, upper: Array, asked: Mask | None = None, /) -> Under:
        """Return linear functions under a measure on boxes, shapes (boxes, open numbers), or on those asked for."""


def simulated_boxes(model: BoxModel) -> SimulatedBoxes | None:
    """Return the bounds of the simulated measures of a problem; None where nothing bounds them."""
    measures = simulated_measures(model.problem)
    if not measures:
        return None
    found: SimulatedBoxes | None = call_by_name(f"{measures[0].channel.simulation}:boxes", model, measures)
    return found


class StiffnessBoxes:
    """Bounds of boxes.

    Attributes
    ----------
    constant
        Of the objective: loads of the block and masses are the same on all mounts.
    simulated
        Bounds of simulated measures; None where nothing bounds them.

    Parameters
    ----------
    left_out
        What small orders may take of the objective.
    enough
        Of a box whose bound comes to this no more is asked.
    """

    what = "boxes of stiffness"

    def __init__(self, problem: Problem, left_out: float, enough: float = math.inf) -> None:
        self.enough = enough
        self.problem = problem = with_default_sampling(named_part(problem))
        evaluation = evaluate_start(problem)
        self.model = BoxModel(problem, evaluation)
        terms = [term for term in problem.load_terms if term.measure.on_mounts]
        kinds = {decision.kind for decision in problem.decisions}
        rest = [term for term in problem.load_terms if not depends(term.measure.channel, kinds, problem)]
        self.constant = sum(term.weight * evaluation.value(term.measure) for term in rest)
        share = left_out / max(sum(term.weight for term in terms), 1e-300)
        self._terms = [(term.weight, term.measure, *_felt(self.model, term.measure, share)) for term in terms]
        self._limits = [
            (limit.maximum * (1.0 + SLACK), limit.measure, *_felt(self.model, limit.measure, SLACK * limit.maximum))
            for limit in problem.limits
            if limit.measure.on_mounts
        ]
        numbers = [limit for limit in problem.mount_limits if math.isfinite(limit.maximum)]
        self._priced = [limit for limit in numbers if limit.measure.channel in UNDER]
        self.simulated = simulated_boxes(self.model)

    @property
    def is_sampled_fully(self) -> bool:
        """Whether sums of squares over orders are those over samples, as the rests suppose."""
        return all(self.model.samples_fully(lines) for _, _, lines, _ in (*self._terms, *self._limits))

    @property
    def _cost(self) -> int:
        mounts = len(self.problem.engine.mounts)
        lines = sum(len(lines.omegas) for _, _, lines, _ in (*self._terms, *self._limits))
        ratios = [term.measure for term in self.problem.mount_terms]
        lines += sum(2 * len(self._ratio_lines(q).omegas) for q in ratios if is_ratio(q))
        simulated = self.simulated.cost // SIMULATED_SHARE if self.simulated is not None else 0
        return max(lines, 1) * len(self.problem.decisions) ** 2 * max(mounts, 2) + simulated

    @property
    def at_once(self) -> int:
        """Boxes of one round."""
        return int(np.clip(HELD / (3.0 * self._cost), 2, 64))

    @property
    def most_boxes(self) -> int:
        """As many as asked for, or as a few seconds allow."""
        few = len(self.problem.mount_decisions) <= MOST_OPEN
        return self.problem.search.boxes_or(int(min(WORK / self._cost, MOST_BOXES)) if few else 0)

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least objective on every box, infinite where no design is allowed; and the side worth halving."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return self._bounds(lower, upper)

    def _bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        boxes, pull, size = BoxLines.of(lower), np.zeros_like(lower), np.full(len(lower), self.constant)
        for weight, quantity, lines, left_out in self._terms:
            at = self.model.expanded(lines, lower, upper)
            least = under(self.model, quantity, lines, at)
            boxes.add(weight, least, left_out)
            pull, size = pull + weight * least.bends, size + weight * least.value
        self.hold(boxes, lower, upper)
        numbers, pulled = self._numbers(lower, upper)
        broken = self.breaks(lower, upper)
        found = self.constant + numbers + boxes.least
        pull = (pull + pulled) / np.where(size + numbers > 0.0, size + numbers, 1.0)[:, None]
        # simulations cost most, and tell nothing of boxes that are ruled out
        left = np.flatnonzero(~broken & (found < self.enough))
        if self.simulated is not None and len(left):
            own = boxes.kept(left)
            pull[left] = np.maximum(pull[left], self.add_simulated(own, lower[left], upper[left]))
            found[left] = self.constant + numbers[left] + own.least
            boxes.pulls.append(np.zeros_like(pull))
            boxes.pulls[-1][left] = own.pull
        if math.isinf(self.enough):
            # without a known design the question is whether the limits can be kept
            pull = boxes.pull
        found = np.where(broken, np.inf, found)
        return found, worth_halving(pull, lower, upper)

    def hold(self, boxes: BoxLines, lower: Array, upper: Array) -> None:
        """Add limits that have linear functions under them, simulated ones left out."""
        for maximum, quantity, lines, left_out in self._limits:
            least = under(self.model, quantity, lines, self.model.expanded(lines, lower, upper))
            boxes.hold(least, left_out, maximum)
        for limit in self._priced:
            least = UNDER[limit.measure.channel](self.model, limit.measure, lower, upper)
            boxes.hold(least, 0.0, limit.maximum * (1.0 + SLACK))

    def add_simulated(self, boxes: BoxLines, lower: Array, upper: Array) -> Array:
        """Add what simulations tell of boxes (E65); return the pull of sides, shape (boxes, open numbers)."""
        assert self.simulated is not None
        pull, problem = np.zeros_like(lower), self.problem
        weights = {term.measure: term.weight for term in problem.objective}
        for measure in self.simulated.measures:
            # one limit that is broken is enough
            found = self.simulated.under(measure, lower, upper, boxes.excess <= 0.0)
            boxes.add(weights.get(measure, 0.0), found)
            for limit in problem.limits:
                if limit.measure == measure:
                    boxes.hold(found, 0.0, limit.maximum * (1.0 + SLACK))
            pull = np.maximum(pull, found.bends / np.where(found.value > 0.0, found.value, 1.0)[:, None])
        return pull

    def _numbers(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Least of what numbers of the mounts are in the objective, and the pull of sides."""
        found, pull = np.zeros(len(lower)), np.zeros_like(lower)
        for asked, weight in ((term.measure, term.weight) for term in self.problem.mount_terms):
            if is_ratio(asked):
                ratio, pulled = self._ratio(asked, lower, upper)
                found, pull = np.asarray(found + weight * ratio), pull + weight * pulled
            else:
                found = np.asarray(found + weight * RANGES[asked.channel](self.model, asked, lower, upper)[0])
        return found, pull

    def breaks(self, lower: Array, upper: Array) -> Mask:
        """Boxes on which a limit of a number of the mounts is broken everywhere, beside what `hold` says."""
        out = np.zeros(len(lower), dtype=bool)
        for limit in self.problem.mount_limits:
            if is_ratio(limit.measure):
                out |= self._ratio(limit.measure, lower, upper)[0] > limit.maximum * (1.0 + SLACK)
            elif limit.measure.channel not in SAID:
                out |= breaks(self.model, limit, lower, upper)
        return out

    # transmissibility

    def _ratio_lines(self, quantity: Measure) -> Lines:
        counted = Measure(channels.MOUNT_FORCE, NORMS["rms"], points=quantity.points, orders=quantity.orders)
        lines = self.model.lines(counted)
        return lines.kept(lines.omegas > 0.0)

    def _ratio(self, quantity: Measure, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Least transmissibility on every box (E40)."""
        lines = self._ratio_lines(quantity)
        rows = np.arange(3 * len(self.problem.engine.mounts), dtype=np.intp)
        at, still = (self.model.expanded(each, lower, upper) for each in (lines, lines.still()))
        over, firm = (
            self.model.answer(each, expansion, channels.MOUNT_FORCE, rows, np.ones(len(rows)))
            for each, expansion in ((lines, at), (lines.still(), still))
        )
        return ratio_under(over, firm, groups_of(quantity, self.problem.points, lines))


def _felt(model: BoxModel, quantity: Measure, budget: float) -> tuple[Lines, float]:
    """Lines without those that together do less than a budget anywhere, and what they do (E41)."""
    lines = model.lines(quantity)
    factor = max(quantity.direction_weights or (1.0,))
    felt = factor * model.felt_at_most(lines, quantity.channel)
    order = np.argsort(felt, kind="stable")
    # the sum is over any root of squares, so it serves every norm
    together = np.cumsum(felt[order])
    kept = np.ones(len(felt), dtype=bool)
    out = order[together <= budget]
    kept[out] = False
    # a peak to peak is twice a largest length at most
    return lines.kept(kept), (2.0 if quantity.norm.is_diameter else 1.0) * float(felt[out].sum())
