"""Boxes of mounts, and unbalances with them, bounded by the forces of their springs (E42-E45, E52-E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array, Indices
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import NEARLY
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, divides
from laufruhe.prove.springs.bound import Cap, Program, Proposed, Root, follows, pulls
from laufruhe.prove.springs.columns import columns_of
from laufruhe.prove.springs.conditions import Held, conditions
from laufruhe.prove.springs.limits import limits_of
from laufruhe.prove.springs.lines import Felt, Line, line_of, squared
from laufruhe.prove.springs.mirrored import mirrored_parts
from laufruhe.prove.springs.modes import modes_of, shapes_of
from laufruhe.prove.springs.open_mounts import OpenMounts, open_mounts
from laufruhe.prove.springs.orders import Asked, Head, Order, asked, heads_of, lengths_of
from laufruhe.prove.springs.program import proposed

# what all relaxations may cost together, a number of moments squared being one, and how many they may be
WORK, MOST_BOXES = 4e7, 100
EFFORT = 5
# of what is to be shown, the share that small orders may take
NEEDED = 0.3
# share of what a solver takes for the least that its multipliers should prove
NEAR = 0.9995
# share of the bounds of unbalances that says what is large beside the best design
WIDE = 0.3


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
        lower, upper = (np.array([getattr(d, side) for d in decisions]) for side in ("lower", "upper"))
        self._parts = self.parts(lower, upper)
        self.modes = modes_of(problem, self._parts[0])
        whole = np.ones(5 * len(self.modes))
        self.lower, self.upper = np.append(lower, -whole), np.append(upper, whole)
        self.own = [slice(len(lower) + 5 * k, len(lower) + 5 * (k + 1)) for k in range(len(self.modes))]
        self.places: list[Array] = []
        self._plain = StiffnessBoxes(problem, 0.05 * room) if divides(problem) else None
        self._near = np.array([v for v, d in zip(near, problem.decisions, strict=True) if not d.is_affine], dtype=float)
        self._model = AffineModel(off_resonance(problem))
        held = [value for value, d in zip(near, problem.decisions, strict=True) if d.is_affine]
        columns = columns_of(self._model.domains, held)
        known = evaluate(problem, problem.design(list(near)))
        terms = [term for term in problem.load_terms if term.measure.on_mounts]
        # loads of the block are those of all mounts, and known where no unbalance is open
        rest = [] if problem.unbalances else [t for t in problem.load_terms if not t.measure.on_mounts]
        self._constant = sum(t.weight * known.value(t.measure) for t in rest)

        def orders_of(measure: Measure, parts: Sequence[OpenMounts] = self._parts) -> Asked:
            return asked(problem, measure, self._model, known, columns, parts)

        told = [(t.weight, orders_of(t.measure)) for t in terms]
        limits = limits_of(problem, known, orders_of, lambda measure: orders_of(measure, self._parts[:1]))
        loads = [order.loads[1:] for _, each in told for order in each.orders]
        self.columns, fewer = columns[0].seen_by([*loads, *limits.loads])
        self._terms = [(weight, each.of_columns(fewer)) for weight, each in told]
        self.limits = limits.of_columns(fewer, self._parts)
        self._heads = [heads_of(each, self._parts) for _, each in self._terms]
        self._least = [np.zeros(len(heads)) for heads in self._heads]

    def parts(self, lower: Array, upper: Array) -> tuple[OpenMounts, ...]:
        """The mounts of a box for all motions, and where they mirror each other for both halves of them (E57)."""
        count = len(self.problem.mount_decisions)
        whole = open_mounts(self.problem, lower[:count], upper[:count])
        return (whole, *mirrored_parts(whole))

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
        parts = [order.part for heads in self._heads for head in heads for order in head.orders]
        cost = sum((1 + self.columns.count + 2 * self._parts[k].products) ** EFFORT for k in parts)
        asked_for = self.problem.search.boxes
        return int(min(WORK / max(cost, 1), MOST_BOXES)) if asked_for is None else asked_for

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, Indices]:
        """The better of both bounds; and the side worth halving."""
        if self._plain is None:
            known, sides = np.zeros(len(lower)), np.zeros(len(lower), dtype=np.intp)
        else:
            known, sides = self._plain.bounds(
                *(side[:, : len(self.problem.mount_decisions)] for side in (lower, upper))
            )
        for k in np.flatnonzero(np.isfinite(known)):
            if known[k] < self.enough:
                bound, pull = self.relaxed(lower[k], upper[k])
                known[k] = max(known[k], bound)
                sides[k] = int(np.argmax(pull)) if pull.max(initial=0.0) > 0.0 else sides[k]
        return known, sides

    def look(self, lower: Array, upper: Array) -> tuple[float, Array]:
        """The better of both bounds of one box, and the pull of its sides."""
        known = 0.0
        if self._plain is not None:
            count = len(self._near)
            known = float(self._plain.bounds(lower[None, :count], upper[None, :count])[0][0])
        bound, pull = (known, np.zeros(len(lower))) if known >= self.enough else self.relaxed(lower, upper)
        return max(known, bound), pull

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

    def left(self, lower: Array, upper: Array) -> tuple[Program, OpenMounts]:
        """Conditions of designs of a box of which the first term leaves that they are better than the best known."""
        weight, each = self._terms[0]
        box = _Box(self, each, self._room(weight), lower, upper)
        return box.under_all(self._heads[0]), box.mounts

    def under(self, value: float) -> SpringBoxes:
        """The same for designs that are better than a value, orders left out that this hardly needs."""
        found = copy(self)
        found.value = found.enough = value
        found._heads = [[replace(head, orders=self._needed(head, value)) for head in heads] for heads in self._heads]
        found._least = [np.zeros(len(heads)) for heads in self._heads]
        return found

    def _needed(self, head: Head, value: float) -> tuple[Order, ...]:
        """Those without which a tenth of what is to be shown is not lost."""
        size = np.array([float(np.sum(np.abs(order.felt) ** 2)) for order in head.orders])
        left = 1.0 - np.cumsum(size) / max(float(size.sum()), 1e-300)
        return head.orders[: int(np.argmax(left <= NEEDED * (1.0 - value / self.value))) + 1]

    def _room(self, weight: float) -> float:
        """What this term of a design that is better than the best known is not over."""
        return (self.value - self._constant) / weight

    def line(self, mounts: OpenMounts, order: Order, felt: Felt, lower: Array, upper: Array) -> Line:
        """Of an order, about the best design where that is in the box."""
        count = len(self._near)
        inside = [float(v) for v in np.clip(self._near, lower[:count], upper[:count])]
        mounting = mounting_in(self.problem.design(inside, self.problem.mount_decisions))
        moving = order.omega > 0.0
        parts = (mounting.springs, mounting.losses * moving, mounting.dampers * order.omega)
        k, h, c = (mounts.root @ mounting.total(each) @ mounts.root.T for each in parts)
        load = order.loads[0] + self.columns.near @ order.loads[1:]
        loads = np.column_stack([load, WIDE * order.loads[1:].T])
        near = np.linalg.solve(k + 1j * (h + c) - order.omega**2 * np.eye(mounts.size), loads)
        return line_of(mounts, order.loads, order.omega, near, felt)


class _Box:
    """One box, for designs of which a norm is not over a number."""

    def __init__(self, search: SpringBoxes, each: Asked, most: float, lower: Array, upper: Array) -> None:
        self.search, self.each, self.most, self.lower, self.upper = search, each, most, lower, upper
        self.parts = search.parts(lower, upper)
        self.mounts = self.parts[0]
        self._stated: dict[int, tuple[Line, list[Held]]] = {}
        self.modes = tuple(
            shapes_of(self.mounts, mode, lower[own], upper[own])
            for mode, own in zip(search.modes, search.own, strict=True)
        )

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
        bound, pull, middle = self._together(heads, shares * units, (least, top))
        total = bound - float(shares @ losses)
        return max(min(total, most), floor), pull, middle

    def _alone(self, heads: Sequence[Head]) -> Array:
        """Of every head by itself."""
        found = [self._together([head], np.ones(1))[0] for head in heads]
        return np.array([head.unit * math.sqrt(max(b, 0.0)) for head, b in zip(heads, found, strict=True)])

    def _line(self, head: Head, order: Order) -> tuple[Line, list[Held]]:
        """Of an order, and what it has to keep."""
        return self._line_of(order, self.each.at_most(order, head, self.most))

    def _line_of(self, order: Order, felt: Felt) -> tuple[Line, list[Held]]:
        if id(order) not in self._stated:
            mounts = self.parts[order.part]
            line = self.search.line(mounts, order, felt, self.lower, self.upper)
            self._stated[id(order)] = line, conditions(0, mounts, line)
        return self._stated[id(order)]

    def _together(
        self, heads: Sequence[Head], prices: Array, ends: tuple[Array, Array] | None = None
    ) -> tuple[float, Array, Array | None]:
        """Least sum of the squares of heads at these prices, or of their roots between ends."""
        # a solver works best where what it minimises is of size one
        size = float(prices.sum())
        program, lines = self._program(heads, prices / size, ends)
        bound, found = _best(program)
        middle = self._design(found.middle) if self.search.stiffness_alone else None
        parts = [order.part for head in heads for order in head.orders]
        return size * bound, self._pull(parts, lines, found), middle

    def under_all(self, heads: Sequence[Head]) -> Program:
        """What no design goes over of which none of the heads is over the whole."""
        own = [((self.most / head.share + head.loss) / head.unit) ** 2 for head in heads]
        program, _ = self._program(heads, np.zeros(len(heads)))
        return replace(program, tops=np.append(own, program.tops[len(own) :]))

    def _program(
        self, heads: Sequence[Head], prices: Array, ends: tuple[Array, Array] | None = None
    ) -> tuple[Program, list[Line]]:
        """Of these heads at these prices, and the lines of its orders."""
        caps: list[Cap] = []
        lines: list[Line] = []
        held: list[Held] = []
        roots: list[Root] = []
        for number, head in enumerate(heads):
            first, stated = len(lines), [self._line(head, order) for order in head.orders]
            lines += [line for line, _ in stated]
            held += [replace(limit, order=k) for k, (_, limits) in enumerate(stated, first) for limit in limits]
            at = range(first, len(lines))
            caps += head.caps(number, self.each, lines[first:], at)
            if ends is not None:
                own = lengths_of(head, self.each, lines[first:], at)
                roots.append(Root(prices[number], float(ends[0][number]), float(ends[1][number]), own))
        more = self.search.limits.added(heads, len(heads), self._line_of, lines)
        lines += more.lines
        program = Program(
            tuple(line.size for line in lines), tuple(line.reaches for line in lines), self.mounts.numbers,
            lines[0].columns, np.append(0.0 * prices if roots else prices, np.zeros(len(more.tops))),
            [*caps, *more.caps], [*held, *more.held], more.budgets, self.search.columns.sets, roots, self.modes,
            np.append(np.full(len(heads), math.inf), more.tops),
        )  # fmt: skip
        return program, lines

    def _design(self, s: Array) -> Array:
        """Open numbers at s, where every number is one of them."""
        out = 0.5 * (self.lower + self.upper)[: len(self.search.problem.mount_decisions)]
        for j, follows_ in enumerate(self.mounts.keys):
            out[follows_[0]] += 0.5 * (self.upper - self.lower)[follows_[0]] * s[j]
        return out

    def _pull(self, parts: Sequence[int], lines: Sequence[Line], found: Proposed) -> Array:
        """By decision, what of the products is not that of s, in forces that count."""
        pull, s = np.zeros(len(self.lower)), found.middle
        for part, line, moments in zip(parts, lines, found.moments, strict=False):
            size = float(np.sum(squared(self.each.felt(line) / line.unit) * moments)) or 1.0
            mounts = self.parts[part]
            for spring, (seen, added) in zip(mounts.springs, line.springs, strict=True):
                apart = added - np.tensordot(s, spring.slopes(len(s)), 1) @ seen
                share = max(float(np.sum(squared(apart) * moments)), 0.0) / size
                self._spread(pull, [j for j, _ in spring.terms], share)
            for place, (seen, moved) in zip(mounts.places, line.places, strict=True):
                apart = np.split(moved - s[place.number] * seen, 2)[1]
                self._spread(pull, [place.number], max(float(np.sum(squared(apart) * moments)), 0.0) / size)
        for shapes, priced, own, moments in zip(
            self.modes, found.multipliers.shapes, self.search.own, found.shapes, strict=True
        ):
            of_numbers, of_shapes = pulls(shapes, priced, s, moments)
            pull[own] += of_shapes
            for j, share in enumerate(of_numbers):
                self._spread(pull, [j], float(share))
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
