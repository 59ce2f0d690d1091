"""Linear lower bounds over boxes of mounts, unbalances and throws (E71, E72).

The response f of an order to a load r is a series in the numbers s of the mounts from -1 to 1 (E37, E68). It is affine
in the unbalances u = u_c + h t with t from -1 to 1, whose columns q have the loads r_q:

    f(s, t) = f(s; r_c) + sum_q t_q h_q f(s; r_q)

With the products s_j t_q as further numbers, f is affine up to a remainder. A norm of f lies above its tangent at any
point. The tangent at the minimum of the norm in the box has its minimum over the box there too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.joint_mounts.mount_loops import Loop, is_looped, mount_loop
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads, OpenThrows, along_arcs
from laufruhe.extensions.joint_mounts.rest_limits import RestLimits
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.decision import Kind, column_bounds, real_bounds
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoxResult, bisect_in_stages
from laufruhe.prove.mounts.box_norms import (
    PARTS,
    LinearBound,
    LinearRelaxation,
    counted_rows,
    is_ratio,
    line_weights,
    norm_under,
    ratio_under,
)
from laufruhe.prove.mounts.box_response import LoadedOrders, is_travel
from laufruhe.prove.mounts.box_series import Expansion, LinearResponse, Sides, balanced, mapped, rest_of
from laufruhe.prove.mounts.named import is_named
from laufruhe.prove.mounts.ranges import SLACK
from laufruhe.prove.witness import Witness

MAX_NUMBERS = 8
"""Largest number of open numbers; an unbalance of any angle has two."""
WORK, MAX_BOXES = 8e6, 10_000
"""Work of all boxes together, and largest number of boxes."""
ROUND_WORK = 4e4
"""Work of the boxes of one round."""
OMITTED_SHARE = 0.05
"""Share of the gap tolerance that omitted small orders may add up to."""
SWEEPS = 12
"""Sweeps of the coordinate descent for least squares."""
EVEN = 1e-9
"""Branching score of the relative length of a side, against ties."""
LIMITS = 0.3
"""Weight of limits against the objective in branching scores."""
FORCE = Measure(channels.MOUNT_FORCE, NORMS["rms"])


def is_boxed(problem: Problem, throws: OpenThrows | None = None) -> bool:
    """Return True if bounds over boxes apply: only a few unbalances, throws and numbers of mounts are open."""
    if problem.engine.block is None or problem.known_rows or not problem.decisions:
        return False
    is_all_affine = all(decision.is_affine for decision in problem.decisions)
    is_covered = is_looped(problem) if problem.mount_decisions else is_all_affine
    count = len(problem.mount_decisions) + sum(d.set.width for d in problem.unbalances)
    count, turns = count + (len(throws.open) if throws else 0), throws is not None
    return (
        is_covered and count <= MAX_NUMBERS and any(_is_bounded(t.measure, problem, turns) for t in problem.objective)
    )


def load_bounds(
    problem: Problem, value: float, gap_tolerance: float, shares: Sequence[float], witness: Witness | None = None,
    throws: OpenThrows | None = None,
) -> Iterator[BoxResult]:  # fmt: skip
    """Yield lower bounds of the objective by branch and bound over boxes of mounts, unbalances and throws.

    The search ends when no design is better than `value` by more than `gap_tolerance` [SI].

    Parameters
    ----------
    shares
        Shares of the box budget, one bound after each.
    witness
        Incumbent by numbers of mounts, columns of unbalances and open throws, to check bounds.
    """
    if not is_boxed(problem, throws) or not 0.0 < value < math.inf:
        return
    boxes = LoadBoxes(problem, OMITTED_SHARE * gap_tolerance, throws)
    ends = boxes.lower, boxes.upper
    yield from bisect_in_stages(boxes, *ends, value, gap_tolerance, boxes.max_boxes, shares, witness)


def _is_affine(measure: Measure, problem: Problem) -> bool:
    # True if rows are constant or affine in all open numbers
    kinds = {decision.kind for decision in problem.decisions}
    dependences = {dependence(measure.channel, kind, problem) for kind in kinds}
    return not measure.channel.is_number and dependences <= {Dependence.NONE, Dependence.AFFINE}


def _is_bounded(measure: Measure, problem: Problem, turns: bool = False) -> bool:
    on_mounts = (is_ratio(measure) and not turns) or measure.on_mounts
    fixed = not turns or dependence(measure.channel, Kind.STAR, problem) is Dependence.NONE
    return is_named(measure, problem) and (on_mounts or (fixed and _is_affine(measure, problem)))


class LoadBoxes:
    """Lower bounds over boxes of mounts, unbalances and throws.

    Omitted small orders may add up to `left_out` of the objective [SI].

    Attributes
    ----------
    lower, upper
        Bounds of the open numbers of the mounts, the columns of the unbalances, and the open throws, shape (n,).
    """

    what = "boxes of mounts and unbalances"

    def __init__(self, problem: Problem, left_out: float, throws: OpenThrows | None = None) -> None:
        self.problem = problem = with_default_sampling(problem)
        self.loads, turns = MountedLoads(problem, throws), throws is not None
        (low, high), (minimum, maximum) = real_bounds(problem.mount_decisions), column_bounds(self.loads.domains)
        first, last = throws.sides if throws else (np.zeros(0), np.zeros(0))
        self.lower, self.upper = np.concatenate([low, minimum, first]), np.concatenate([high, maximum, last])
        self._numbers, self._orders = len(low), self.loads.orders
        self._terms = [(t.weight, t.measure) for t in problem.objective if _is_bounded(t.measure, problem, turns)]
        limits = [x for x in problem.limits if _is_bounded(x.measure, problem, turns) and math.isfinite(x.maximum)]
        self._limits = [(limit.maximum * (1.0 + SLACK), limit.measure) for limit in limits]
        self._ratios = any(is_ratio(measure) for _, measure in (*self._terms, *self._limits))
        self._rest = RestLimits(problem) if self._numbers else None
        self._left_out = self._drop_small_orders(left_out)

    def _drop_small_orders(self, budget: float) -> dict[Measure, float]:
        """Leave out small orders of load, and return their largest effect on each measure (E41).

        Their effects on the objective add up to less than `budget`, and on a limit to its tolerance.
        """
        budgets = {measure: budget / weight for weight, measure in self._terms if measure.on_mounts}
        budgets |= {measure: SLACK * maximum for maximum, measure in self._limits if measure.on_mounts}
        if not budgets or self._ratios:
            return {}
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            box = _Boxes(self.loads, self._orders, self._numbers, self.lower[None], self.upper[None])
            size = np.array([np.nan_to_num(box.response(measure).maximum[0], nan=np.inf) for measure in budgets])
            share = np.max(size / np.array([*budgets.values()])[:, None], axis=0)
        order = np.argsort(share, kind="stable")
        small = order[np.cumsum(share[order]) <= 1.0]
        self._orders = self._orders.subset(np.setdiff1d(np.arange(len(share)), small))
        # a peak to peak is at most twice the largest length
        return {m: (2.0 if m.norm.is_diameter else 1.0) * float(size[k, small].sum()) for k, m in enumerate(budgets)}

    @property
    def _cost(self) -> float:
        # time of one box, in about microseconds of one core
        columns, rows = len(self.lower) - self._numbers, 3 * len(self.problem.engine.mounts)
        lifted, lines = len(self.lower) + self._numbers * columns, len(self._orders.orders)
        measures = 1 + len(self._limits) + len(self._terms) + 2 * self._ratios
        euclidean = all(m.norm.is_euclidean for _, m in (*self._terms, *self._limits) if m.on_mounts)
        samples = 0 if euclidean else self.loads.samples
        return (
            300.0 + lines * (20.0 + 0.1 * rows * lifted * measures) + measures * samples * (0.1 * rows + 0.01 * lines)
        )

    @property
    def batch_size(self) -> int:
        """Count of boxes in one round."""
        return int(np.clip(ROUND_WORK / self._cost, 2, 32))

    @property
    def max_boxes(self) -> int:
        """Box budget: as requested, or for some seconds."""
        # remainders suppose that sums of squares over orders equal those over samples
        return 0 if not self._orders.is_full else self.problem.search.boxes_or(int(min(WORK / self._cost, MAX_BOXES)))

    @np.errstate(invalid="ignore", over="ignore", divide="ignore")
    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return the lower bound of the objective on each box, shape (boxes, n), and the index of the side to halve.

        The bound is infinite if a box has no feasible design.
        """
        box = _Boxes(self.loads, self._orders, self._numbers, lower, upper)
        points = self._nearest(box)
        lines = LinearRelaxation.zero(np.zeros((len(lower), box.count)))
        scores, size = np.zeros_like(lower), np.zeros(len(lower))
        for weight, measure in self._terms:
            bound = self._under(box, measure, points, False)
            lines.add(weight, bound, self._left_out.get(measure, 0.0))
            scores, size = scores + weight * box.scores(bound), size + weight * np.abs(bound.value)
        scores = scores / np.where(size > 0.0, size, 1.0)[:, None]
        for maximum, measure in self._limits:
            bound = self._under(box, measure, points, True)
            lines.add_limit(bound, self._left_out.get(measure, 0.0), maximum)
            scores = scores + LIMITS * box.scores(bound) / (maximum or 1.0)
        widths = (upper - lower) / np.maximum(self.upper - self.lower, 1e-300)
        side = np.argmax(np.nan_to_num(scores) + EVEN * widths, axis=1)
        return np.where(self._violated(lower, upper), np.inf, lines.minimum), np.asarray(side, dtype=np.intp)

    def _violated(self, lower: Array, upper: Array) -> Mask:
        # boxes outside of the sets of unbalances, or whose mounts violate a static limit, shape (boxes,)
        violated = np.zeros(len(lower), dtype=bool)
        for domain in self.loads.domains:
            if domain.width == 2:
                columns = slice(self._numbers + domain.start, self._numbers + domain.start + 2)
                nearest = np.clip(0.0, lower[:, columns], upper[:, columns])
                violated |= np.linalg.norm(nearest, axis=1) > domain.scale * (1.0 + SLACK)
        if self._rest is not None:
            for k, (low, high) in enumerate(zip(lower[:, : self._numbers], upper[:, : self._numbers], strict=True)):
                violated[k] |= any(float(violation.min()) > 0.0 for violation in self._rest.over(low, high))
        return violated

    def _nearest(self, box: _Boxes) -> Array:
        """Return the point of each box at which the objective's sum of squares is least, shape (boxes, numbers)."""
        gram, gradient = np.zeros((len(box.lower), box.count, box.count)), np.zeros((len(box.lower), box.count))
        for weight, measure in self._terms:
            if _is_affine(measure, self.problem):
                continue
            response = box.response(FORCE if is_ratio(measure) else measure)
            share = np.sqrt(weight * line_weights(self.problem, measure, self._orders))
            share = share * measure.counted(self._orders.orders)
            is_known = np.isfinite(response.remainder)[..., None] * share[:, None]
            value = np.where(is_known > 0.0, response.value * is_known, 0.0).reshape(len(gram), -1)
            slopes = np.where(is_known[:, :, None] > 0.0, response.slopes * is_known[:, :, None], 0.0)
            slopes = np.moveaxis(slopes, 2, -1).reshape(len(gram), -1, box.count)
            gram = gram + np.matmul(slopes.conj().swapaxes(1, 2), slopes).real
            gradient = gradient + np.matmul(slopes.conj().swapaxes(1, 2), value[..., None])[..., 0].real
        return _least_squares(gram, gradient)

    def _under(self, box: _Boxes, measure: Measure, points: Array, averaged: bool) -> LinearBound:
        """Return a linear lower bound of a measure on each box: its tangent at a point, shape (boxes, numbers)."""
        if _is_affine(measure, self.problem):
            return box.affine_under(measure, points, averaged and measure.norm.averages)
        if is_ratio(measure):
            running, resting = (box.response(FORCE, at_rest) for at_rest in (False, True))
            ratio, scores = ratio_under(running, resting, measure, self.problem.points, self._orders)
            return LinearBound(ratio, np.zeros((len(ratio), box.count)), np.zeros(len(ratio)), scores)
        factors = measure.counted(self._orders.orders).astype(float)
        if averaged and measure.norm.averages:
            # averages are lower bounds of means by few samples (P7)
            factors = factors * np.sinc(self._orders.places / self.loads.samples) ** 2
        response = _scaled(box.response(measure), factors)
        value = response.value + np.einsum("bwkr,bk->bwr", response.slopes, points)
        bound = norm_under(self.problem, measure, replace(response, value=value), self._orders)
        return replace(bound, value=bound.value - np.einsum("bk,bk->b", bound.slopes, points))


