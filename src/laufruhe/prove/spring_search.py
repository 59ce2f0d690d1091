"""Boxes of many stiffnesses, bounded by the forces of their springs as well as by expansions (E42-E45)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Divided, divide
from laufruhe.prove.box_norms import counted_rows, line_weights
from laufruhe.prove.box_numbers import SLACK
from laufruhe.prove.box_response import BoxModel, Lines
from laufruhe.prove.spring_bound import Held, Limited, least_squares, spring_sides, stiffness_limit
from laufruhe.prove.spring_lines import Middle, Response, aligned, middle_of, response, springs_of
from laufruhe.prove.subdivision import StiffnessBoxes
from laufruhe.prove.transmitted_bound import limited_stiffness

Array = NDArray[np.float64]

# what all relaxations may cost together, a number of moments squared being one, and how many they may be
WORK, MOST_BOXES = 1e7, 100
# share of the squares at the middle of the bounds that orders left out have, and orders that are kept
LEFT_OUT, MOST_ORDERS = 1e-6, 12
# of a mean of lengths, the share of the amplitude of any one order that it is not under (E34)
HALF = 0.5


def spring_bound(problem: Problem, value: float, room: float) -> Divided:
    """Divide the bounds until no design is more than `room` better than `value`, or as often as is worth it.

    Parameters
    ----------
    problem
        That `divides`.
    value
        Objective of the best design known; nothing is done where none is.
    room
        Difference that counts as none [SI].
    """
    if not is_bounded(problem) or not 0.0 < value < math.inf:
        return Divided(0.0, 0)
    try:
        return _divided(problem, value, room)
    except np.linalg.LinAlgError:
        # a middle on a resonance that nothing damps
        return Divided(0.0, 0)


def _divided(problem: Problem, value: float, room: float) -> Divided:
    boxes = _SpringBoxes(problem, room, value)
    most, model = boxes.most_boxes, boxes.model
    if not most or not boxes.is_sampled_fully:
        return Divided(0.0, 0)
    found = divide(boxes, model.lower, model.upper, value, room, most)
    return Divided(found.bound, found.boxes, (*boxes.places, *found.places) if found.places else ())


def is_bounded(problem: Problem) -> bool:
    """Whether all that is minimised are forces or travel."""
    return bool(problem.load_terms) and not problem.mount_terms


class _SpringBoxes:
    """Bounds of boxes."""

    what = "boxes of stiffness, by spring forces"

    def __init__(self, problem: Problem, room: float, value: float) -> None:
        self._plain = StiffnessBoxes(problem, 0.05 * room)
        self.model = self._plain.model
        self._springs = springs_of(self.model)
        self._size = value
        self._terms = [(t.weight, t.measure, _main(self.model, t.measure)) for t in problem.load_terms
                       if t.measure.on_mounts]  # fmt: skip
        floors, ceilings = limited_stiffness(problem, self.model.root)
        self._floors = [(1.0 - 2.0 * SLACK) * floor for floor in floors]
        self._ceilings = [(1.0 + SLACK) ** 2 * ceiling for ceiling in ceilings]
        self.places: list[Array] = []

    @property
    def at_once(self) -> int:
        """Boxes of one round."""
        return 2

    @property
    def is_sampled_fully(self) -> bool:
        """Whether sums of squares over orders are those over samples."""
        return self._plain.is_sampled_fully

    @property
    def most_boxes(self) -> int:
        """As many as some tens of seconds allow."""
        cost = sum(len(lines.omegas) for _, _, lines in self._terms) * (2 * len(self._springs.gains) + 1) ** 4
        asked = self._plain.problem.search.boxes
        return int(min(WORK / max(cost, 1), MOST_BOXES, math.inf if asked is None else asked))

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """The better of both bounds; and the side worth halving."""
        known, sides = self._plain.bounds(lower, upper)
        for k in np.flatnonzero(np.isfinite(known)):
            known[k] = max(known[k], self._relaxed(lower[k], upper[k]))
        return known, sides

    def _relaxed(self, lower: Array, upper: Array) -> float:
        at = middle_of(self.model, lower, upper)
        total = self._plain.constant
        for weight, quantity, lines in self._terms:
            # what nothing excites is nothing
            total += weight * self._least(quantity, lines, at) if len(lines.omegas) else 0.0
        return total

    def _least(self, quantity: Measure, lines: Lines, at: Middle) -> float:
        rows, factors = counted_rows(self.model, quantity)
        orders = [
            response(self.model, self._springs, at, lines, k, quantity.channel, rows, factors)
            for k in range(len(lines.omegas))
        ]
        weights = line_weights(self.model, quantity, lines)
        if quantity.norm.is_euclidean:
            return math.sqrt(self._squares(list(zip(weights, orders, strict=True)), at, self._size**2))
        return self._by_orders(quantity, lines, orders, at)

    def _by_orders(self, quantity: Measure, lines: Lines, orders: Sequence[Response], at: Middle) -> float:
        """Every order by itself, and what a norm says of that (E34)."""
        names = [p.name for p in self.model.problem.points]
        chosen = self.model.counted(quantity.points)
        squares: list[dict[float, float]] = [{} for _ in names]
        roots: list[dict[float, float]] = [{} for _ in names]
        places = len(orders[0].felt[0]) // 3
        for k, each in enumerate(orders):
            point, order = int(lines.points[k]), float(lines.orders[k])
            if quantity.norm.sums_lengths:
                together = aligned(each)
                square = self._squares([(1.0, together)], at, (places * self._size / HALF) ** 2)
                roots[point][order] = HALF * math.sqrt(square) / places
            else:
                square = self._squares([(1.0, each)], at, places * self._size**2)
                squares[point][order] = 0.5 * square / places
        shares = quantity.shares(self.model.problem.points)
        return quantity.norm.least_of_orders([squares[p] for p in chosen], [roots[p] for p in chosen], shares[chosen])

    def _squares(self, orders: Sequence[tuple[float, Response]], at: Middle, unit: float) -> float:
        numbers = len(at.half)
        limits = [one for k, (_, each) in enumerate(orders) for one in self._limits(k, each, at, numbers)]
        found = least_squares(orders, limits, numbers, unit)
        if not self.places:
            self.places.append(0.5 * (self.model.lower + self.model.upper) + at.half * found.middle)
        return found.bound

    def _limits(self, k: int, each: Response, at: Middle, numbers: int) -> list[Held]:
        """That one order has to keep."""
        found = spring_sides(k, self._springs, each, numbers)
        slopes, unit = self.model.stiffness_slopes * at.half[:, None, None], at.highest
        for sign, matrices in ((1.0, self._floors), (-1.0, self._ceilings)):
            for matrix in matrices:
                given = sign * (at.here.stiffness - matrix) / unit
                found.append(stiffness_limit(k, self._springs, each, Limited(given, sign * slopes / unit), sign / unit))
        return found


def _main(model: BoxModel, quantity: Measure) -> Lines:
    """Orders above zero that make nearly all of the squares at the middle of the bounds, the largest of them."""
    lines = model.lines(quantity)
    lines = lines.kept(lines.omegas > 0.0)
    if not len(lines.omegas):
        return lines
    at, springs = middle_of(model, model.lower, model.upper), springs_of(model)
    rows, factors = counted_rows(model, quantity)
    weights = line_weights(model, quantity, lines)
    felt = [response(model, springs, at, lines, k, quantity.channel, rows, factors) for k in range(len(lines.omegas))]
    size = weights * np.array([np.sum(each.felt[:, :, 0] ** 2) for each in felt])
    order = np.argsort(-size, kind="stable")
    left = 1.0 - np.cumsum(size[order]) / max(float(size.sum()), 1e-300)
    kept = np.zeros(len(size), dtype=bool)
    kept[order[: min(int(np.argmax(left <= LEFT_OUT)) + 1, MOST_ORDERS)]] = True
    return lines.kept(kept)
