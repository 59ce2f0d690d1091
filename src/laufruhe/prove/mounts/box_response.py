"""Response of a block over a whole box of mount stiffnesses, with what the box can at most change (E37, E38, E41).

In coordinates in which the mass is one the impedance D(x) = A + i B - W^2 is linear in the stiffnesses x. About the
centre c of a box, with D_j its slopes and Q = sum_j (x_j - c_j) D(c)^-1 D_j,

    y = y0 - Q y0 + Q^2 y0 - ...,    y0 = D(c)^-1 r                                      (E37)

and what follows the square is at most rho / (1 - rho) |Q^2 y0|, rho = sum_j |x_j - c_j| |D(c)^-1 D_j|. Forces and
travel of the mounts are linear in x times y, so they are known up to the second order, and the rest is bounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, mounting_in
from laufruhe.problem.decision import sides_of
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

NOTHING = 1e-13


@dataclass(frozen=True, eq=False)
class Lines:
    """Orders of operating points that are answered together.

    Attributes
    ----------
    points, places
        Operating point, and place in its spectrum, shape (n,).
    orders, omegas
        Shape (n,); omega [rad/s].
    loads
        r in coordinates in which the mass is one, shape (n, 6).
    """

    points: Indices
    places: Indices
    orders: Array
    omegas: Array
    loads: ComplexArray

    def kept(self, which: NDArray[np.bool_]) -> Lines:
        """Some of them."""
        parts = (self.points[which], self.places[which], self.orders[which], self.omegas[which], self.loads[which])
        return Lines(*parts)

    def still(self) -> Lines:
        """The same loads at rest: what the mounts carry if they give no way (E11)."""
        return Lines(self.points, self.places, self.orders, np.zeros_like(self.omegas), self.loads)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Motion over boxes (E37): first and second order in shares of the half widths, shapes (boxes, lines, ...).

    Attributes
    ----------
    centres, halves
        Of the boxes, shape (boxes, n).
    motion
        y0, (..., 6).
    first, second
        Q_j y0 and Q_i Q_j y0, (..., n, 6) and (..., n, n, 6).
    size
        Bound of |Q^2 y0|, (...).
    rest
        Bound of what follows the square, (...); infinite where the series need not end.
    pull
        |Q_j|, (..., n): what splitting a side would lessen.
    """

    centres: Array
    halves: Array
    motion: ComplexArray
    first: ComplexArray
    second: ComplexArray
    size: Array
    rest: Array
    pull: Array

    @property
    def sides(self) -> Array:
        """By how much each side of every box keeps the expansion from ending, shape (boxes, n)."""
        return np.asarray(np.nan_to_num(self.pull, nan=1.0, posinf=1.0).max(axis=1, initial=0.0))


@dataclass(frozen=True, eq=False)
class Answer:
    """Forces or travel over boxes: value and slopes at the centre, and a bound of the rest (E37)."""

    value: ComplexArray
    slopes: ComplexArray
    rest: Array


@dataclass(frozen=True, eq=False)
class Matrices:
    """Of a mounting, in coordinates in which the mass is one.

    Attributes
    ----------
    stiffness, loss, damping
        A, and of B what does not grow with frequency and what does, shape (6, 6).
    springs, losses, dampers
        From motion to what each does to the mounts, shape (3 mounts, 6).
    """

    stiffness: Array
    loss: Array
    damping: Array
    springs: Array
    losses: Array
    dampers: Array


def is_travel(channel: Channel) -> bool:
    """Whether the motion of mounts is asked for, else their forces."""
    return channel is channels.MOUNT_TRAVEL


