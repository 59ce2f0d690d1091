"""Angles at which throws keep a firing order and bounds on firing intervals (S26).

Cylinder k fires at t_k = 2 pi l_k - (theta_p + c_k), with l_k whole turns, theta_p the angle of its throw p, and c_k
what its pin and bank add. Bounds on intervals and on throws are bounds on differences of two throws, or of a throw and
zero. These differences form a network whose shortest paths are the tightest bounds. If a closed path is negative, no
crank keeps the bounds.

If the bank angle or the split pins are open, own angles of the cylinders take the place of throws: theta_p - s_k beta.
Here beta is the sum of the open angles, and s_k = +- 1/2 the side of cylinder k. Own angles of two cylinders on one
throw differ by a multiple of beta. Open throws count from the crank with cylinder 1 at its dead centre, as
theta_p - s_1 beta.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array, Indices

SLACK = 1e-7
"""Angle by which firing intervals may miss their bounds [rad]: a rounding of the programs that place throws."""
# a closed path of bounds may be negative by this rounding error
_ROUNDING = 1e-10
# rounds in which throws and open angles narrow each other
_ROUNDS = 3


def _range(shares: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    up, down = np.maximum(shares, 0.0), np.minimum(shares, 0.0)
    return up @ lower + down @ upper, up @ upper + down @ lower


@dataclass(frozen=True, eq=False)
class FiringWindow:
    """Throws that fire in one order, each cylinder at one of its dead centres.

    Attributes
    ----------
    order
        Cylinder numbers; empty where firings are in no order and intervals without bounds.
    laps
        Whole turns l_k of every cylinder.
    paths
        Largest angle by which own angle j is ahead of own angle i [rad], shape (own angles + 1, own angles + 1); the
        last row and column are those of the angle zero.
    bounds
        Conditions that the window keeps.
    """

    order: tuple[int, ...]
    laps: tuple[int, ...]
    paths: Array
    bounds: FiringBounds

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Smallest and largest value of every throw and open angle [rad]."""
        return self.within(*self.bounds.root) or self.bounds.root

    def within(self, lower: Array, upper: Array) -> tuple[Array, Array] | None:
        """Return the smallest box of throw angles with all throws of a box that are in this window; None if empty."""
        for _ in range(_ROUNDS if self.bounds.open_angles else 1):
            paths = self.bounds.shortened(self.paths, lower, upper)
            if paths is None:
                return None
            low, high = self.bounds.tightened(paths, lower, upper)
            if np.any(low > high + _ROUNDING):
                return None
            lower, upper = np.minimum(low, high), np.maximum(low, high)
        return lower, upper


