"""Lower bounds of mount forces, travel and transmissibility by branch and bound over stiffnesses (E38-E40).

On a box every measure has a linear lower bound, with an error of second order in the size of the box. Boxes whose
bound is not below the incumbent, or that violate a limit, are dropped, and the others are halved. The lowest bound of
the remaining boxes is a lower bound of the objective of every feasible design.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

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
from laufruhe.prove.branch_and_bound import GAP_SAFETY, BoxResult, bisect_in_stages
from laufruhe.prove.mounts.box_norms import LinearRelaxation, is_ratio, lower_bound_of_norm, ratio_under
from laufruhe.prove.mounts.box_numbers import BOUNDED_LINEARLY, LINEAR_BOUNDS, RANGES, breaks
from laufruhe.prove.mounts.box_response import BoxModel, LoadedOrders
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.ranges import SLACK
from laufruhe.prove.witness import Witness

# open numbers up to which boxes are the default, and work of all boxes together
MAX_OPEN = 6
WORK = 2e7
MAX_BOXES = 60_000
# largest count of numbers in memory at a time
MEMORY = 3e6
# numbers of a simulation that cost as much as one number of an order
SIMULATED_SHARE = 18
# share of the gap tolerance for ignored small orders
LEFT_OUT = 0.05
# branching score of the relative length of a side, against ties
EVEN = 1e-12


def is_stiffness_problem(problem: Problem) -> bool:
    """Return True if only stiffnesses are open, and every spring is monotone in them."""
    stiffness = all(d.is_stiffness and all(drive.gain > 0.0 for drive in d.mount_drives) for d in problem.decisions)
    return bool(problem.decisions) and stiffness


def stiffness_bounds(
    problem: Problem, value: float, gap_tolerance: float, shares: Sequence[float], witness: Witness | None = None
) -> Iterator[BoxResult]:  # fmt: skip
    """Yield rising lower bounds of the objective by branch and bound over boxes of mount stiffness.

    The search ends when no design is better than `value` by the gap tolerance [SI].

    Parameters
    ----------
    value
        Objective of the incumbent [SI]. Without one it is infinite, and an infinite bound proves infeasibility.
    shares
        Rising shares of the box budget; a bound is yielded after each.
    witness
        Incumbent as the vector of its stiffnesses, to check bounds; None without an incumbent.
    """
    cutoff = value - GAP_SAFETY * gap_tolerance if value < math.inf else math.inf
    search = StiffnessBoxes(problem, LEFT_OUT * gap_tolerance, cutoff)
    ends = search.model.lower, search.model.upper
    yield from bisect_in_stages(search, *ends, value, gap_tolerance, search.max_boxes, shares, witness)


class StiffnessBoxes:
    """Lower bounds of objective and limits over boxes of stiffness.

    Attributes
    ----------
    constant
        Sum of the terms that do not depend on the mounts: loads of the block and masses [SI].
    simulated
        Bounds of simulated measures with `measures`, `cost` and `under(measure, lower, upper, mask)`, or None.

    Parameters
    ----------
    left_out
        Largest effect of ignored small orders on the objective [SI].
    cutoff
        Lower bound from which a box needs no simulations [SI]; infinite without an incumbent.
    """

    what = "boxes of stiffness"

    def __init__(self, problem: Problem, left_out: float, cutoff: float = math.inf) -> None:
        self.cutoff = cutoff
        self.problem = problem = with_default_sampling(named_part(problem))
        evaluation = evaluate_start(problem)
        self.model = BoxModel(problem, evaluation)
        terms = [term for term in problem.load_terms if term.measure.on_mounts]
        kinds = {decision.kind for decision in problem.decisions}
        rest = [term for term in problem.load_terms if not depends(term.measure.channel, kinds, problem)]
        self.constant = sum(term.weight * evaluation.value(term.measure) for term in rest)
        share = left_out / max(sum(term.weight for term in terms), 1e-300)
        self._terms = [(term.weight, term.measure, *_relevant_lines(self.model, term.measure, share)) for term in terms]
        limits = [(limit.maximum, limit.measure) for limit in problem.limits if limit.measure.on_mounts]
        self._limits = [(x * (1.0 + SLACK), m, *_relevant_lines(self.model, m, SLACK * x)) for x, m in limits]
        numbers = [limit for limit in problem.mount_limits if math.isfinite(limit.maximum)]
        self._priced = [limit for limit in numbers if limit.measure.channel in LINEAR_BOUNDS]
        # orders of each transmissibility
        self._ratios: dict[Measure, LoadedOrders] = {}
        for measure in filter(is_ratio, problem.measures):
            counted = Measure(channels.MOUNT_FORCE, NORMS["rms"], points=measure.points, orders=measure.orders)
            loaded_orders = self.model.loaded_orders(counted)
            self._ratios[measure] = loaded_orders.subset(loaded_orders.omegas > 0.0)
        measures = simulated_measures(problem)
        self.simulated: Any = (
            call_by_name(f"{measures[0].channel.simulation}:boxes", self.model, measures) if measures else None
        )

    @property
    def is_sampled_fully(self) -> bool:
        """Return True if sums of squares over orders equal those over samples, as the linear bounds suppose."""
        return all(loaded_orders.is_full for _, _, loaded_orders, _ in (*self._terms, *self._limits))

    @property
    def _cost(self) -> int:
        mounts = len(self.problem.engine.mounts)
        loaded_orders = sum(len(loaded_orders.omegas) for _, _, loaded_orders, _ in (*self._terms, *self._limits))
        ratios = [term.measure for term in self.problem.mount_terms]
        loaded_orders += sum(2 * len(self._ratios[q].omegas) for q in ratios if q in self._ratios)
        simulated = self.simulated.cost // SIMULATED_SHARE if self.simulated is not None else 0
        return max(loaded_orders, 1) * len(self.problem.decisions) ** 2 * max(mounts, 2) + simulated

    @property
    def batch_size(self) -> int:
        """Number of boxes that are bounded together."""
        return int(np.clip(MEMORY / (3.0 * self._cost), 2, 64))

    @property
    def max_boxes(self) -> int:
        """Largest number of boxes to bound: as the file requests, or by default enough for a few seconds."""
        if not self.is_sampled_fully:
            return 0
        is_tractable = len(self.problem.mount_decisions) <= MAX_OPEN
        return self.problem.search.boxes_or(int(min(WORK / self._cost, MAX_BOXES)) if is_tractable else 0)

    @np.errstate(invalid="ignore", over="ignore", divide="ignore")
    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return the lower bound of the objective on every box of stiffness [N/m], and the index of the side to halve.

        A bound is infinite if no design of its box is feasible.
        """
        boxes, scores, size = LinearRelaxation.zero(lower), np.zeros_like(lower), np.full(len(lower), self.constant)
        for weight, measure, loaded_orders, left_out in self._terms:
            expansion = self.model.expanded(loaded_orders, lower, upper)
            minimum = lower_bound_of_norm(self.model, measure, loaded_orders, expansion)
            boxes.add(weight, minimum, left_out)
            scores, size = scores + weight * minimum.scores, size + weight * minimum.value
        for maximum, measure, loaded_orders, left_out in self._limits:
            minimum = lower_bound_of_norm(
                self.model, measure, loaded_orders, self.model.expanded(loaded_orders, lower, upper)
            )
            boxes.add_limit(minimum, left_out, maximum)
        for limit in self._priced:
            minimum = LINEAR_BOUNDS[limit.measure.channel](self.model, limit.measure, lower, upper)
            boxes.add_limit(minimum, 0.0, limit.maximum * (1.0 + SLACK))
        numbers, score = self._numbers(lower, upper)
        violated = self._violated(lower, upper)
        bounds = self.constant + numbers + boxes.minimum
        scores = (scores + score) / np.where(size + numbers > 0.0, size + numbers, 1.0)[:, None]
        # simulations cost most, and come last
        remaining = np.flatnonzero(~violated & (bounds < self.cutoff))
        if self.simulated is not None and len(remaining):
            subset = boxes.subset(remaining)
            simulated_scores = self._add_simulated(subset, lower[remaining], upper[remaining])
            scores[remaining] = np.maximum(scores[remaining], simulated_scores)
            bounds[remaining] = self.constant + numbers[remaining] + subset.minimum
            boxes.pulls.append(np.zeros_like(scores))
            boxes.pulls[-1][remaining] = subset.pull
        if math.isinf(self.cutoff):
            # without an incumbent the question is whether the limits can be kept
            scores = boxes.pull
        sides = np.argmax(np.nan_to_num(scores) + EVEN * (upper - lower) / upper.max(), axis=1)
        return np.where(violated, np.inf, bounds), np.asarray(sides)

    def _add_simulated(self, boxes: LinearRelaxation, lower: Array, upper: Array) -> Array:
        """Add the bounds of run-ups and other simulated measures to the boxes, and return branching scores (E65).

        The scores have the shape (boxes, n); `boxes` collects the bounds of all terms and limits.
        """
        assert self.simulated is not None
        scores, problem = np.zeros_like(lower), self.problem
        weights = {term.measure: term.weight for term in problem.objective}
        for measure in self.simulated.measures:
            # a box that violates one limit needs no other
            minimum = self.simulated.under(measure, lower, upper, boxes.violation <= 0.0)
            boxes.add(weights.get(measure, 0.0), minimum)
            for limit in problem.limits:
                if limit.measure == measure:
                    boxes.add_limit(minimum, 0.0, limit.maximum * (1.0 + SLACK))
            scores = np.maximum(scores, minimum.scores / np.where(minimum.value > 0.0, minimum.value, 1.0)[:, None])
        return scores

    def _numbers(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        # lower bounds of mount numbers in the objective, and branching scores
        bounds, scores = np.zeros(len(lower)), np.zeros_like(lower)
        for term in self.problem.mount_terms:
            if term.measure in self._ratios:
                minimum, score = self._ratio(term.measure, lower, upper)
                scores = scores + term.weight * score
            else:
                minimum = np.asarray(RANGES[term.measure.channel](self.model, term.measure, lower, upper)[0])
            bounds = np.asarray(bounds + term.weight * minimum)
        return bounds, scores

    def _violated(self, lower: Array, upper: Array) -> Mask:
        # boxes that violate a limit of a mount number everywhere, shape (boxes,)
        violated = np.zeros(len(lower), dtype=bool)
        for limit in self.problem.mount_limits:
            if limit.measure in self._ratios:
                violated |= self._ratio(limit.measure, lower, upper)[0] > limit.maximum * (1.0 + SLACK)
            elif limit.measure.channel not in BOUNDED_LINEARLY:
                violated |= breaks(self.model, limit, lower, upper)
        return violated

    def _ratio(self, measure: Measure, lower: Array, upper: Array) -> tuple[Array, Array]:
        # lower bounds of a transmissibility, and branching scores (E40)
        loaded_orders = self._ratios[measure]
        rows = np.arange(3 * len(self.problem.engine.mounts), dtype=np.intp)
        loads = (loaded_orders, loaded_orders.at_rest())
        expansions = [self.model.expanded(orders, lower, upper) for orders in loads]
        elastic, rigid = (
            self.model.linear_response(orders, expansion, channels.MOUNT_FORCE, rows, np.ones(len(rows)))
            for orders, expansion in zip(loads, expansions, strict=True)
        )
        return ratio_under(elastic, rigid, measure, self.problem.points, loaded_orders)


def _relevant_lines(model: BoxModel, measure: Measure, budget: float) -> tuple[LoadedOrders, float]:
    # leaves out small orders whose responses sum to at most the budget, and returns their effect on the norm (E41)
    loaded_orders = model.loaded_orders(measure)
    size = max(measure.direction_weights or (1.0,)) * model.largest_response(loaded_orders, measure.channel)
    order = np.argsort(size, kind="stable")
    # the sum is over any root of squares, so it serves every norm
    ignored = order[np.cumsum(size[order]) <= budget]
    relevant = np.ones(len(size), dtype=bool)
    relevant[ignored] = False
    # a peak to peak is at most twice the largest length
    return loaded_orders.subset(relevant), (2.0 if measure.norm.is_diameter else 1.0) * float(size[ignored].sum())