class _Boxes:
    """Forces and travel about the middles of boxes as linear functions of all numbers, shapes (boxes, orders, ...).

    Attributes
    ----------
    columns
        Count of columns of unbalances and open throws.
    count
        Count of numbers of the linear functions; products of mounts and columns come last.
    """

    def __init__(
        self, loads: MountedLoads, orders: LoadedOrders, numbers: int, lower: Array, upper: Array
    ) -> None:  # fmt: skip
        self._loads, self._numbers, self.lower, self.upper = loads, numbers, lower, upper
        self._omegas = orders.omegas
        self.columns = lower.shape[1] - numbers
        self.count = lower.shape[1] + numbers * self.columns
        centres, self._halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self._centres = centres[:, numbers:]
        self._unbalances = unbalances = sum(domain.width for domain in loads.domains)
        centres, halves = np.split(np.array([self._centres, self._halves[:, numbers:]]), [unbalances], axis=2)
        columns, throws = np.split(orders.loads[:, 1:], [unbalances], axis=1)
        fixed = orders.loads[:, :1] + np.einsum("bq,wqi->bwi", centres[0], columns)[:, :, None]
        column_loads = centres[1][:, None, :, None] * columns
        middles, half_angles = halves[0], halves[1]
        throw_loads = throws * np.exp(1j * orders.orders[:, None] * middles[:, None])[..., None]
        middle, slope, remainder = (
            part[..., None] for part in along_arcs(orders.orders[:, None] * half_angles[:, None])
        )
        fixed = fixed + (middle * throw_loads).sum(axis=2, keepdims=True)
        self._columns: ComplexArray = np.concatenate(
            [fixed, column_loads, 1j * slope * throw_loads, remainder * throw_loads], axis=2
        )
        self._cache: dict[tuple[bool, tuple[int, ...], tuple[float, ...], bool], LinearResponse] = {}

    @cached_property
    def _running(self) -> tuple[list[Loop], list[Expansion]]:
        return self._expanded(self._omegas)

    @cached_property
    def _resting(self) -> tuple[list[Loop], list[Expansion]]:
        return self._expanded(np.zeros_like(self._omegas))

    def _expanded(self, omegas: Array) -> tuple[list[Loop], list[Expansion]]:
        """Return the feedback loops of all boxes, and the motion as a series for the fixed loads and each unbalance."""
        boxes = zip(self.lower[:, : self._numbers], self.upper[:, : self._numbers], strict=True)
        loops = [mount_loop(self._loads.problem, omegas, *box) for box in boxes]
        gain, inputs = np.array([loop.gain for loop in loops]), np.array([loop.inputs for loop in loops])
        balance, balanced_gain, maximum = balanced(gain)
        numbers = loops[0].numbers
        sides = Sides(np.zeros((6, len(numbers))), numbers, self._numbers)
        zero_response = np.zeros((*gain.shape[:2], 6, len(numbers)), dtype=complex)
        expansions = []
        for column in np.moveaxis(self._columns, 2, 0):
            channels_in = np.einsum("bwmi,bwi->bwm", inputs, column)
            size = np.abs(channels_in) * balance
            # a column without loads has no motion
            remainder = np.where(size.any(axis=-1), rest_of(balanced_gain, maximum, size), 0.0)
            ones = np.ones((len(gain), self._numbers))
            expansions.append(
                Expansion(ones, ones, sides, column, zero_response, gain, channels_in, balance, remainder)
            )
        return loops, expansions

    def response(self, measure: Measure, at_rest: bool = False) -> LinearResponse:
        """Return mount forces or travel of a measure as linear functions over the boxes, times its direction weights.

        If `at_rest`, loads have zero frequency, as on rigid mounts.
        """
        rows, factors = counted_rows(self._loads.problem, measure)
        key = (is_travel(measure.channel), tuple(rows.tolist()), tuple(factors.tolist()), at_rest)
        if key not in self._cache:
            loops, expansions = self._resting if at_rest else self._running
            parts = ((loop.travels if key[0] else loop.forces) for loop in loops)
            value, slope_maps = (
                np.array(matrices)[:, :, rows] * factors[:, None] for matrices in zip(*parts, strict=True)
            )
            self._cache[key] = self._together(
                [_shared(expansion, mapped(expansion, value, slope_maps)) for expansion in expansions]
            )
        return self._cache[key]

    def _together(self, responses: list[LinearResponse]) -> LinearResponse:
        """Return the sum of responses to fixed loads, columns, and remainders of throws, as one linear function."""
        fixed, *column_responses = responses[: 1 + self.columns]
        throw_remainders = responses[1 + self.columns :]
        value, (boxes, orders, rows) = fixed.value, fixed.value.shape
        by_column = np.array([response.value for response in column_responses]).reshape(
            self.columns, boxes, orders, rows
        )
        products = [response.slopes for response in column_responses]
        slopes = np.concatenate([fixed.slopes, np.moveaxis(by_column, 0, 2), *products], axis=2)
        rests = np.array([response.remainder for response in column_responses]).reshape(self.columns, boxes, orders)
        for k, response in enumerate(throw_remainders):
            rests[self._unbalances + k] += response.maximum
        bends = fixed.scores + sum((response.scores for response in column_responses), np.zeros_like(fixed.scores))
        # halving unbalances cannot make a diverging series converge
        bends = np.concatenate([bends, np.moveaxis(np.where(np.isfinite(rests), rests, 0.0), 0, -1)], axis=2)
        return LinearResponse(value, slopes, fixed.remainder + rests.sum(axis=0), bends)

    def scores(self, bound: LinearBound) -> Array:
        """Return branching scores: the part of each open number in a bound's error, shape (boxes, open numbers)."""
        products = np.abs(bound.slopes[:, self._numbers + self.columns :]).reshape(
            len(self.lower), self.columns, self._numbers
        )
        shared = np.concatenate([products.sum(axis=1), products.sum(axis=2)], axis=1)
        return np.asarray(np.nan_to_num(bound.scores, posinf=1e300) + 0.5 * shared)

    def affine_under(self, measure: Measure, points: Array, averaged: bool) -> LinearBound:
        """Return a linear lower bound of a measure that does not depend on mounts: its tangent at the points."""
        norm = self._loads.norm_without_mounts(measure, averaged)
        columns = slice(self._numbers, self._numbers + self._unbalances)
        centres, halves = self._centres[:, : self._unbalances], self._halves[:, columns]
        value, slopes = np.zeros(len(points)), np.zeros((len(points), self.count))
        for k, t in enumerate(points[:, columns]):
            z = norm.dual_feasible(norm.subgradient(centres[k] + halves[k] * t))
            gradient = norm.pullback(z)
            value[k] = float(np.vdot(z, norm.constant)) + gradient @ centres[k]
            slopes[k, columns] = gradient * halves[k]
        return LinearBound(value, slopes, np.zeros(len(points)), np.abs(slopes[:, : self.lower.shape[1]]))