class BoxModel:
    """Matrices of a problem whose open numbers are stiffnesses alone.

    Parameters
    ----------
    problem
        On elastic mounts, with all but stiffness given.
    evaluation
        Of any design: its wrenches are those of all.

    Attributes
    ----------
    root
        From motion in coordinates in which the mass is one, shape (6, 6): its transpose takes coordinates there.
    """

    def __init__(self, problem: Problem, evaluation: Evaluation) -> None:
        self.problem, self.evaluation = problem, evaluation
        decisions = problem.mount_decisions
        self.lower, self.upper = sides_of(decisions)
        base = self.mounting(self.lower)
        self.root = mass_root(base.block)
        self.travels = (base.motions @ self.root.T).reshape(-1, 6)
        self._base, self._dynamic = self._parts(base), base.dynamic
        ends = [np.where(np.arange(len(decisions)) == j, self.upper, self.lower) for j in range(len(decisions))]
        moved = [self._parts(self.mounting(end)) for end in ends]
        self.slopes = {
            name: np.array(
                [
                    (getattr(other, name) - getattr(self._base, name)) / width
                    for other, width in zip(moved, self.upper - self.lower, strict=True)
                ]
            )
            for name in ("stiffness", "loss", "damping", "springs", "losses", "dampers")
        }
        self.highest = float(np.linalg.eigvalsh(self._parts(self.mounting(self.upper)).stiffness)[-1])

    def mounting(self, x: Array) -> ElasticMounting:
        """At these stiffnesses."""
        return mounting_in(self.problem.design([float(v) for v in x], self.problem.mount_decisions))

    def _parts(self, mounting: ElasticMounting) -> Matrices:
        seen = mounting.motions @ self.root.T
        totals = (self.root @ mounting.total(each) @ self.root.T for each in self._each(mounting))
        maps = ((each @ seen).reshape(-1, 6) for each in self._each(mounting))
        return Matrices(*totals, *maps)

    @staticmethod
    def _each(mounting: ElasticMounting) -> tuple[Array, Array, Array]:
        return mounting.springs, mounting.losses, mounting.dampers

    def lines(self, quantity: Measure | None = None) -> Lines:
        """Every order with a load; of a quantity, those that it counts."""
        moved = self.root @ moved_wrench(NUMBERS, self.mounting(self.lower).block.centre_of_gravity)
        found: list[tuple[int, int, float, float, ComplexArray]] = []
        for p, loads in enumerate(self.evaluation.loads):
            size = np.abs(loads.wrench.coefficients).max(axis=1, initial=0.0)
            for k in np.flatnonzero(size > NOTHING * size.max(initial=0.0)):
                order = float(loads.wrench.orders[k])
                found.append((p, int(k), order, order * loads.point.speed, moved @ loads.wrench.coefficients[k]))
        points, places, orders, omegas, loads_ = zip(*found, strict=True) if found else ((), (), (), (), ())
        lines = Lines(
            np.array(points, dtype=np.intp), np.array(places, dtype=np.intp), np.array(orders, dtype=float),
            np.array(omegas, dtype=float), np.array(loads_, dtype=complex).reshape(-1, 6),
        )  # fmt: skip
        if quantity is None:
            return lines
        keep = np.isin(lines.points, self.counted(quantity.points))
        return lines.kept(keep & quantity.counted(lines.orders))

    def samples_fully(self, lines: Lines) -> bool:
        """Whether each of these orders has more than two samples, over a period that is that of the loads."""
        base = self.problem.engine.cycle.base_order
        steps = [loads.wrench.base / base for loads in self.evaluation.loads]
        if any(step.denominator != 1 for step in steps):
            return False
        places = lines.places * np.array([int(step) for step in steps])[lines.points]
        return bool(2 * places.max(initial=0) < self.evaluation.samples)

    def counted(self, names: tuple[str, ...] | None) -> list[int]:
        """Operating points of these names; all when None."""
        return [k for k, point in enumerate(self.problem.points) if names is None or point.name in names]

    @property
    def stiffness_slopes(self) -> Array:
        """A by every open number, shape (n, 6, 6)."""
        return self.slopes["stiffness"]

    def stiffness(self, x: Array) -> Array:
        """A at many designs, shape (boxes, n) to (boxes, 6, 6)."""
        return self.at("stiffness", x)

    def added(self, omegas: Array) -> ComplexArray:
        """What springs whose stiffness depends on frequency add to the impedance, (lines, 6, 6) (E50)."""
        return self._dynamic.impedance(omegas, self.root.T)

    def added_forces(self, omegas: Array) -> ComplexArray:
        """What they add to the forces of the mounts, (lines, 3 mounts, 6)."""
        return self._dynamic.forces(omegas, self.root.T)

    def rise(self, omegas: Array) -> Array:
        """By how much they lift the largest eigenvalue at most, (lines,)."""
        if not self._dynamic:
            return np.zeros(len(omegas))
        return np.asarray(np.maximum(np.linalg.eigvalsh(self.added(omegas).real)[..., -1], 0.0))

    def at(self, name: str, x: Array) -> Array:
        """A matrix of `Matrices` at many designs, shape (boxes, n) to (boxes, ...)."""
        base: Array = getattr(self._base, name)
        return np.asarray(base + np.einsum("bn,nij->bij", x - self.lower, self.slopes[name]))

    def expanded(self, lines: Lines, lower: Array, upper: Array) -> Expansion:
        """Motion over boxes, shapes (boxes, n) (E37)."""
        centres, halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
        moving, omegas = (lines.omegas > 0.0)[:, None, None], lines.omegas[:, None, None]
        stiffness, loss, damping = (self.at(name, centres)[:, None] for name in ("stiffness", "loss", "damping"))
        impedance: ComplexArray = stiffness + 1j * (moving * loss + omegas * damping) + self.added(lines.omegas)
        impedance = impedance - omegas**2 * np.eye(6)
        lost = moving[:, None] * self.slopes["loss"] + omegas[:, None] * self.slopes["damping"]
        slopes = self.slopes["stiffness"] + 1j * lost
        inverse = inverses(np.asarray(impedance, dtype=np.complex128))
        motion = np.einsum("bkij,kj->bki", inverse, lines.loads)
        return series(centres, halves, inverse, slopes[None], motion)

    def answer(self, lines: Lines, at: Expansion, channel: Channel, rows: Indices, factors: Array) -> Answer:
        """Forces or travel, the rows of the mounts that count, with factors on them (E37)."""
        value, slopes = self.maps(lines, at, channel, rows)
        return mapped(at, value * factors[:, None], slopes * factors[:, None])

    def maps(self, lines: Lines, at: Expansion, channel: Channel, rows: Indices) -> tuple[ComplexArray, ComplexArray]:
        """From motion to forces or travel at the centres, (boxes, lines, r, 6), and by side, (..., n, r, 6)."""
        boxes, count, open_numbers = len(at.centres), len(lines.omegas), len(self.lower)
        if is_travel(channel):
            flat = np.broadcast_to(self.travels[rows].astype(complex), (boxes, count, len(rows), 6))
            return flat, np.zeros((boxes, count, open_numbers, len(rows), 6), dtype=complex)
        moving, omegas = (lines.omegas > 0.0)[:, None, None], lines.omegas[:, None, None]
        springs, losses, dampers = (
            self.at(name, at.centres)[:, None, rows] for name in ("springs", "losses", "dampers")
        )
        value = springs + 1j * (moving * losses + omegas * dampers) + self.added_forces(lines.omegas)[:, rows]
        lost = moving[:, None] * self.slopes["losses"][:, rows] + omegas[:, None] * self.slopes["dampers"][:, rows]
        by_side = self.slopes["springs"][:, rows] + 1j * lost
        return value, by_side * at.halves[:, None, :, None, None]

    def felt_at_most(self, lines: Lines, channel: Channel) -> Array:
        """What an order above all natural frequencies can do to all mounts anywhere in the bounds, (lines,) (E41)."""
        room = lines.omegas**2 - self.highest - self.rise(lines.omegas)
        motion = np.linalg.norm(lines.loads, axis=1) / np.where(room > 0.0, room, 1.0)
        motion = np.where(room > 0.0, motion, np.inf)
        if is_travel(channel):
            return motion * float(np.linalg.norm(self.travels))
        stiffest = self.mounting(self.upper)
        # of springs that are joined, each by itself: their sum may be less
        apart = replace(stiffest, mounts=tuple(spring for _, spring in every_spring(stiffest.mounts)))
        most, top = max(len(mount.springs) for mount in stiffest.mounts), self._parts(apart)
        still = math.sqrt(most) * float(np.linalg.norm(top.springs + 1j * top.losses))
        still = still + np.linalg.norm(self.added_forces(lines.omegas), axis=(1, 2))
        return np.asarray(motion * (still + lines.omegas * math.sqrt(most) * float(np.linalg.norm(top.dampers))))


