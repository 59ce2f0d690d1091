"""What no mounts of a box, with any unbalances, go under: multipliers of its corners, mixed (E69).

On given mounts multipliers Z_k prove what unbalances can reach, and what they say is affine in the unbalances on other
mounts too (P4). Shares b_k >= 0 that are linear in every s and add up to one mix the multipliers of all corners of a
box into multipliers of each of its mounts:

    N(V(s, u)) >= sum_k b_k(s) <Z_k, V(s, u)> = a(s) + g(s) . u

At a corner these are its own, so that nothing is lost there. V is a quadratic in s and a rest (E68), so a and g are
cubic in every s, and none of their values is outside of their Bernstein coefficients: the least of a_v + min_u g_v . u
over these, u in the sets of unbalances, bounds all designs of the box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.joint_mounts.bernstein import corners_of, mixed
from laufruhe.extensions.joint_mounts.corner_loads import CornerLoads, Pairing
from laufruhe.extensions.joint_mounts.mount_loops import Loop, is_looped, mount_loop
from laufruhe.extensions.joint_mounts.multipliers import best_at
from laufruhe.extensions.joint_mounts.rest_limits import RestLimits
from laufruhe.load_models.affine import FEASIBLE, MOST_NUMBERS
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.problem.decision import sides_of
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import Around, Bounded, Box, Divided
from laufruhe.prove.certificate import Multipliers
from laufruhe.prove.mounts.box_series import balanced, rest_of
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.subdivision import EVEN, divides
from laufruhe.prove.witness import Known, check_around

MOST_OPEN = 5
"""Open numbers of mounts, whose corners and coefficients are 2 and 4 to their power."""
MOST_CORNERS, ROWS = 1200, 7e6
"""Corners whose multipliers are sought, and rows of all of them."""
BOXES = 4
"""Boxes of three numbers or fewer, for each corner."""
WORTH = 0.7
"""Of a gain, under which the series of an order ends soon enough for multipliers to tell anything."""
FEW = 2
"""Times as many corners as a box has are worth beginning with."""
NO_PRICE = 1e-8
"""Of the objective, what all of a limit is worth that has no price."""
ROUNDS, STEPS = 2, 40
"""Times that prices of several limits are sought in turn, and steps to each."""
_SHARE = 0.5 * (math.sqrt(5.0) - 1.0)

Judge: TypeAlias = Callable[[Array, Array], float]
"""Objective of mounts and unbalances by the exact model, infinite where they break a limit."""


@dataclass(frozen=True, eq=False)
class Corner:
    """What is known on the mounts of a corner.

    Attributes
    ----------
    columns
        Of the best unbalances, or of those that break the limits least.
    pairing
        What its multipliers say of all mounts; None where they say nothing.
    """

    columns: Array
    pairing: Pairing | None


def mixes_corners(problem: Problem) -> bool:
    """Return whether unbalances or other numbers of mounts are open, several but few, and all that is asked are loads.

    Boxes of one number, and of stiffness alone, are few without corners.
    """
    terms, few = problem.load_terms, len(problem.decisions) > 1 and len(problem.mount_decisions) <= MOST_OPEN
    of_loads = named_part(problem) is problem and not problem.mount_terms and len(terms) == len(problem.objective)
    if not (few and of_loads) or divides(problem):
        return False
    loads = [measure for measure in problem.measures if measure.is_load]
    plain = all(not measure.load.adds_up for measure in loads if measure.on_mounts) and not problem.known_rows
    return plain and is_looped(problem) and any(term.measure.on_mounts for term in terms)


class DesignBoxes:
    """Bounds of boxes.

    Attributes
    ----------
    value
        Of the best design known.
    best
        Its mounts and columns, where it was met at a corner.
    """

    what, at_once = "boxes of mounts, with unbalances", 2

    def __init__(self, problem: Problem, value: float, judge: Judge) -> None:
        # as they are told
        problem = with_default_sampling(problem)
        self.loads, self.value, self._judge = CornerLoads(problem), value, judge
        self.lower, self.upper = sides_of(problem.mount_decisions)
        self._rest = RestLimits(problem)
        self._corners: dict[tuple[float, ...], Corner] = {}
        asked = [term.measure for term in problem.load_terms if term.measure.on_mounts]
        self._felt = np.any([self._counts(measure) for measure in asked], axis=0)
        self.best: tuple[Array, Array] | None = None

    def _counts(self, measure: Measure) -> Mask:
        """Orders that count in it."""
        orders, shares = self.loads.orders, measure.shares(self.loads.problem.points)
        return np.asarray((shares[orders.points] > 0.0) & measure.counted(orders.numbers))

    @property
    def most_boxes(self) -> int:
        """As many as some tens of seconds allow."""
        count = len(self.lower)
        if self.most_corners < FEW * 2**count or self.loads.rows * self.loads.columns > MOST_NUMBERS:
            return 0
        return self.loads.problem.search.boxes_or(BOXES * self.most_corners // max(4 ** (count - 3), 1))

    @property
    def most_corners(self) -> int:
        """As many as their rows allow."""
        return int(min(MOST_CORNERS, ROWS / max(self.loads.rows, 1)))

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least objective on every box, and the side worth halving."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            found = [self._bound(*box) for box in zip(lower, upper, strict=True)]
        return np.array([bound for bound, _ in found]), np.array([side for _, side in found], dtype=np.intp)

    def corner(self, mounts: Array) -> Corner:
        """What is known there."""
        key = tuple(mounts.tolist())
        if key not in self._corners:
            self._corners[key] = self._new_corner(mounts)
        return self._corners[key]

    def _new_corner(self, mounts: Array) -> Corner:
        problem = self.loads.at(mounts)
        if not all(np.isfinite(norm.constant).all() for _, norm in (*problem.terms, *problem.limits)):
            return Corner(problem.start, None)
        columns, multipliers = best_at(problem)
        value = problem.objective(columns)
        # a price that is a rounding would be felt where nothing is known of what it is of
        felt = tuple(
            z if norm.dual_norm(z) * most > NO_PRICE * value else np.zeros_like(z)
            for (most, norm), z in zip(problem.limits, multipliers.limits, strict=True)
        )
        pairing = self.loads.pairing(problem, Multipliers(multipliers.terms, felt))
        if value < self.value and problem.excess(columns) <= FEASIBLE:
            judged = self._judge(mounts, columns)
            if judged < self.value:
                self.value, self.best = judged, (mounts, columns)
        return Corner(columns, pairing)

    def _bound(self, lower: Array, upper: Array) -> tuple[float, int]:
        over = self._rest.over(lower, upper)
        if any(each.min() > 0.0 for each in over):
            return math.inf, 0
        loop = mount_loop(self.loads.problem, self.loads.orders.omegas, lower, upper)
        even = _Even.of(loop, len(lower))
        if not (even.most[self._felt] < WORTH).all():
            # little is known before the series of all orders end
            return 0.0, int(np.argmax(even.pull(self._felt) + EVEN * (upper - lower) / (self.upper - self.lower)))
        places = [np.where(end < 0.0, lower, upper) for end in corners_of(len(lower))]
        known = [self._corners.get(tuple(place.tolist())) for place in places]
        found, is_over = None, len(self._corners) >= self.most_corners
        if is_over and not any(known):
            return 0.0, int(np.argmax((upper - lower) / (self.upper - self.lower)))
        if any(known) and not all(known):
            # multipliers of other mounts are enough where all designs are worse by far
            found = self._mixed(even, over, [each or _next(places, known, k) for k, each in enumerate(known)])
            if found[0] >= self.value or is_over:
                return found
        bound, side = self._mixed(even, over, [self.corner(place) for place in places])
        return (bound, side) if found is None or bound >= found[0] else (found[0], side)

    def _mixed(self, even: _Even, over: list[Array], corners: Sequence[Corner]) -> tuple[float, int]:
        """Bound by multipliers of all corners, and the side that takes most of it."""
        near = np.mean([corner.columns for corner in corners], axis=0)
        met = self._met(even, near)
        ends = np.array([d.ends for d in self.loads.domains for _ in range(d.width)]).reshape(-1, 2)
        reach = np.append(1.0, np.abs(ends - near[:, None]).max(axis=1))
        told, rests = zip(*(self._told(corner.pairing, met, near) for corner in corners), strict=True)
        rest = np.array(rests) @ reach
        if not (np.isfinite(rest).all() and np.isfinite(told).all()):
            return 0.0, int(np.argmax(even.pull(np.ones_like(self._felt))))
        mixes = np.einsum("vkp,kcp->vc", mixed(even.count), np.array(told), optimize=True)
        least = np.array([line[0] + self.least(line[1:], near) for line in mixes])
        # shares of corners add up to one, so that no more is left than of the worst
        least = priced(least, over) - rest.sum(axis=1).max()
        pull = _bent(least.reshape((4,) * even.count)) + even.shares.T @ rest[rest.sum(axis=1).argmax()]
        return max(float(least.min()), 0.0), int(np.argmax(pull))

    def said(self, pairing: Pairing, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
        """Of a corner in a box about its unbalances: these, and what `_told` gives."""
        loop = mount_loop(self.loads.problem, self.loads.orders.omegas, lower, upper)
        near = self.corner(lower).columns
        return near, *self._told(pairing, self._met(_Even.of(loop, len(lower)), near), near)

    def _met(self, even: _Even, near: Array) -> _Met:
        orders = self.loads.orders
        still = orders.loads[:, :1] + np.einsum("q,wqi->wi", near, orders.loads[:, 1:])[:, None]
        return _Met(even, np.concatenate([still, orders.loads[:, 1:]], axis=1))

    def _told(self, pairing: Pairing | None, met: _Met, near: Array) -> tuple[Array, Array]:
        """By (1, s, s s') and columns what multipliers say, (1 + columns, p); and the rest, (w, 1 + columns)."""
        found, rest = np.zeros((1 + len(near), 1 + met.count + met.count**2)), np.zeros(met.loads.shape[:2])
        if pairing is None:
            return found, rest
        found[0, 0], found[1:, 0] = pairing.constant + pairing.slopes @ near, pairing.slopes
        for duals, maps in ((pairing.forces, met.loop.forces), (pairing.travels, met.loop.travels)):
            if duals.any():
                own, left = met.of(duals.conj(), maps)
                found, rest = found + own, rest + left
        return found, rest

    def least(self, slopes: Array, near: Array) -> float:
        """min g . (u - near) over the sets of unbalances."""
        return float(sum(domain.least(slopes) for domain in self.loads.domains) - slopes @ near)


@dataclass(frozen=True, eq=False)
class _Even:
    """A loop with channels counted so that what goes through each is about what comes back (E37).

    Attributes
    ----------
    count
        Open numbers.
    balance
        Diagonal of T, shape (w, m).
    gain
        T G T^-1, shape (w, m, m).
    most
        Its norm, shape (w,).
    """

    loop: Loop
    count: int
    balance: Array
    gain: ComplexArray
    most: Array

    @classmethod
    def of(cls, loop: Loop, count: int) -> _Even:
        """Of a loop."""
        return cls(loop, count, *balanced(loop.gain))

    @property
    def own(self) -> Array:
        """One where a channel is of a number, shape (m, n)."""
        return np.asarray((self.loop.own[:, None] == np.arange(self.count)).astype(float))

    @property
    def sizes(self) -> Array:
        """What each number has of the gain, (w, n)."""
        squares = np.nan_to_num(np.square(np.abs(self.gain)), nan=1.0, posinf=1.0)
        return np.asarray(np.sqrt((squares.sum(axis=1) + squares.sum(axis=2)) @ self.own))

    @property
    def shares(self) -> Array:
        """The same of one in all, (w, n)."""
        sizes = self.sizes
        return np.asarray(sizes / np.maximum(sizes.sum(axis=1, keepdims=True), 1e-300))

    def pull(self, felt: Mask) -> Array:
        """By how much each number keeps the series of these orders from ending, (n,)."""
        return np.asarray(self.sizes[felt & ~(self.most < WORTH)].max(axis=0, initial=0.0))


class _Met:
    """What loads meet in a box: z0 of every column, and what is left of its series (E68)."""

    def __init__(self, even: _Even, loads: ComplexArray) -> None:
        self.loop, self.loads, self.count, self._own = even.loop, loads, even.count, even.own
        self._met, self._balance = np.einsum("wmi,wci->wcm", self.loop.met, loads, optimize=True), even.balance
        hit = np.abs(self._met) * even.balance[:, None]
        # what a column does not load stays at rest
        self._rest = np.where(hit.any(axis=-1), rest_of(even.gain[:, None], even.most[:, None], hit), 0.0)

    def of(self, duals: ComplexArray, maps: tuple[ComplexArray, ComplexArray]) -> tuple[Array, Array]:
        """Sums over orders of Z* f: by (1, s, s s') and columns, and what the rest of orders and columns may add."""
        still = np.einsum("wr,wri->wi", duals, maps[0], optimize=True)
        pulls = np.einsum("wr,wrm->wm", duals, maps[1], optimize=True)
        constant = np.einsum("wi,wci->c", still, self.loads, optimize=True).real
        first = np.einsum("wm,wcm->cm", pulls, self._met, optimize=True).real @ self._own
        pairs = -np.einsum("wm,wmk,wck->cmk", pulls, self.loop.gain, self._met, optimize=True).real
        second = np.einsum("cmk,mi,kj->cij", pairs, self._own, self._own, optimize=True)
        size = np.linalg.norm(pulls / self._balance, axis=-1)[:, None]
        rest = np.where(size > 0.0, size * self._rest, 0.0)
        return np.column_stack([constant, first, second.reshape(len(constant), -1)]), np.asarray(rest)


def _next(places: Sequence[Array], known: Sequence[Corner | None], k: int) -> Corner:
    shared = [(int(np.sum(place == places[k])), -n) for n, place in enumerate(places) if known[n] is not None]
    found = known[-max(shared)[1]]
    assert found is not None
    return found


def _bent(values: Array) -> Array:
    """By how much coefficients lie under the straight lines between their ends at the most, along every side."""
    shares, found = np.arange(4) / 3.0, []
    for side in range(values.ndim):
        along = np.moveaxis(values, side, -1)
        straight = along[..., :1] * (1.0 - shares) + along[..., -1:] * shares
        found.append(float((straight - along).max()))
    return np.array(found)


class _Designing(Bounded):
    """Boxes halved until none may hold a better design, those met at corners included."""

    def __init__(self, search: DesignBoxes, room: float, known: Known | None = None) -> None:
        super().__init__(search, search.value, room, known)
        self._boxes = search

    def look(self, _: Box) -> None:
        """At the best corner so far."""
        self.value = min(self.value, self._boxes.value)


def designed_bound(boxes: DesignBoxes, room: float, known: Known | None = None) -> Divided:
    """Halve boxes of a problem that `mixes_corners`, until no design is more than `room` better than the best known."""
    division = _Designing(boxes, room, known)
    most = boxes.most_boxes
    if not most:
        return Divided(0.0, 0)
    found = division.run(division.bounded([(boxes.lower, boxes.upper)])[0], most)
    if known is not None:
        check_around(Around(boxes, boxes.lower, boxes.upper), known.place, known)
    return found


def priced(values: Array, over: list[Array]) -> Array:
    """Values with limits at the prices at which the least of them is largest, (v,); infinite where one is broken."""
    if any(float(each.min()) > 0.0 for each in over):
        return np.full_like(values, math.inf)
    for _ in range(ROUNDS if len(over) > 1 else 1):
        for each in over:
            values = values + _price(values, each) * each
    return values


def _price(values: Array, over: Array) -> float:
    """At which the least of values + price over is largest, which is concave in it (P4)."""

    def least(price: float) -> float:
        return float((values + price * over).min())

    worst = int(np.argmin(values))
    if over[worst] <= 0.0:
        return 0.0
    high = float(values.max() - values[worst]) / float(over[worst])
    low, best = 0.0, 0.0
    for _ in range(STEPS):
        one, two = high - _SHARE * (high - low), low + _SHARE * (high - low)
        if least(one) >= least(two):
            high = two
        else:
            low = one
        best = max(best, one, two, key=least)
    return best