@dataclass(frozen=True)
class FiringBounds:
    """Conditions on firing: intervals, throws, order and open angles.

    Attributes
    ----------
    minimum, maximum
        Bounds of every firing interval [rad].
    throws
        Bounds of every throw [rad]; None where they are open, and cylinder 1 is at its dead centre at phi = 0.
    order
        Firing order; None where it is open.
    open_angles
        Bounds of the bank angle and of the split pins' angle, those of them that are open [rad].
    """

    cycle: Cycle
    layout: Layout
    minimum: float
    maximum: float
    throws: tuple[tuple[float, float], ...] | None
    order: tuple[int, ...] | None
    open_angles: tuple[tuple[float, float], ...] = ()

    @cached_property
    def advance(self) -> tuple[float, ...]:
        """Crank angle c_k by which every cylinder fires before a throw at theta = 0, with open angles at zero [rad]."""
        layout, minimum = self.layout, sum(low for low, _ in self.open_angles)
        zero = [0.0] * len(layout.throw_positions)
        return tuple(
            -(math.tau * float(layout.dead_centre(zero, k)) - layout.side(k) * minimum)
            for k in range(len(layout.positions))
        )

    def share(self, k: int) -> float:
        """Return the share of an open angle in the own angle of cylinder k, from cylinder 1 if throws are open."""
        return (self.layout.side(0) if self.throws is None else 0.0) - self.layout.side(k) if self.open_angles else 0.0

    @cached_property
    def _named(self) -> list[tuple[int, float]]:
        return sorted({(pin, self.share(k)) for k, pin in enumerate(self.layout.pins)})

    @cached_property
    def _angle_index(self) -> list[int]:
        return [self._named.index((pin, self.share(k))) for k, pin in enumerate(self.layout.pins)]

    @cached_property
    def angle_throws(self) -> Indices:
        """Throw of every distinct own angle of the cylinders: throw angle plus shares of open bank and pin angles."""
        return np.array([pin for pin, _ in self._named])

    @cached_property
    def shares(self) -> Array:
        """Shares of the open angles in every own angle, shape (own angles, open angles)."""
        return np.tile(np.array([share for _, share in self._named])[:, None], len(self.open_angles))

    @cached_property
    def _differences(self) -> tuple[Indices, Indices]:
        first, second = np.nonzero(self.angle_throws[:, None] == self.angle_throws[None, :])
        return first[first != second], second[first != second]

    def shortened(self, paths: Array, lower: Array, upper: Array) -> Array | None:
        """Return bounds of all differences of throw angles in a box, by shortest paths; None if infeasible."""
        count = len(lower) - self.shares.shape[1]
        minimum, maximum = _range(self.shares, lower[count:], upper[count:])
        paths = paths.copy()
        paths[-1, :-1] = np.minimum(paths[-1, :-1], upper[self.angle_throws] + maximum)
        paths[:-1, -1] = np.minimum(paths[:-1, -1], -(lower[self.angle_throws] + minimum))
        first, second = self._differences
        _, ahead = _range(self.shares[second] - self.shares[first], lower[count:], upper[count:])
        paths[first, second] = np.minimum(paths[first, second], ahead)
        for k in range(len(paths)):
            paths = np.minimum(paths, paths[:, k : k + 1] + paths[k : k + 1, :])
        return None if np.any(np.diag(paths) < -_ROUNDING) else paths

    def tightened(self, paths: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return a smaller box of throws and open angles, from bounds of their differences (shortest paths)."""
        count = len(lower) - self.shares.shape[1]
        low, high = lower.copy(), upper.copy()
        minimum, maximum = _range(self.shares, lower[count:], upper[count:])
        np.minimum.at(high, self.angle_throws, paths[-1, :-1] - minimum)
        np.maximum.at(low, self.angle_throws, -paths[:-1, -1] - maximum)
        first, second = self._differences
        # shares @ angles is at most the room
        rows = [self.shares[second] - self.shares[first], self.shares, -self.shares]
        room = [paths[first, second], paths[-1, :-1] - low[self.angle_throws], paths[:-1, -1] + high[self.angle_throws]]
        for row, most_of_it in zip(np.concatenate(rows), np.concatenate(room), strict=True):
            for s in np.flatnonzero(row):
                others = np.where(np.arange(len(row)) == s, 0.0, row)
                end = (most_of_it - _range(others[None], low[count:], high[count:])[0][0]) / row[s]
                if row[s] > 0.0:
                    high[count + s] = min(high[count + s], end)
                else:
                    low[count + s] = max(low[count + s], end)
        return low, high

    @cached_property
    def root(self) -> tuple[Array, Array]:
        """Bounds of throws and open angles [rad]."""
        free = ((-math.inf, math.inf),) * len(self.layout.throw_positions)
        every = np.array([*(self.throws or free), *self.open_angles])
        if self.throws is None:
            # cylinder 1 is at its dead centre when phi = 0
            every[self.layout.pins[0]] = -self.advance[0]
        return every[:, 0], every[:, 1]

    @property
    def anywhere(self) -> FiringWindow:
        """Window of the bounds on throws alone, without a firing order."""
        return FiringWindow((), (0,) * len(self.layout.positions), self._start(), self)

    def windows(self) -> Iterator[FiringWindow]:
        """Yield all feasible firing windows: firing orders, each with the whole turns at which cylinders fire."""
        firsts = [self.order[0] - 1] if self.order else [0]
        if self.order is None and self.maximum > math.tau + SLACK:
            # the cylinder whose first dead centre comes more than a turn after all others need not be cylinder 1
            firsts = list(range(len(self.layout.positions)))
        for first in firsts:
            yield from self._grown((first,), {first: 0}, self._start())

    def rows(self, window: FiringWindow) -> tuple[Array, Array]:
        """Return firing intervals as A u + b of throws and open angles u, shapes (n, u) and (n,)."""
        order, advance = [number - 1 for number in window.order], self.advance
        throws = len(self.layout.throw_positions)
        moments = np.zeros((len(order), throws + len(self.open_angles)))
        moments[np.arange(len(order)), [self.layout.pins[k] for k in order]] = -1.0
        moments[:, throws:] = -np.array([self.share(k) for k in order])[:, None]
        constants = math.tau * np.array(window.laps)[order] - np.array(advance)[order]
        following = np.roll(constants, -1)
        following[-1] += self.cycle.angle
        return np.roll(moments, -1, axis=0) - moments, following - constants

    def _start(self) -> Array:
        count = len(self.angle_throws)
        paths = np.full((count + 1, count + 1), math.inf)
        np.fill_diagonal(paths, 0.0)
        shortened = self.shortened(paths, *self.root)
        assert shortened is not None
        return shortened

    def _grown(self, fired: tuple[int, ...], laps: dict[int, int], paths: Array) -> Iterator[FiringWindow]:
        count = len(self.layout.positions)
        if len(fired) == count:
            closed = self._with_interval(paths, fired[-1], laps[fired[-1]], fired[0], laps[fired[0]], wrapped=True)
            if closed is not None:
                window = FiringWindow(tuple(k + 1 for k in fired), tuple(laps[k] for k in range(count)), closed, self)
                # own angles of different throws may still want other angles of banks and pins
                if not self.open_angles or window.within(*self.root) is not None:
                    yield window
            return
        before, pins = fired[-1], self.layout.pins
        candidates = [self.order[len(fired)] - 1] if self.order else [k for k in range(count) if k not in laps]
        used, last = {pins[j] for j in fired}, self._angle_index[before]
        back, there = paths[:, last].tolist(), paths[last].tolist()
        for k in candidates:
            angle_index, still = self._angle_index[k], self.advance[k] - self.advance[before] + math.tau * laps[before]
            # 2 pi l = interval + theta_own + c_own + t_before
            low = self.minimum + still - back[angle_index]
            high = min(self.maximum, math.tau) + still + there[angle_index]
            choices = range(1)
            if self.throws is not None or pins[k] in used:
                choices = range(math.ceil((low - SLACK) / math.tau), math.floor((high + SLACK) / math.tau) + 1)
            for lap in choices:
                longer = self._with_interval(paths, before, laps[before], k, lap)
                if longer is not None:
                    yield from self._grown((*fired, k), {**laps, k: lap}, longer)

    def _with_interval(
        self, paths: Array, before: int, lap_before: int, after: int, lap_after: int, wrapped: bool = False
    ) -> Array | None:
        """Return shortest paths with the bounds of the interval between two firings added; None if infeasible.

        `before` and `after` are indices of the cylinders, with the whole turns of their firings. `wrapped` is True for
        the interval from the last firing to the first one of the next cycle.
        """
        advance = self.advance
        still = math.tau * (lap_after - lap_before) - advance[after] + advance[before]
        still += self.cycle.angle if wrapped else 0.0
        maximum = self.maximum if wrapped else min(self.maximum, math.tau)
        # of orders that are rotations of each other, only the one with cylinder 1 first counts
        minimum = max(self.minimum, math.tau) if wrapped and after and self.order is None else self.minimum
        p, q = self._angle_index[before], self._angle_index[after]
        # minimum <= theta_p - theta_q + still <= maximum
        ahead, behind = maximum - still + SLACK, still - minimum + SLACK
        if p == q:
            return paths if min(ahead, behind) >= -_ROUNDING else None
        there, back = float(paths[q, p]), float(paths[p, q])
        # as paths are shortest, the most negative circle through a new bound returns by one of them
        if min(ahead + back, behind + min(ahead, there)) < -_ROUNDING:
            return None
        return _tightened(_tightened(paths, q, p, ahead), p, q, behind)


def _tightened(paths: Array, i: int, j: int, maximum: float) -> Array:
    if maximum >= paths[i, j]:
        return paths
    return np.minimum(paths, paths[:, i : i + 1] + maximum + paths[j : j + 1, :])
