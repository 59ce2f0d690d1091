"""Boxes of mounts, and unbalances with them, bounded by the forces of their springs (E42-E45, E52-E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array, Indices
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import NEARLY, Divided, divide
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, divides
from laufruhe.prove.springs.bound import Cap, Program, Proposed, follows
from laufruhe.prove.springs.conditions import Held, conditions
from laufruhe.prove.springs.lines import Felt, Line, line_of, squared
from laufruhe.prove.springs.open_mounts import OpenMounts, is_lifted, open_mounts
from laufruhe.prove.springs.orders import Asked, Head, Order, asked, heads_of
from laufruhe.prove.springs.program import proposed

# what all relaxations may cost together, a number of moments squared being one, and how many they may be
WORK, MOST_BOXES = 4e7, 100
EFFORT = 5
# share of what a solver takes for the least that its multipliers should prove
NEAR = 0.97
# share of the bounds of unbalances that says what is large beside the best design
WIDE = 0.3


def spring_bound(problem: Problem, value: float, room: float, near: Sequence[Value]) -> Divided:
    """Divide the bounds until no design is more than `room` better than `value`, or as often as is worth it.

    Parameters
    ----------
    value
        Objective of the best design known; nothing is done where none is.
    room
        Difference that counts as none [SI].
    near
        Decisions of a design near which most boxes will be.
    """
    if not is_bounded(problem) or not 0.0 < value < math.inf:
        return Divided(0.0, 0)
    try:
        boxes = SpringBoxes(problem, value, room, near)
        most = boxes.most_boxes
        if not most or not boxes.is_sampled_fully:
            return Divided(0.0, 0)
        found = divide(boxes, boxes.lower, boxes.upper, value, room, most)
    except np.linalg.LinAlgError:
        # a middle on a resonance that nothing damps
        return Divided(0.0, 0)
    return Divided(found.bound, found.boxes, (*boxes.places, *found.places) if found.places else ())


def is_bounded(problem: Problem) -> bool:
    """Whether all that is minimised are forces or travel, and what is open is in the relaxation."""
    on_mounts = any(term.measure.on_mounts for term in problem.load_terms)
    return on_mounts and not problem.mount_terms and is_lifted(problem)


class SpringBoxes:
    """Bounds of boxes.

    Attributes
    ----------
    lower, upper
        Of the open numbers of the mounts.
    places
        Where the first relaxation stands.
    """

    what = "boxes of mounts, by spring forces"

    def __init__(self, problem: Problem, value: float, room: float, near: Sequence[Value]) -> None:
        self.problem, self.value, self.enough = problem, value, value - NEARLY * room
        decisions = problem.mount_decisions
        self.lower, self.upper = (np.array([getattr(d, side) for d in decisions]) for side in ("lower", "upper"))
        self.places: list[Array] = []
        self._plain = StiffnessBoxes(problem, 0.05 * room) if divides(problem) else None
        self._near = np.array([v for v, d in zip(near, problem.decisions, strict=True) if not d.is_affine], dtype=float)
        self._model = AffineModel(off_resonance(problem))
        middles, reaches = self._columns
        columns = [np.zeros(0)]
        held = [value for value, d in zip(near, problem.decisions, strict=True) if d.is_affine]
        columns += [d.columns_of(value) for d, value in zip(self._model.domains, held, strict=True)]
        self._unbalances = (np.concatenate(columns) - middles) / np.where(reaches > 0.0, reaches, 1.0)
        known = evaluate(problem, problem.design(list(near)))
        terms = [term for term in problem.load_terms if term.measure.on_mounts]
        # loads of the block are those of all mounts, and known where no unbalance is open
        rest = [] if problem.unbalances else [t for t in problem.load_terms if not t.measure.on_mounts]
        self._constant = sum(t.weight * known.value(t.measure) for t in rest)
        self._terms = [(t.weight, asked(problem, t.measure, self._model, known, self._columns)) for t in terms]
        self._whole = open_mounts(problem, self.lower, self.upper)
        self._heads = [heads_of(each, self._whole) for _, each in self._terms]
        self._least = [np.zeros(len(heads)) for heads in self._heads]

    @cached_property
    def _columns(self) -> tuple[Array, Array]:
        """Middle and reach of every column of the unbalances."""
        middles, reaches = [np.zeros(0)], [np.zeros(0)]
        for domain in self._model.domains:
            low, high = (domain.set.lower, domain.set.upper) if domain.width == 1 else (-domain.scale, domain.scale)
            middles.append(np.full(domain.width, 0.5 * (low + high)))
            reaches.append(np.full(domain.width, 0.5 * (high - low)))
        return np.concatenate(middles), np.concatenate(reaches)

    @cached_property
    def sets(self) -> list[Array]:
        """Every unbalance within its bounds: an interval, a disc, and the sides of a sector."""
        found, size = [], 1 + len(self._columns[0])
        for domain in self._model.domains:
            own = np.arange(size - 1)[domain.columns] + 1
            matrix = np.zeros((size, size))
            matrix[0, 0], matrix[own, own] = -1.0, 1.0
            found.append(matrix)
            low, high = domain.set.angles
            if domain.width == 2 and len(domain.set.edges) and high - low < math.pi:
                for along, sign in zip(domain.set.edges, (1.0, -1.0), strict=True):
                    side = np.zeros((size, size))
                    # v lies to the left of the first side and to the right of the second
                    side[0, own] = side[own, 0] = 0.5 * sign * np.array([along[1], -along[0]])
                    found.append(side)
        return found

    @property
    def stiffness_alone(self) -> bool:
        """Whether nothing else is open."""
        return self._plain is not None

    @property
    def at_once(self) -> int:
        """Boxes of one round."""
        return 2

    @property
    def is_sampled_fully(self) -> bool:
        """Whether what is shown of orders is so of samples."""
        plain = self._plain is None or self._plain.is_sampled_fully
        return plain and all(each.is_sampled_fully for _, each in self._terms)

    @property
    def most_boxes(self) -> int:
        """As many as some tens of seconds allow."""
        sizes = sum(spring.axes.shape[1] for spring in self._whole.springs) + 4 * len(self._whole.places)
        lines = sum(len(head.orders) for heads in self._heads for head in heads)
        cost = lines * (1 + len(self._columns[0]) + 2 * sizes) ** EFFORT
        asked_for = self.problem.search.boxes
        return int(min(WORK / max(cost, 1), MOST_BOXES)) if asked_for is None else asked_for

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, Indices]:
        """The better of both bounds; and the side worth halving."""
        if self._plain is None:
            known, sides = np.zeros(len(lower)), np.zeros(len(lower), dtype=np.intp)
        else:
            known, sides = self._plain.bounds(lower, upper)
        for k in np.flatnonzero(np.isfinite(known)):
            if known[k] < self.enough:
                bound, pull = self.relaxed(lower[k], upper[k])
                known[k] = max(known[k], bound)
                sides[k] = int(np.argmax(pull)) if pull.max(initial=0.0) > 0.0 else sides[k]
        return known, sides

    def relaxed(self, lower: Array, upper: Array) -> tuple[float, Array]:
        """Bound of one box, and how far each side keeps the relaxation from a design."""
        total, pull = self._constant, np.zeros(len(lower))
        for k, (weight, each) in enumerate(self._terms):
            whole = not self.places and k == 0
            box = _Box(self, each, self._room(weight), lower, upper)
            least, own, middle = box.least(self._heads[k], self._least[k])
            total += weight * least
            pull += own
            if whole and middle is not None:
                self.places.append(middle)
        # a design that is worse than the best known is above it
        return min(total, self.value), pull * (upper > lower)

    def _room(self, weight: float) -> float:
        """What this term of a design that is better than the best known is not over."""
        return (self.value - self._constant) / weight

    def line(self, mounts: OpenMounts, order: Order, felt: Felt, lower: Array, upper: Array) -> Line:
        """Of an order, about the best design where that is in the box."""
        inside = [float(v) for v in np.clip(self._near, lower, upper)]
        mounting = mounting_in(self.problem.design(inside, self.problem.mount_decisions))
        moving = order.omega > 0.0
        parts = (mounting.springs, mounting.losses * moving, mounting.dampers * order.omega)
        k, h, c = (mounts.root @ mounting.total(each) @ mounts.root.T for each in parts)
        load = order.loads[0] + self._unbalances @ order.loads[1:]
        loads = np.column_stack([load, WIDE * order.loads[1:].T])
        near = np.linalg.solve(k + 1j * (h + c) - order.omega**2 * np.eye(6), loads)
        return line_of(mounts, order.loads, order.omega, near, felt)


class _Box:
    """One box, for designs of which a norm is not over a number."""

    def __init__(self, search: SpringBoxes, each: Asked, most: float, lower: Array, upper: Array) -> None:
        self.search, self.each, self.most, self.lower, self.upper = search, each, most, lower, upper
        self.mounts = open_mounts(search.problem, lower, upper)
        self._stated: dict[int, tuple[Line, list[Held]]] = {}

    def least(self, heads: Sequence[Head], known: Array) -> tuple[float, Array, Array | None]:
        """What a norm is not under on the box, how far each side keeps it from being so, and where it stands.

        Of several heads each is bounded by itself; the roots of all are then at least straight lines between what
        they are at least and at most, and these are bounded together (E54).
        """
        pull, most = np.zeros(len(self.lower)), self.most
        if not heads:
            return 0.0, pull, None
        if len(heads) == 1:
            bound, pull, middle = self._together(heads, np.ones(1))
            found = heads[0].unit * math.sqrt(max(bound, 0.0)) - heads[0].loss
            return min(max(found, 0.0), most), pull, middle
        alone = np.maximum(self._alone(heads), known)
        if np.array_equal(self.lower, self.search.lower) and np.array_equal(self.upper, self.search.upper):
            known[:] = alone
        shares, losses = np.array([h.share for h in heads]), np.array([h.loss for h in heads])
        floor = float(shares @ np.maximum(alone - losses, 0.0))
        if floor >= most:
            return most, pull, None
        units = np.array([h.unit for h in heads])
        highest = (most - (floor - shares * np.maximum(alone - losses, 0.0))) / shares + losses
        least, top = alone / units, highest / units
        # a root is not under the line between its ends: (square + least top) / (least + top)
        prices = shares * units / (least + top)
        bound, pull, middle = self._together(heads, prices)
        total = bound + float(prices @ (least * top)) - float(shares @ losses)
        return max(min(total, most), floor), pull, middle

    def _alone(self, heads: Sequence[Head]) -> Array:
        """Of every head by itself."""
        found = [self._together([head], np.ones(1))[0] for head in heads]
        return np.array([head.unit * math.sqrt(max(b, 0.0)) for head, b in zip(heads, found, strict=True)])

    def _line(self, head: Head, order: Order) -> tuple[Line, list[Held]]:
        """Of an order, and what it has to keep."""
        if id(order) not in self._stated:
            felt = self.each.at_most(order, head, self.most)
            line = self.search.line(self.mounts, order, felt, self.lower, self.upper)
            self._stated[id(order)] = line, conditions(0, self.mounts, line)
        return self._stated[id(order)]

    def _together(self, heads: Sequence[Head], prices: Array) -> tuple[float, Array, Array | None]:
        """Least sum of the squares of heads at these prices."""
        caps: list[Cap] = []
        lines: list[Line] = []
        held: list[Held] = []
        for number, head in enumerate(heads):
            first, stated = len(lines), [self._line(head, order) for order in head.orders]
            lines += [line for line, _ in stated]
            held += [replace(limit, order=k) for k, (_, limits) in enumerate(stated, first) for limit in limits]
            caps += head.caps(number, self.each, lines[first:], range(first, len(lines)))
        # a solver works best where what it minimises is of size one
        size = float(prices.sum())
        program = Program(
            tuple(line.size for line in lines), tuple(line.reach for line in lines), self.mounts.numbers,
            lines[0].columns, prices / size, caps, held, (), self.search.sets,
        )  # fmt: skip
        bound, found = _best(program)
        middle = self._design(found.middle) if self.search.stiffness_alone else None
        return size * bound, self._pull(lines, found), middle

    def _design(self, s: Array) -> Array:
        """Open numbers at s, where every number is one of them."""
        out = 0.5 * (self.lower + self.upper)
        for j, follows_ in enumerate(self.mounts.keys):
            out[follows_[0]] += 0.5 * (self.upper - self.lower)[follows_[0]] * s[j]
        return out

    def _pull(self, lines: Sequence[Line], found: Proposed) -> Array:
        """By decision, what of the products is not that of s, in forces that count."""
        pull, s = np.zeros(len(self.lower)), found.middle
        for line, moments in zip(lines, found.moments, strict=True):
            size = float(np.sum(squared(self.each.felt(line) / line.unit) * moments)) or 1.0
            for spring, (seen, added) in zip(self.mounts.springs, line.springs, strict=True):
                apart = added - np.tensordot(s, spring.slopes(len(s)), 1) @ seen
                share = max(float(np.sum(squared(apart) * moments)), 0.0) / size
                self._spread(pull, [j for j, _ in spring.terms], share)
            for place, (seen, moved) in zip(self.mounts.places, line.places, strict=True):
                apart = (moved - s[place.number] * seen)[2:]
                self._spread(pull, [place.number], max(float(np.sum(squared(apart) * moments)), 0.0) / size)
        return pull

    def _spread(self, pull: Array, numbers: Sequence[int], share: float) -> None:
        """Over the decisions that numbers follow, by how much of their bounds is left."""
        follows_ = sorted({j for number in numbers for j in self.mounts.keys[number]})
        left = (self.upper - self.lower) / (self.search.upper - self.search.lower)
        best = max(follows_, key=lambda j: left[j])
        pull[best] += share


def _best(program: Program) -> tuple[float, Proposed]:
    """What follows from what a solver says; it is asked again where that is far under what it takes for the least."""
    best: tuple[float, Proposed] | None = None
    for found in proposed(program):
        bound = follows(program, found.multipliers)
        best = (bound, found) if best is None or bound > best[0] else best
        if bound >= NEAR * found.least:
            break
    assert best is not None
    return best
