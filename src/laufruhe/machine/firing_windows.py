"""Within which angles throws keep a firing order and bounds on their firing intervals (S26).

A cylinder fires at t_k = 2 pi l_k - (theta_p + c_k), p its throw, c_k what its pin and bank add, l_k whole
turns. Bounds on intervals, and on throws, are bounds on differences of two throws, or of a throw and
nothing: a network whose shortest paths are the tightest bounds, and which no crank keeps where a circle is negative.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array

SLACK = 1e-7
"""By which firing intervals may miss their bounds [rad]: a rounding of the programs that place throws."""
# a circle of bounds that is negative by a rounding
_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class FiringWindow:
    """Throws that fire in one order, each cylinder at one of its dead centres.

    Attributes
    ----------
    order
        Cylinder numbers; empty where firings are in no order and intervals without bounds.
    laps
        l_k of every cylinder.
    paths
        Most by which throw j stands ahead of throw i [rad], shape (throws + 1, throws + 1); the last is no throw
        but the angle 0.
    """

    order: tuple[int, ...]
    laps: tuple[int, ...]
    paths: Array

    @property
    def box(self) -> tuple[Array, Array]:
        """Least and largest angle of every throw [rad]."""
        return -self.paths[:-1, -1], self.paths[-1, :-1].copy()

    def within(self, lower: Array, upper: Array) -> tuple[Array, Array] | None:
        """The least box that holds all throws of a box that keep the window; None where there are none."""
        paths = self.paths.copy()
        paths[-1, :-1] = np.minimum(paths[-1, :-1], upper)
        paths[:-1, -1] = np.minimum(paths[:-1, -1], -lower)
        # the window's own paths are shortest: a shorter one goes through the angle 0
        ahead = np.min(paths[-1, :, None] + self.paths, axis=0)
        behind = np.min(self.paths + paths[:, -1][None, :], axis=1)
        low, high = -behind[:-1], ahead[:-1]
        if np.any(low > high + _ROUNDING):
            return None
        return np.minimum(low, high), np.maximum(low, high)


def lateness(layout: Layout) -> tuple[float, ...]:
    """c_k of every cylinder: by how much it fires sooner than a throw at theta = 0 [rad]."""
    zero = [0.0] * len(layout.throw_positions)
    return tuple(-math.tau * float(layout.dead_centre(zero, k)) for k in range(len(layout.positions)))


@dataclass(frozen=True)
class FiringBounds:
    """What firing has to keep.

    Attributes
    ----------
    least, most
        Of every firing interval [rad].
    throws
        Bounds of every throw [rad]; None where they are open, and cylinder 1 is at its dead centre at phi = 0.
    order
        Firing order; None where it is open.
    """

    cycle: Cycle
    layout: Layout
    least: float
    most: float
    throws: tuple[tuple[float, float], ...] | None
    order: tuple[int, ...] | None

    @cached_property
    def late(self) -> tuple[float, ...]:
        """c_k of every cylinder [rad]."""
        return lateness(self.layout)

    @property
    def anywhere(self) -> FiringWindow:
        """Throws within bounds of their own, whatever fires when."""
        return FiringWindow((), (0,) * len(self.layout.positions), self._start())

    def windows(self) -> Iterator[FiringWindow]:
        """Every order and choice of dead centres that some throws keep, one after the other."""
        order = self.order or tuple(range(1, len(self.layout.positions) + 1))
        first = order[0] - 1 if self.order else 0
        yield from self._grown((first,), {first: 0}, self._start())

    def rows(self, window: FiringWindow) -> tuple[Array, Array]:
        """Firing intervals as A theta + b, shapes (n, throws) and (n,)."""
        order, late = [number - 1 for number in window.order], self.late
        moments = np.zeros((len(order), len(self.layout.throw_positions)))
        moments[np.arange(len(order)), [self.layout.pins[k] for k in order]] = -1.0
        constants = math.tau * np.array(window.laps)[order] - np.array(late)[order]
        following = np.roll(constants, -1)
        following[-1] += self.cycle.angle
        return np.roll(moments, -1, axis=0) - moments, following - constants

    def _start(self) -> Array:
        count = len(self.layout.throw_positions)
        paths = np.full((count + 1, count + 1), math.inf)
        np.fill_diagonal(paths, 0.0)
        if self.throws is None:
            own, late = self.layout.pins[0], self.late[0]
            paths[-1, own], paths[own, -1] = -late, late
        else:
            paths[-1, :-1] = [high for _, high in self.throws]
            paths[:-1, -1] = [-low for low, _ in self.throws]
            paths[:-1, :-1] = np.minimum(paths[:-1, :-1], paths[:-1, -1:] + paths[-1:, :-1])
        return paths

    def _grown(self, fired: tuple[int, ...], laps: dict[int, int], paths: Array) -> Iterator[FiringWindow]:
        count = len(self.layout.positions)
        if len(fired) == count:
            closed = self._apart(paths, fired[-1], laps[fired[-1]], fired[0], laps[fired[0]], wrapped=True)
            if closed is not None:
                yield FiringWindow(tuple(k + 1 for k in fired), tuple(laps[k] for k in range(count)), closed)
            return
        before, pins = fired[-1], self.layout.pins
        told = [self.order[len(fired)] - 1] if self.order else [k for k in range(count) if k not in laps]
        used = {pins[j] for j in fired}
        back, there = paths[:, pins[before]].tolist(), paths[pins[before]].tolist()
        for k in told:
            own = pins[k]
            free = self.throws is None and own not in used
            for lap in (0,) if free else self._laps(k, before, laps[before], back[own], there[own]):
                longer = self._apart(paths, before, laps[before], k, lap)
                if longer is not None:
                    yield from self._grown((*fired, k), {**laps, k: lap}, longer)

    def _laps(self, k: int, before: int, lap_before: int, back: float, there: float) -> Sequence[int]:
        """Whole turns that let cylinder k fire after another, whose throw is at most so far back, or there ahead."""
        # 2 pi l = interval + theta_own + c_own + t_before
        still = self.late[k] - self.late[before] + math.tau * lap_before
        low = self.least + still - back
        high = min(self.most, math.tau) + still + there
        return range(math.ceil((low - SLACK) / math.tau), math.floor((high + SLACK) / math.tau) + 1)

    def _apart(
        self, paths: Array, before: int, lap_before: int, after: int, lap_after: int, wrapped: bool = False
    ) -> Array | None:
        """Paths with the bounds of one more interval; None where nothing keeps them."""
        pins, late = self.layout.pins, self.late
        still = math.tau * (lap_after - lap_before) - late[after] + late[before]
        still += self.cycle.angle if wrapped else 0.0
        most = self.most if wrapped else min(self.most, math.tau)
        p, q = pins[before], pins[after]
        # least <= theta_p - theta_q + still <= most
        ahead, behind = most - still + SLACK, still - self.least + SLACK
        if p == q:
            return paths if min(ahead, behind) >= -_ROUNDING else None
        there, back = float(paths[q, p]), float(paths[p, q])
        # paths are shortest: the most negative circle through a new bound returns by one of them
        if min(ahead + back, behind + min(ahead, there)) < -_ROUNDING:
            return None
        return _tightened(_tightened(paths, q, p, ahead), p, q, behind)


def _tightened(paths: Array, i: int, j: int, most: float) -> Array:
    """Shortest paths when j stands no more ahead of i than this."""
    if most >= paths[i, j]:
        return paths
    return np.minimum(paths, paths[:, i : i + 1] + most + paths[j : j + 1, :])