def _shared(expansion: Expansion, response: LinearResponse) -> LinearResponse:
    # add the rest of the remainder to the branching scores, in proportion to the gain of each side
    excess = np.where(np.isfinite(response.remainder), response.remainder - response.scores.sum(axis=-1), 0.0)
    pull = expansion.pull / np.maximum(expansion.pull.sum(axis=-1, keepdims=True), 1e-300)
    return replace(response, scores=response.scores + np.maximum(excess, 0.0)[..., None] * pull)


def _scaled(response: LinearResponse, factors: Array) -> LinearResponse:
    # multiply every order by a factor; an order with a factor of zero has no remainder, even of a diverging series
    def times(part: ComplexArray | Array) -> Any:
        by_order = factors.reshape(-1, *(1,) * (part.ndim - 2))
        return np.where(by_order > 0.0, part * by_order, 0.0)

    return LinearResponse(*(times(getattr(response, part)) for part in PARTS))


def _least_squares(gram: Array, gradient: Array) -> Array:
    # minimise x' gram x / 2 + gradient . x over numbers from -1 to 1 by coordinate descent
    x, curvature = np.zeros_like(gradient), np.einsum("bkk->bk", gram)
    for _ in range(SWEEPS):
        for k in range(gradient.shape[1]):
            slope = gradient[:, k] + np.einsum("bk,bk->b", gram[:, k], x)
            step = np.where(curvature[:, k] > 0.0, slope / np.where(curvature[:, k] > 0.0, curvature[:, k], 1.0), 0.0)
            x[:, k] = np.clip(x[:, k] - np.nan_to_num(step), -1.0, 1.0)
    return x
