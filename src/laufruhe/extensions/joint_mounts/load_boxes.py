"""Bounds of mounts, unbalances and throws in a box, all numbers from -1 to 1: linear functions (E71, E72).

What orders make of loads on open mounts is a series in the numbers s of the mounts (E37, E68), and affine in the
unbalances, u = u_c + h t with t from -1 to 1:

    f(s, t) = f(s; r_c) + sum_q t_q h_q f(s; r_q)

The first orders of both, and the products s_j t_q, are numbers of their own, in which f is affine up to a rest. A norm
of it is over its tangent at any of their values; the tangent where the norm is least in the box is least there too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.joint_mounts.mount_loops import Loop, is_looped, mount_loop
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads, Orders
from laufruhe.extensions.joint_mounts.open_throws import OpenThrows, along_arcs
from laufruhe.extensions.joint_mounts.rest_limits import RestLimits
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.decision import Kind, ends_of, sides_of
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided, divided_on
from laufruhe.prove.mounts.box_lines import BoxLines
from laufruhe.prove.mounts.box_norms import Sampled, Under, counted_rows, line_weights, norm_under
from laufruhe.prove.mounts.box_response import is_travel
from laufruhe.prove.mounts.box_series import Answer, Expansion, Sides, balanced, mapped, rest_of
from laufruhe.prove.mounts.named import is_named
from laufruhe.prove.mounts.ranges import SLACK
from laufruhe.prove.mounts.ratios import groups_of, is_ratio, ratio_under
from laufruhe.prove.witness import Known

MOST_NUMBERS = 8
"""Open numbers, unbalances of any angle being two."""
WORK, MOST_BOXES = 8e6, 10_000
"""What all boxes may cost together, and how many they may be."""
HELD = 4e4
"""What boxes of one round may cost."""
LEFT_OUT = 0.05
"""Of the gap that counts as proven, what small orders may take of it."""
SWEEPS = 12
"""Times that the least of squares is sought along every number."""
EVEN = 1e-9
"""Of the length of a side, what counts where nothing is told of it."""
LIMITS = 0.3
"""Share with which what limits leave open counts beside the objective in the choice of a side."""
FORCE = Measure(channels.MOUNT_FORCE, NORMS["rms"])


def is_boxed(problem: Problem, throws: OpenThrows | None = None) -> bool:
    """Tell if all that is open are unbalances, throws and numbers of mounts that a loop knows, few of them together."""
    if problem.engine.block is None or problem.known_rows or not problem.decisions:
        return False
    affine = all(decision.is_affine for decision in problem.decisions)
    known = is_looped(problem) if problem.mount_decisions else affine
    count = len(problem.mount_decisions) + sum(d.set.width for d in problem.unbalances)
    count, turns = count + (len(throws.open) if throws else 0), throws is not None
    return known and count <= MOST_NUMBERS and any(_is_bounded(t.measure, problem, turns) for t in problem.objective)


def load_bounds(
    problem: Problem, value: float, room: float, shares: Sequence[float], known: Known | None = None,
    throws: OpenThrows | None = None,
) -> Iterator[Divided]:  # fmt: skip
    """Yield bounds of boxes, each after a share of what is worth it, until none is `room` better than `value`.

    Parameters
    ----------
    known
        A design by its numbers of the mounts, the columns of its unbalances, and its open throws.
    throws
        That are open too.
    """
    if not is_boxed(problem, throws) or not 0.0 < value < math.inf:
        return
    boxes = LoadBoxes(problem, LEFT_OUT * room, throws)
    most = boxes.most_boxes
    if most and boxes.is_sampled_fully:
        counts = [math.ceil(share * most) for share in shares]
        yield from divided_on(boxes, boxes.lower, boxes.upper, value, room, counts, known)


def _is_affine(measure: Measure, problem: Problem) -> bool:
    """Tell if a norm is one of rows that mounts do not change, and that unbalances change affinely or not at all."""
    kinds = {decision.kind for decision in problem.decisions}
    found = {dependence(measure.channel, kind, problem) for kind in kinds}
    return not measure.channel.is_number and found <= {Dependence.NONE, Dependence.AFFINE}


def _is_bounded(measure: Measure, problem: Problem, turns: bool = False) -> bool:
    own = (is_ratio(measure) and not turns) or measure.on_mounts
    stays = not turns or dependence(measure.channel, Kind.STAR, problem) is Dependence.NONE
    return is_named(measure, problem) and (own or (stays and _is_affine(measure, problem)))


class LoadBoxes:
    """Bounds of boxes.

    Attributes
    ----------
    lower, upper
        Of the open numbers of the mounts, of the columns of the unbalances, and of the open throws.

    Parameters
    ----------
    left_out
        What small orders may take of the objective.
    throws
        That are open beside mounts and unbalances.
    """

    what = "boxes of mounts and unbalances"

    def __init__(self, problem: Problem, left_out: float, throws: OpenThrows | None = None) -> None:
        # as they are told
        self.problem = problem = with_default_sampling(problem)
        self.loads, turns = MountedLoads(problem, throws), throws is not None
        (low, high), (least, most) = sides_of(problem.mount_decisions), ends_of(self.loads.domains)
        first, last = throws.sides if throws else (np.zeros(0), np.zeros(0))
        self.lower, self.upper = np.concatenate([low, least, first]), np.concatenate([high, most, last])
        self._numbers, self._orders = len(low), self.loads.orders
        self._terms = [(t.weight, t.measure) for t in problem.objective if _is_bounded(t.measure, problem, turns)]
        held = [x for x in problem.limits if _is_bounded(x.measure, problem, turns) and math.isfinite(x.maximum)]
        self._limits = [(limit.maximum * (1.0 + SLACK), limit.measure) for limit in held]
        self._ratios = any(is_ratio(measure) for _, measure in (*self._terms, *self._limits))
        self._rest = RestLimits(problem) if self._numbers else None
        self._left_out = self._small(left_out)

    @property
    def _sampled(self) -> Sampled:
        orders = self._orders
        return Sampled(orders.points, orders.places, orders.numbers, self.loads.samples)

    def _box(self, lower: Array, upper: Array) -> _Boxes:
        return _Boxes(self.loads, self._orders, self._numbers, lower, upper, self._ratios)

    def _small(self, budget: float) -> dict[Measure, float]:
        """Leave out orders that do less than a budget together anywhere, and return what they do to measures (E41)."""
        own = {measure: budget / weight for weight, measure in self._terms if measure.on_mounts}
        own |= {measure: SLACK * most for most, measure in self._limits if measure.on_mounts}
        if not own or self._ratios:
            return {}
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            felt = np.array([self._most(measure) for measure in own])
            share = np.max(felt / np.array([*own.values()])[:, None], axis=0)
        order = np.argsort(share, kind="stable")
        out = order[np.cumsum(share[order]) <= 1.0]
        kept = np.setdiff1d(np.arange(len(share)), out)
        self._orders = self._orders.kept(kept)
        # a peak to peak is twice a largest length at most
        return {m: (2.0 if m.norm.is_diameter else 1.0) * float(felt[k, out].sum()) for k, m in enumerate(own)}

    def _most(self, measure: Measure) -> Array:
        """Bound the load of every order on all mounts that count from above, anywhere in the bounds."""
        answer = self._box(self.lower[None], self.upper[None]).answer(measure)
        return np.asarray(np.nan_to_num(answer.most[0], nan=np.inf))

    @property
    def is_sampled_fully(self) -> bool:
        """Tell if sums of squares over orders are those over samples, as the rests suppose."""
        return self._sampled.is_full

    @property
    def _cost(self) -> float:
        """Estimate the time of one box, in about a microsecond of one core."""
        columns, rows = len(self.lower) - self._numbers, 3 * len(self.problem.engine.mounts)
        lifted, lines = len(self.lower) + self._numbers * columns, len(self._orders.numbers)
        asked = 1 + len(self._limits) + len(self._terms) + 2 * self._ratios
        samples = 0 if self._is_euclidean else self.loads.samples
        return 300.0 + lines * (20.0 + 0.1 * rows * lifted * asked) + asked * samples * (0.1 * rows + 0.01 * lines)

    @property
    def _is_euclidean(self) -> bool:
        return all(m.norm.is_euclidean for _, m in (*self._terms, *self._limits) if m.on_mounts)

    @property
    def at_once(self) -> int:
        """Boxes of one round."""
        return int(np.clip(HELD / self._cost, 2, 32))

    @property
    def most_boxes(self) -> int:
        """Count the boxes that are asked for, or that some seconds allow."""
        return self.problem.search.boxes_or(int(min(WORK / self._cost, MOST_BOXES)))

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least objective on every box, infinite where no design is allowed; and the side worth halving."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return self._bounds(lower, upper)

    def _bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        box = self._box(lower, upper)
        near = self._nearest(box)
        lines = BoxLines.zero(np.zeros((len(lower), box.count)))
        pull, size = np.zeros_like(lower), np.zeros(len(lower))
        for weight, measure in self._terms:
            found = self._under(box, measure, near, False)
            lines.add(weight, found, self._left_out.get(measure, 0.0))
            pull, size = pull + weight * box.pull(found), size + weight * np.abs(found.value)
        pull = pull / np.where(size > 0.0, size, 1.0)[:, None]
        for maximum, measure in self._limits:
            found = self._under(box, measure, near, True)
            lines.add_limit(found, self._left_out.get(measure, 0.0), maximum)
            pull = pull + LIMITS * box.pull(found) / (maximum or 1.0)
        broken = self._breaks(lower, upper)
        whole = np.maximum(self.upper - self.lower, 1e-300)
        side = np.argmax(np.nan_to_num(pull) + EVEN * (upper - lower) / whole, axis=1)
        return np.where(broken, np.inf, lines.least), np.asarray(side, dtype=np.intp)

    def _breaks(self, lower: Array, upper: Array) -> Mask:
        """Boxes whose unbalances are all too large, or whose mounts break a limit at rest."""
        out = np.zeros(len(lower), dtype=bool)
        for domain in self.loads.domains:
            if domain.width == 2:
                own = slice(self._numbers + domain.start, self._numbers + domain.start + 2)
                nearest = np.clip(0.0, lower[:, own], upper[:, own])
                out |= np.linalg.norm(nearest, axis=1) > domain.scale * (1.0 + SLACK)
        if self._rest is not None:
            for k, (low, high) in enumerate(zip(lower[:, : self._numbers], upper[:, : self._numbers], strict=True)):
                out[k] |= any(float(each.min()) > 0.0 for each in self._rest.over(low, high))
        return out

    def _nearest(self, box: _Boxes) -> Array:
        """Numbers at which the sum of squares of what is minimised is least, shape (boxes, numbers)."""
        gram, pull = np.zeros((len(box.lower), box.count, box.count)), np.zeros((len(box.lower), box.count))
        for weight, measure in self._terms:
            if _is_affine(measure, self.problem):
                continue
            answer = box.answer(FORCE if is_ratio(measure) else measure)
            share = np.sqrt(weight * line_weights(self.problem, measure, self._sampled))
            share = share * measure.counted(self._sampled.orders)
            known = np.isfinite(answer.rest)[..., None] * share[:, None]
            value = np.where(known > 0.0, answer.value * known, 0.0).reshape(len(gram), -1)
            slopes = np.where(known[:, :, None] > 0.0, answer.slopes * known[:, :, None], 0.0)
            slopes = np.moveaxis(slopes, 2, -1).reshape(len(gram), -1, box.count)
            gram = gram + np.matmul(slopes.conj().swapaxes(1, 2), slopes).real
            pull = pull + np.matmul(slopes.conj().swapaxes(1, 2), value[..., None])[..., 0].real
        return _least_squares(gram, pull)

    def _under(self, box: _Boxes, measure: Measure, near: Array, averaged: bool) -> Under:
        """Return a linear function under a measure, its tangent where the objective is about least."""
        if _is_affine(measure, self.problem):
            return box.affine_under(measure, near, averaged and measure.norm.averages)
        if is_ratio(measure):
            over, firm = (box.answer(FORCE, still) for still in (False, True))
            groups = groups_of(measure, self.problem.points, self._sampled)
            ratio, pull = ratio_under(over, firm, groups)
            return Under(ratio, np.zeros((len(ratio), box.count)), np.zeros(len(ratio)), pull)
        answer = _counted(box.answer(measure), measure.counted(self._sampled.orders))
        if averaged and measure.norm.averages:
            # a mean that is kept by many samples may be over its limit at few (P7)
            answer = _times(answer, np.sinc(self._sampled.places / self.loads.samples) ** 2)
        value = answer.value + np.einsum("bwkr,bk->bwr", answer.slopes, near)
        found = norm_under(self.problem, measure, replace(answer, value=value), self._sampled)
        return replace(found, value=found.value - np.einsum("bk,bk->b", found.slopes, near))


class _Boxes:
    """Boxes about their middles: what forces and travel are in all numbers, shapes (boxes, orders, ...).

    Attributes
    ----------
    count
        Numbers, of which products of one of the mounts and one of the unbalances come last.
    """

    def __init__(
        self, loads: MountedLoads, orders: Orders, numbers: int, lower: Array, upper: Array, ratios: bool
    ) -> None:
        self._loads, self._numbers, self.lower, self.upper = loads, numbers, lower, upper
        self.columns = lower.shape[1] - numbers
        self.count = lower.shape[1] + numbers * self.columns
        centres, self._halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self._centres = centres[:, numbers:]
        self._unbalances = unbalances = orders.loads.shape[1] - 1
        centres, halves = np.split(np.array([self._centres, self._halves[:, numbers:]]), [unbalances], axis=2)
        given = orders.loads[:, :1] + np.einsum("bq,wqi->bwi", centres[0], orders.loads[:, 1:])[:, :, None]
        moved = centres[1][:, None, :, None] * orders.loads[:, 1:]
        at, reach = halves[0], halves[1]
        turned = orders.turned * np.exp(1j * orders.numbers[:, None] * at[:, None])[..., None]
        middle, slope, rest = (each[..., None] for each in along_arcs(orders.numbers[:, None] * reach[:, None]))
        given = given + (middle * turned).sum(axis=2, keepdims=True)
        self._columns: ComplexArray = np.concatenate([given, moved, 1j * slope * turned, rest * turned], axis=2)
        sides = list(zip(lower[:, :numbers], upper[:, :numbers], strict=True))
        self._running = self._expanded([mount_loop(loads.problem, orders.omegas, *box) for box in sides])
        still = np.zeros_like(orders.omegas)
        self._firm = self._expanded([mount_loop(loads.problem, still, *box) for box in sides]) if ratios else None
        self._known: dict[tuple[bool, tuple[int, ...], tuple[float, ...], bool], Answer] = {}

    def _expanded(self, loops: list[Loop]) -> tuple[list[Loop], list[Expansion]]:
        """One expansion for what is given, and one for each column."""
        gain, met = np.array([loop.gain for loop in loops]), np.array([loop.met for loop in loops])
        balance, even, most = balanced(gain)
        own = loops[0].own
        sides = Sides(np.zeros((6, len(own))), own, self._numbers)
        still = np.zeros((*gain.shape[:2], 6, len(own)), dtype=complex)
        found = []
        for column in np.moveaxis(self._columns, 2, 0):
            reached = np.einsum("bwmi,bwi->bwm", met, column)
            hit = np.abs(reached) * balance
            # what a column does not load stays at rest
            rest = np.where(hit.any(axis=-1), rest_of(even, most, hit), 0.0)
            ones = np.ones((len(gain), self._numbers))
            found.append(Expansion(ones, ones, sides, column, still, gain, reached, balance, rest))
        return loops, found

    def answer(self, measure: Measure, still: bool = False) -> Answer:
        """Forces or travel that count, with factors on them."""
        rows, factors = counted_rows(self._loads.problem, measure)
        key = (is_travel(measure.channel), tuple(rows.tolist()), tuple(factors.tolist()), still)
        if key not in self._known:
            loops, expansions = self._firm if still and self._firm is not None else self._running
            parts = ((loop.travels if key[0] else loop.forces) for loop in loops)
            value, turned = (np.array(each)[:, :, rows] * factors[:, None] for each in zip(*parts, strict=True))
            self._known[key] = self._together([_shared(at, mapped(at, value, turned)) for at in expansions])
        return self._known[key]

    def _together(self, found: list[Answer]) -> Answer:
        given, moved, beyond = found[0], found[1 : 1 + self.columns], found[1 + self.columns :]
        value, (boxes, lines, rows) = given.value, given.value.shape
        own = np.array([each.value for each in moved]).reshape(self.columns, boxes, lines, rows)
        crossed = [each.slopes for each in moved]
        slopes = np.concatenate([given.slopes, np.moveaxis(own, 0, 2), *crossed], axis=2)
        rests = np.array([each.rest for each in moved]).reshape(self.columns, boxes, lines)
        for k, each in enumerate(beyond):
            rests[self._unbalances + k] += each.most
        bends = given.bends + sum((each.bends for each in moved), np.zeros_like(given.bends))
        # halves of unbalances do not make a series end
        bends = np.concatenate([bends, np.moveaxis(np.where(np.isfinite(rests), rests, 0.0), 0, -1)], axis=2)
        return Answer(value, slopes, given.rest + rests.sum(axis=0), bends)

    def pull(self, found: Under) -> Array:
        """By how much each side makes a bound less, shape (boxes, open numbers)."""
        whole = self._numbers + self.columns
        crossed = np.abs(found.slopes[:, whole:]).reshape(len(self.lower), self.columns, self._numbers)
        shared = np.concatenate([crossed.sum(axis=1), crossed.sum(axis=2)], axis=1)
        return np.asarray(np.nan_to_num(found.bends, posinf=1e300) + 0.5 * shared)

    def affine_under(self, measure: Measure, near: Array, averaged: bool) -> Under:
        """Return the tangent of a norm that mounts do not change."""
        norm, own = self._loads.still(measure, averaged), slice(self._numbers, self._numbers + self._unbalances)
        centres, halves = self._centres[:, : self._unbalances], self._halves[:, own]
        value, slopes = np.zeros(len(near)), np.zeros((len(near), self.count))
        for k, t in enumerate(near[:, own]):
            z = norm.dual_feasible(norm.subgradient(centres[k] + halves[k] * t))
            by = norm.pulled(z)
            value[k] = float(np.vdot(z, norm.constant)) + by @ centres[k]
            slopes[k, own] = by * halves[k]
        return Under(value, slopes, np.zeros(len(near)), np.abs(slopes[:, : self.lower.shape[1]]))


def _shared(at: Expansion, answer: Answer) -> Answer:
    """Return an answer whose rest is all shared out among the sides, by what each has of the gain."""
    beyond = np.where(np.isfinite(answer.rest), answer.rest - answer.bends.sum(axis=-1), 0.0)
    pull = at.pull / np.maximum(at.pull.sum(axis=-1, keepdims=True), 1e-300)
    return replace(answer, bends=answer.bends + np.maximum(beyond, 0.0)[..., None] * pull)


def _counted(answer: Answer, which: Mask) -> Answer:
    """Return an answer in which other orders are nothing."""
    if which.all():
        return answer
    value, slopes = (
        np.where(which.reshape(-1, *(1,) * n), each, 0.0) for n, each in ((1, answer.value), (2, answer.slopes))
    )
    return Answer(value, slopes, np.where(which, answer.rest, 0.0), np.where(which[:, None], answer.bends, 0.0))


def _times(answer: Answer, factors: Array) -> Answer:
    one, two = factors[:, None], factors[:, None, None]
    return Answer(answer.value * one, answer.slopes * two, answer.rest * factors, answer.bends * one)


def _least_squares(gram: Array, pull: Array) -> Array:
    """Numbers from -1 to 1 with about the least of x' gram x / 2 + pull . x, by one after the other."""
    found, own = np.zeros_like(pull), np.einsum("bkk->bk", gram)
    for _ in range(SWEEPS):
        for k in range(pull.shape[1]):
            slope = pull[:, k] + np.einsum("bk,bk->b", gram[:, k], found)
            step = np.where(own[:, k] > 0.0, slope / np.where(own[:, k] > 0.0, own[:, k], 1.0), 0.0)
            found[:, k] = np.clip(found[:, k] - np.nan_to_num(step), -1.0, 1.0)
    return found
