"""Boxes of mounts, and unbalances with them, bounded by the forces of their springs (E42-E45, E52-E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from laufruhe.extensions.mount_relaxation.bound import Program
from laufruhe.extensions.mount_relaxation.box import SpringBox
from laufruhe.extensions.mount_relaxation.columns import columns_of
from laufruhe.extensions.mount_relaxation.ends import Ahead
from laufruhe.extensions.mount_relaxation.limits import limits_of
from laufruhe.extensions.mount_relaxation.lines import Felt, Line, line_of
from laufruhe.extensions.mount_relaxation.mirrored import mirrored_parts
from laufruhe.extensions.mount_relaxation.modes import modes_of
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts, open_mounts
from laufruhe.extensions.mount_relaxation.opened import Framed
from laufruhe.extensions.mount_relaxation.orders import Asked, Head, Order, asked, heads_of
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import sides_of
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import NEARLY
from laufruhe.prove.mounts.ranges import number_ranges
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, divides

# what all relaxations may cost together, a number of moments squared being one, and how many they may be
WORK, MOST_BOXES = 6e7, 100
EFFORT = 5
# of what is to be shown, the share that small orders may take
NEEDED = 0.3
# share of the bounds of unbalances that says what is large beside the best design
WIDE = 0.3

# of a side, what counts as its end
AT_END = 0.1


class SpringBoxes:
    """Bounds of boxes.

    Attributes
    ----------
    lower, upper
        Of the open numbers of the mounts, of matrices of planes (E63), and of modes.
    near
        Of the best design.
    places
        Where the first relaxation stands.
    ahead
        Who works relaxations out before they are wanted; nobody when None.
    """

    def __init__(
        self, problem: Problem, value: float, room: float, near: Sequence[Value], ahead: Ahead | None = None
    ) -> None:
        self.problem, self.value, self.enough, self.ahead = problem, value, value - NEARLY * room, ahead
        decisions = problem.mount_decisions
        lower, upper = sides_of(decisions)
        self._near = np.array([v for v, d in zip(near, problem.decisions, strict=True) if not d.is_affine], dtype=float)
        self._frames = number_ranges(problem, self._near, self._near)[0]
        self._planes = open_mounts(problem, lower, upper, Framed(self._frames)).planes
        own = [np.append(plane.near, 0.0) for _, plane in self._planes.values()]
        self.near = np.concatenate([self._near, *own])
        turned = np.concatenate([np.zeros((0, 2)), *(plane.whole for _, plane in self._planes.values())])
        lower, upper = np.append(lower, turned[:, 0]), np.append(upper, turned[:, 1])
        self._parts = self.parts(lower, upper)
        self.modes = modes_of(problem, self._parts[0])
        whole = np.ones(5 * len(self.modes))
        self.lower, self.upper = np.append(lower, -whole), np.append(upper, whole)
        self.own = [slice(len(lower) + 5 * k, len(lower) + 5 * (k + 1)) for k in range(len(self.modes))]
        self.places: list[Array] = []
        self._plain = StiffnessBoxes(problem, 0.05 * room) if divides(problem) else None
        self._model = AffineModel(off_resonance(problem))
        held = [value for value, d in zip(near, problem.decisions, strict=True) if d.is_affine]
        columns = columns_of(self._model.domains, held)
        known = evaluate(problem, problem.design(list(near)))
        terms = [term for term in problem.load_terms if term.measure.on_mounts]
        # loads of the block are those of all mounts, and known where no unbalance is open
        kinds = {d.kind for d in problem.decisions}
        rest = [t for t in problem.load_terms if not depends(t.measure.channel, kinds, problem)]
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
        self.felt_at_most: dict[int, float] = {}
        self._looked = self.lower, self.upper, self._least[0]

    def parts(self, lower: Array, upper: Array) -> tuple[OpenMounts, ...]:
        """The mounts of a box for all motions, and where they mirror each other for both halves of them (E57)."""
        count = len(self.problem.mount_decisions)
        boxes = {key: np.column_stack([lower[own], upper[own]]) for key, own in self._of_planes()}
        whole = open_mounts(self.problem, lower[:count], upper[:count], Framed(self._frames, boxes))
        return (whole, *mirrored_parts(whole))

    def _of_planes(self) -> list[tuple[Any, slice]]:
        """Where the numbers of every plane stand (E63)."""
        first = len(self.problem.mount_decisions)
        return [(key, slice(first + 3 * k, first + 3 * (k + 1))) for key, (k, _) in self._planes.items()]

    def kept(self, lower: Array, upper: Array) -> tuple[Array, Array] | None:
        """The part of a box that holds all planes that are possible in it; None where there are none."""
        lower, upper = lower.copy(), upper.copy()
        for key, own in self._of_planes():
            found = self._planes[key][1].kept(np.column_stack([lower[own], upper[own]]))
            if found is None:
                return None
            lower[own], upper[own] = found.T
        return lower, upper

    def near_numbers(self, mounts: OpenMounts, lower: Array, upper: Array) -> Array:
        """s of the best design, or of what is next to it in a box; zero where s is one of six of a matrix."""
        found = np.zeros(mounts.numbers)
        for j, side in enumerate(mounts.straight):
            if side is not None and upper[side] > lower[side]:
                found[j] = (2.0 * self.near[side] - lower[side] - upper[side]) / (upper[side] - lower[side])
        return np.clip(found, -1.0, 1.0)

    def is_at(self, lower: Array, upper: Array, side: int, sign: float) -> bool:
        """Whether the best design is at the lower end of a side, or at the upper one, as its sign says."""
        if side >= len(self.near):
            return False
        apart = self.near[side] - lower[side] if sign > 0.0 else upper[side] - self.near[side]
        return bool(abs(apart) < AT_END * (upper[side] - lower[side]))

    @property
    def level(self) -> float:
        """Objective that designs are not over of which anything is shown."""
        return self.value

    @property
    def mount_numbers(self) -> int:
        """How many numbers of mounts are open."""
        return len(self.problem.mount_decisions)

    @property
    def stiffness_alone(self) -> bool:
        """Whether nothing else is open."""
        return self._plain is not None

    @property
    def takes_off(self) -> bool:
        """Whether odd multiples of the orders of a mean keep it from being shown by these (E58)."""
        if not any(head.beside for head in self._heads[0]):
            return False
        weight, each = self._terms[0]
        box = SpringBox(self, each, self._ends(weight), self.lower, self.upper)
        return box.is_hidden(self._heads[0])

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
        return self.problem.search.boxes_or(int(min(WORK / max(cost, 1), MOST_BOXES)))

    def look(self, lower: Array, upper: Array) -> tuple[float, Array]:
        """The better bound of the designs of a box that are not over the value, and the pull of its sides."""
        known, whole = 0.0, self.kept(lower, upper)
        if whole is None:
            return math.inf, np.zeros(len(lower))
        lower, upper = whole
        if self._plain is not None:
            count = len(self._near)
            known = float(self._plain.bounds(lower[None, :count], upper[None, :count])[0][0])
        bound, pull = (known, np.zeros(len(lower))) if known >= self.enough else self.relaxed(lower, upper)
        return max(known, bound), pull

    def relaxed(self, lower: Array, upper: Array) -> tuple[float, Array]:
        """Bound of the designs of one box that are not over the value, and how far each side keeps it from one."""
        total, pull = self._constant, np.zeros(len(lower))
        for k, (weight, each) in enumerate(self._terms):
            whole = not self.places and k == 0
            box = SpringBox(self, each, self._ends(weight), lower, upper)
            least, own, middle = box.least(self._heads[k], self._least[k])
            if k == 0:
                self._looked = lower, upper, box.roots
            total += weight * least
            pull += own
            if whole and middle is not None:
                self.places.append(middle)
        return total, pull * (upper > lower)

    def left(self, lower: Array, upper: Array) -> tuple[Program, OpenMounts]:
        """Conditions of designs of a box of which the first term leaves that they are better than the best known."""
        weight, each = self._terms[0]
        box = SpringBox(self, each, self._ends(weight), lower, upper)
        # what is so of a box that was looked at is so of all in it
        low, high, roots = self._looked
        inside = bool(np.all(lower >= low) and np.all(upper <= high))
        return box.under_all(self._heads[0], roots if inside else self._least[0]), box.mounts

    def under(self, value: float) -> SpringBoxes:
        """The same for designs that are better than a value, orders left out that this hardly needs."""
        found = copy(self)
        found.value = found.enough = value
        found._heads = [[replace(head, orders=self._needed(head, value)) for head in heads] for heads in self._heads]
        found._least = [least.copy() for least in self._least]
        found._looked = self.lower, self.upper, found._least[0]
        found.felt_at_most = dict(self.felt_at_most)
        return found

    def up_to(self, value: float) -> SpringBoxes:
        """The same for designs that are not over a value, of the same orders and with what is enough as before."""
        found = copy(self)
        found.value = value
        found._least = [np.zeros_like(least) for least in self._least]
        found._looked = self.lower, self.upper, found._least[0]
        found.felt_at_most = {}
        return found

    def _needed(self, head: Head, value: float) -> tuple[Order, ...]:
        size = np.array([float(np.sum(np.abs(order.felt) ** 2)) for order in head.orders])
        left = 1.0 - np.cumsum(size) / max(float(size.sum()), 1e-300)
        enough = left <= NEEDED * (1.0 - value / self.value)
        return head.orders[: int(np.argmax(enough)) + 1] if enough.any() else head.orders

    def _ends(self, weight: float) -> tuple[float, float]:
        """What this term of a design that is better than the best known is not over, and what is enough alone."""
        return (self.value - self._constant) / weight, (self.enough - self._constant) / weight

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
