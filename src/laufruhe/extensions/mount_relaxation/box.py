"""One box of mounts, bounded by the forces of their springs (E42-E45, E52-E54, E57, E58, E62)."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import replace
from typing import Protocol

import numpy as np

from laufruhe.extensions.mount_relaxation.bound import Cap, Program, Proposed, Root, follows, pulls
from laufruhe.extensions.mount_relaxation.columns import Columns
from laufruhe.extensions.mount_relaxation.conditions import Held, conditions, of_stiffness
from laufruhe.extensions.mount_relaxation.ends import Ahead, Aims
from laufruhe.extensions.mount_relaxation.high_orders import AtMost, HighOrder, constant
from laufruhe.extensions.mount_relaxation.limits import Limits
from laufruhe.extensions.mount_relaxation.lines import Felt, Line, squared
from laufruhe.extensions.mount_relaxation.means import Mean, mean_of
from laufruhe.extensions.mount_relaxation.modes import Mode, shapes_of
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.orders import Asked, Head, Order, lengths_of, most_of
from laufruhe.extensions.mount_relaxation.program import proposed
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.budget import rounds

# share of what a solver takes for the least that its multipliers should prove,
# and where that is of a mean, which its own ends hold back more
NEAR, ROUGH = 0.9995, 0.97
# rounds that the roots of a mean narrow each other in, and share of it under which one is left as it is
ROUNDS, SMALL = 2, 0.03
# share of a mean that is worth narrowing what hides it
LARGE = 0.03
# of what a box lacks, what is told too high of odd multiples and is worth halving it for
WORTH = 0.25


class Searched(Protocol):
    """What boxes have in common.

    Attributes
    ----------
    lower, upper
        Of all that is divided.
    own
        Where the numbers of every mode stand.
    felt_at_most
        By order, what designs that count have of it.
    ahead
        Who works relaxations out before they are wanted; nobody when None.
    """

    lower: Array
    upper: Array
    modes: tuple[Mode, ...]
    own: list[slice]
    columns: Columns
    limits: Limits
    felt_at_most: dict[int, float]
    ahead: Ahead | None

    @property
    def stiffness_alone(self) -> bool:
        """Whether nothing else is open."""

    @property
    def mount_numbers(self) -> int:
        """How many numbers of mounts are open."""

    def parts(self, lower: Array, upper: Array) -> tuple[OpenMounts, ...]:
        """The mounts of a box, whole and in halves."""

    def near_numbers(self, mounts: OpenMounts, lower: Array, upper: Array) -> Array:
        """s of the best design, or near it in a box."""

    def line(self, mounts: OpenMounts, order: Order, felt: Felt, lower: Array, upper: Array) -> Line:
        """Of an order over a box."""


class SpringBox:
    """One box, for designs of which a norm is not over a number: what is proven is so of these alone.

    Attributes
    ----------
    roots
        What those of the heads that were bounded last are at least.
    """

    roots: Array

    def __init__(self, search: Searched, each: Asked, ends: tuple[float, float], lower: Array, upper: Array) -> None:
        self.search, self.each, self.lower, self.upper = search, each, lower, upper
        self.most, self.enough = ends
        self.parts = search.parts(lower, upper)
        self.mounts = self.parts[0]
        self._stands = np.zeros(self.mounts.numbers)
        self._near = search.near_numbers(self.mounts, lower, upper)
        self._stated: dict[int, tuple[Line, list[Held]]] = {}
        self._taken: dict[tuple[int, ...], list[list[AtMost]]] = {}
        self.modes = tuple(
            shapes_of(self.mounts, mode, lower[own], upper[own])
            for mode, own in zip(search.modes, search.own, strict=True)
        )

    def least(self, heads: Sequence[Head], known: Array) -> tuple[float, Array, Array | None]:
        """What a norm is not under on the box, how far each side keeps it from being so, and where it stands.

        Of several heads each is bounded by itself; the roots of all are then at least straight lines between what
        they are at least and at most, and these are bounded together (E54).
        """
        pull = np.zeros(len(self.lower))
        self.roots = known
        if not heads:
            return 0.0, pull, None
        if len(heads) == 1 and not heads[0].beside:
            bound, pull, middle = self._together(heads, np.ones(1))
            found = heads[0].unit * math.sqrt(max(bound, 0.0)) - heads[0].loss
            return max(found, 0.0), pull, middle
        self.roots = self._alone(heads, known)
        shown = self._shown(heads, self.roots)
        if shown[0] < self.enough and self._is_whole:
            if self.is_hidden(heads):
                self.roots = self._together_again(heads, self.roots)
                shown = max(shown, self._shown(heads, self.roots), key=lambda each: each[0])
            known[:] = self.roots
        return shown

    @property
    def _is_whole(self) -> bool:
        return np.array_equal(self.lower, self.search.lower) and np.array_equal(self.upper, self.search.upper)

    def _shown(self, heads: Sequence[Head], roots: Array) -> tuple[float, Array, Array | None]:
        mean, pull = self._mean(heads, roots), np.zeros(len(self.lower))
        if mean.floor >= self.enough:
            return mean.floor, pull, None
        bound, pull, middle = self._together(heads, mean.prices, mean)
        bound = max(bound + mean.constant, mean.floor)
        return bound, self._with_hidden(heads, pull, self.most - bound), middle

    def _with_hidden(self, heads: Sequence[Head], pull: Array, lacking: float) -> Array:
        """Sides by what halving may bring: products that are apart, or odd multiples that are told too high (E62)."""
        found = np.zeros(len(pull))
        for head in heads:
            for order, multiple in head.beside:
                high = self._high(order)
                if high is not None:
                    hidden = high.hidden(self._stands) * head.share * head.factor / multiple / len(self.each.mounts)
                    for j, own in enumerate(hidden):
                        self._spread(found, [j], float(own))
        return worth(pull, found, lacking)

    def _alone(self, heads: Sequence[Head], known: Array) -> Array:
        units, found = np.array([head.unit for head in heads]), known.copy()
        for k in np.flatnonzero(_matter(units * [head.share for head in heads])).tolist():
            least = self._together([heads[k]], np.ones(1), near=ROUGH)[0]
            found[k] = max(found[k], units[k] * math.sqrt(max(least, 0.0)))
        return found

    def _together_again(self, heads: Sequence[Head], known: Array) -> Array:
        """What every root is at least with the others in what is left of the norm (E58).

        And what designs that are no worse than the best known have at most of odd multiples. All of a round follow
        from the same conditions, so that they may be worked out side by side.
        """
        least, units, shapes = known.copy(), np.array([head.unit for head in heads]), np.zeros(5 * len(self.modes))
        for _ in rounds(ROUNDS):
            mean = self._mean(heads, least)
            if mean.floor >= self.most:
                break
            matter = np.flatnonzero(_matter(mean.prices)).tolist()
            told = [pair for k in matter for pair in zip(heads[k].beside, self._of_head(heads[k]), strict=True)]
            felt = [(id(order), line) for (order, _), line in told if np.any(line.slopes)]
            aims = Aims(self.under_all(heads, least), self.search.ahead)
            found = aims.all_least([*matter, *(np.append(-line.slopes, shapes) for _, line in felt)])
            least[matter] = np.maximum(least[matter], units[matter] * found[: len(matter)])
            for (order, line), bound in zip(felt, found[len(matter) :], strict=True):
                at_most = self.search.felt_at_most
                at_most[order] = min(at_most.get(order, math.inf), line.constant - bound)
            self._taken.clear()
        return least

    def _mean(self, heads: Sequence[Head], least: Array) -> Mean:
        key = tuple(map(id, heads))
        if key not in self._taken:
            self._taken[key] = [self._of_head(head) for head in heads]
        return mean_of(heads, self._taken[key], least, self.most, self.mounts.numbers)

    def is_hidden(self, heads: Sequence[Head]) -> bool:
        """Whether odd multiples of its orders may hide so much of the mean that narrowing them is worth it."""
        size = sum(head.share * head.unit for head in heads)
        mean = self._mean(heads, np.array([head.unit for head in heads]))
        return float(mean.prices.sum()) + mean.constant < (1.0 - LARGE) * size

    def _of_head(self, head: Head) -> list[AtMost]:
        """What is felt of odd multiples at most, in the mean over mounts (E62)."""
        return [self._felt(order).times(1.0 / len(self.each.mounts)) for order, _ in head.beside]

    def _high(self, order: Order) -> HighOrder | None:
        """An order of which what springs of one loss do is known; None where it is not."""
        found = HighOrder(self.parts[order.part], order.loads[0], order.omega, self._near)
        return None if self.each.is_travel or np.any(order.loads[1:]) or not found.is_plain else found

    def _felt(self, order: Order) -> AtMost:
        """What is felt of one, in all."""
        known, high = self.search.felt_at_most.get(id(order), math.inf), self._high(order)
        most = min(most_of(self.each, order, self.parts), len(self.each.mounts) * known)
        line = None if high is None else high.felt
        if line is None:
            return constant(most, self._near)
        line = line.times(float(self.each.factors.max()))
        return replace(line, most=min(most, line.largest))

    def _line(self, head: Head, order: Order) -> tuple[Line, list[Held]]:
        return self._line_of(order, self.each.at_most(order, head, self.most))

    def _line_of(self, order: Order, felt: Felt) -> tuple[Line, list[Held]]:
        if id(order) not in self._stated:
            mounts = self.parts[order.part]
            line = self.search.line(mounts, order, felt, self.lower, self.upper)
            self._stated[id(order)] = line, conditions(0, mounts, line)
        return self._stated[id(order)]

    def _together(
        self,
        heads: Sequence[Head],
        prices: Array,
        mean: Mean | None = None,
        root: int | None = None,
        near: float = NEAR,
    ) -> tuple[float, Array, Array | None]:
        """Least sum of the squares of heads at these prices, or of their roots; or of one root, in its unit."""
        # a solver works best where what it minimises is of size one
        size = float(prices.sum())
        program, lines = self._program(heads, prices / size, mean)
        if mean is not None:
            goal = None if root is None else mean.goal(size, self.most, root)
            aim = np.append(mean.along / size, np.zeros(5 * len(self.modes))) if root is None else None
            program = replace(program, aim=aim, goal=goal)
        bound, found = _best(program, near if mean is None else ROUGH)
        self._stands = found.middle
        middle = self._design(found.middle) if self.search.stiffness_alone else None
        orders = [order for head in heads for order in head.orders]
        return bound if root is not None else size * bound, self._pull(orders, lines, found), middle

    def under_all(self, heads: Sequence[Head], known: Array) -> Program:
        """Conditions of designs of which a norm is not over the whole."""
        if len(heads) == 1 and not heads[0].beside:
            own = [(head.at_most(self.most / head.share) / head.unit) ** 2 for head in heads]
            program, _ = self._program(heads, np.zeros(len(heads)))
            return replace(program, tops=np.append(own, program.tops[len(own) :]))
        mean = self._mean(heads, known)
        size = float(mean.prices.sum())
        return replace(self._program(heads, mean.prices / size, mean)[0], goal=mean.goal(size, self.most))

    def _program(self, heads: Sequence[Head], prices: Array, mean: Mean | None = None) -> tuple[Program, list[Line]]:
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
            if mean is not None:
                own = lengths_of(head, self.each, lines[first:], at)
                roots.append(Root(prices[number], float(mean.least[number]), float(mean.top[number]), own))
        held += self._aside({order.part for head in heads for order in head.orders}, lines[0].size)
        more = self.search.limits.added(heads, len(heads), self._line_of, lines)
        lines += more.lines
        program = Program(
            tuple(line.size for line in lines), tuple(line.reaches for line in lines), self.mounts.numbers,
            lines[0].columns, np.append(0.0 * prices if roots else prices, np.zeros(len(more.tops))),
            [*caps, *more.caps], [*held, *more.held], more.budgets, self.search.columns.sets, roots, self.modes,
            np.append(np.full(len(heads), math.inf), more.tops),
        )  # fmt: skip
        return program, lines

    def _aside(self, parts: Set[int], size: int) -> list[Held]:
        """What stiffness has to keep in motions of a half that no order is followed in (E57)."""
        others = [mounts for k, mounts in enumerate(self.parts) if k and k not in parts and 0 not in parts]
        return [limit for mounts in others for limit in of_stiffness(mounts, size)]

    def _design(self, s: Array) -> Array:
        """Open numbers at s, where every number is one of them."""
        out = 0.5 * (self.lower + self.upper)[: self.search.mount_numbers]
        for j, follows_ in enumerate(self.mounts.keys):
            out[follows_[0]] += 0.5 * (self.upper - self.lower)[follows_[0]] * s[j]
        return out

    def _pull(self, orders: Sequence[Order], lines: Sequence[Line], found: Proposed) -> Array:
        """By decision, what of the products is not that of s, in forces that count."""
        pull, s = np.zeros(len(self.lower)), found.middle
        for order, line, moments in zip(orders, lines, found.moments, strict=False):
            size = float(np.sum(squared(self.each.felt(line) / line.unit) * moments)) or 1.0
            mounts = self.parts[order.part]
            for spring, (seen, added) in zip(mounts.springs, line.springs, strict=True):
                apart = spring.in_forces(added - np.tensordot(s, spring.slopes(len(s)), 1) @ seen, order.omega)
                share = max(float(np.sum(squared(apart) * moments)), 0.0) / size
                self._spread(pull, [j for j, _ in spring.terms], share)
            for place, (seen, moved) in zip(mounts.places, line.places, strict=True):
                apart = place.in_forces(moved - s[place.number] * seen, order.omega)
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
        left = (self.upper - self.lower) / np.maximum(self.search.upper - self.search.lower, 1e-300)
        best = max(follows_, key=lambda j: left[j])
        pull[best] += share


def worth(pull: Array, hidden: Array, lacking: float) -> Array:
    """Sides by the larger of two shares: of the largest pull, and of what is lacking; finite where nothing is."""
    least = max(WORTH * lacking, 1e-100 * float(hidden.max()), 1e-300)
    return np.maximum(pull / max(float(pull.max()), 1e-300), hidden / least)


def _matter(shares: Array) -> Mask:
    """Which of some parts of a mean are worth a relaxation."""
    return np.asarray(shares > SMALL * shares.sum())


def _best(program: Program, near: float) -> tuple[float, Proposed]:
    """What follows from what a solver says; it is asked again where that is far under what it takes for the least."""
    best: tuple[float, Proposed] | None = None
    for found in proposed(program):
        bound = follows(program, found.multipliers)
        best = (bound, found) if best is None or bound > best[0] else best
        if bound >= near * found.least:
            break
    assert best is not None
    return best