def series(centres: Array, halves: Array, inverse: Any, slopes: Any, motion: Any) -> Expansion:
    """Motion over boxes from that at their centres, D(c)^-1 and the slopes of D, (boxes, lines, ...) each (E37)."""
    pulled = np.matmul(inverse[:, :, None], slopes) * halves[:, None, :, None, None]
    first = np.matmul(pulled, motion[:, :, None, :, None])[..., 0]
    second = _each_by_each(first, pulled)
    pull = np.linalg.norm(pulled, axis=(-2, -1))
    size = np.linalg.norm(_both_ways(second), axis=-1).sum(axis=(-2, -1))
    rho = pull.sum(axis=-1)
    share = np.where(rho < 1.0, rho / np.where(rho < 1.0, 1.0 - rho, 1.0), np.inf)
    rest = np.where(size > 0.0, share * np.where(size > 0.0, size, 1.0), np.where(rho < 1.0, 0.0, np.inf))
    return Expansion(centres, halves, motion, first, second, size, rest, pull)


def mapped(at: Expansion, value: Any, slopes: Any) -> Answer:
    """What maps at the centres, (boxes, lines, r, 6), and by side, (..., n, r, 6), make of motion (E37)."""
    first = np.matmul(slopes, at.motion[:, :, None, :, None])[..., 0] - np.matmul(at.first, np.swapaxes(value, -2, -1))
    second = np.matmul(at.second, np.swapaxes(value, -2, -1)[:, :, None]) - _each_by_each(at.first, slopes)
    rest = np.linalg.norm(_both_ways(second), axis=-1).sum(axis=(-2, -1))
    turned = np.linalg.norm(slopes, axis=(-2, -1)).sum(axis=-1)
    rest = rest + np.linalg.norm(value, axis=(-2, -1)) * at.rest + turned * at.size
    rest = rest + np.where(turned > 0.0, turned * np.where(turned > 0.0, at.rest, 0.0), 0.0)
    return Answer(np.einsum("bkri,bki->bkr", value, at.motion), first, rest)


def _each_by_each(first: ComplexArray, maps: ComplexArray) -> ComplexArray:
    """What the map of every side, (..., m, r, i), makes of every motion, (..., n, i), shape (..., m, n, r)."""
    return np.asarray(np.matmul(first[:, :, None], np.swapaxes(maps, -2, -1)))


def _both_ways(second: ComplexArray) -> ComplexArray:
    """The mean of (i, j) and (j, i): their sum is all that matters."""
    return np.asarray(0.5 * (second + np.swapaxes(second, 2, 3)))


def inverses(matrices: ComplexArray) -> ComplexArray:
    """Inverses; infinite where there is none, which leaves a box without a bound."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        found = np.linalg.inv(np.where(singular[..., None, None], np.eye(matrices.shape[-1]), matrices))
        return np.asarray(np.where(singular[..., None, None], np.inf, found))
