"""Numbers that open springs, dampers and places of mounts follow (E42, E52, E63, E66).

Dampers of a mount are given along its own axes, so that they turn with it. Where its stiffness is given too, and
c_i = a + b k_i along all axes that turn, they are in every design

    C = a I + b K                                                                           (E66)

along these, and what turning changes of them is b times what it changes of stiffness: no number and no product more.
Otherwise C is a matrix of its own between its least and its largest, with numbers and products of its own, as K is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from laufruhe.extensions.mount_relaxation.planes import Plane
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import number_ranges

# angle by which a mount is turned to see which of its axes stay [rad]
ASIDE = 0.3
STAYS = 1e-9
# of the largest stiffness, differences that dampers are told by
STEEP = 1e-3
# of the largest stiffness, widths that count as none
TINY = 1e-6


@dataclass(frozen=True, eq=False)
class Spring:
    """What is open of a spring or of a damper along some axes, its middle left out: the sum of s_j times a matrix.

    Attributes
    ----------
    mount
        Number of the spring among those of all mounts.
    axes
        Unit vectors, shape (3, b).
    terms
        Number j and matrix, shape (b, b) [N/m].
    sides
        Matrices C and signs: C + sign times the sum is nowhere indefinite.
    spans
        Matrices C and D: (C + the sum)(D - the sum) is nowhere indefinite.
    size
        Of the sum [N/m, or N s/m].
    elastic, viscous
        What stiffness and damping have of the sum: 1 and b of a spring, 0 and 1 of a damper (E66).
    """

    mount: int
    axes: Array
    terms: tuple[tuple[int, Array], ...]
    sides: tuple[tuple[Array, float], ...]
    spans: tuple[tuple[Array, Array], ...]
    size: float
    elastic: float = 1.0
    viscous: float = 0.0

    def slopes(self, numbers: int) -> Array:
        """By s, shape (numbers, b, b)."""
        out = np.zeros((numbers, *self.terms[0][1].shape))
        for j, matrix in self.terms:
            out[j] += matrix
        return out

    def in_forces(self, products: ComplexArray, omega: float) -> ComplexArray:
        """As large as the forces that they are of."""
        return np.asarray(math.hypot(self.elastic, omega * self.viscous) * products, dtype=np.complex128)

    @property
    def most(self) -> float:
        """The norm of the sum is never over it."""
        return float(sum(np.linalg.norm(matrix, 2) for _, matrix in self.terms))


@dataclass(frozen=True, eq=False)
class Place:
    """A place along an axis that moves, by s_j times the reach of each mount.

    Attributes
    ----------
    number
        j.
    axis
        Unit vector of C2.
    mounts
        Number and reach [m] of each spring that moves, all of one loss.
    aside
        Unit vectors across it about which turns count, shape (n, 3).
    is_damped
        Whether any of these has a damper.
    """

    number: int
    axis: Array
    mounts: tuple[tuple[int, float], ...]
    aside: Array
    is_damped: bool

    @property
    def products(self) -> int:
        """Complex numbers that s multiplies: turns, moments of springs without loss, and those of dampers over W."""
        return (3 if self.is_damped else 2) * len(self.aside)

    def in_forces(self, products: ComplexArray, omega: float) -> ComplexArray:
        """Moments alone, those of dampers as large as their forces make them."""
        count = len(self.aside)
        return np.concatenate([products[count : 2 * count], omega * products[2 * count :]])

    @property
    def arms(self) -> Array:
        """What a turn about each of these moves a mount by, and takes of its force as moment, shape (n, 3)."""
        return np.cross(self.aside, self.axis)


@dataclass(frozen=True, eq=False)
class Framed:
    """Axes in which planes are told, and boxes in them (E63).

    Attributes
    ----------
    frames
        Numbers of every spring whose angles these have, shape (springs, 14).
    boxes
        K11, K22 and K12 by what a plane follows, shape (3, 2) each; none where all is open.
    """

    frames: Array
    boxes: Mapping[Any, Array] | None = None


class _Numbers:
    """Numbers by what they follow, so that mirrored mounts share theirs."""

    def __init__(self) -> None:
        self._known: dict[Any, tuple[int, tuple[int, ...]]] = {}

    def of(self, key: Any, decisions: Sequence[int]) -> int:
        return self._known.setdefault(key, (len(self._known), tuple(sorted(set(decisions)))))[0]

    @property
    def keys(self) -> tuple[tuple[int, ...], ...]:
        return tuple(decisions for _, decisions in self._known.values())


class Opened:
    """One mount after the other."""

    def __init__(self, problem: Problem, lower: Array, upper: Array, framed: Framed | None = None) -> None:
        self.low, self.high = number_ranges(problem, lower, upper)
        self.start = np.array(problem.mount_numbers, dtype=float)
        self._frames = 0.5 * (self.low + self.high) if framed is None else framed.frames
        self._boxes = None if framed is None else framed.boxes
        self.planes: dict[Any, tuple[int, Plane]] = {}
        self._ends: dict[tuple[int, int], tuple[Array, Array]] = {}
        self.half = 0.5 * (upper - lower)
        self.numbers = _Numbers()
        self.drives: list[dict[int, list[tuple[int, float]]]] = [{} for _ in self.low]
        for j, decision in enumerate(problem.mount_decisions):
            for drive in decision.mount_drives:
                self.drives[drive.mount].setdefault(drive.number, []).append((j, drive.gain))

    def middle(self, m: int) -> Array:
        """Of all numbers of a spring."""
        return np.asarray(0.5 * (self.low[m] + self.high[m]))

    def reach(self, m: int) -> Array:
        """Half of what they may differ by."""
        return np.asarray(0.5 * (self.high[m] - self.low[m]))

    def springs(self, m: int) -> tuple[Array, Array, list[Spring]]:
        """Stiffness and damping at the middle, shape (3, 3), and what is open of both (E66)."""
        axes, turn = self._turning(m)
        stay = [i for i in range(3) if i not in turn]
        (stiffness, springs), damping = self._along(m, axes, stay), self._held(m, axes, stay)
        if not turn:
            return stiffness, damping, springs
        added, turned = self._turned(m, axes, turn, STIFFNESS)
        line, own = self._line(m, turn), self.low[m, DAMPING][turn]
        if line is None:
            lost, dampers = self._turned(m, axes, turn, DAMPING)
            turned += [replace(each, elastic=0.0, viscous=1.0) for each in dampers]
        else:
            plane = axes[turn].T @ axes[turn]
            lost = line[0] * plane + line[1] * added
            turned = [replace(each, viscous=line[1]) for each in turned]
            self._ends[m, DAMPING.start] = damping + own.min() * plane, damping + own.max() * plane
        return stiffness + added, damping + lost, [*springs, *turned]

    def _turning(self, m: int) -> tuple[Array, list[int]]:
        """Own axes, and which of them turn."""
        middle, turned = self.middle(m), self.reach(m)[TURNED] > 0.0
        if np.count_nonzero(turned) == 1:
            middle[TURNED] = self._frames[m, TURNED]
        axes = own_axes(middle[TURNED])
        if not turned.any():
            return axes, []
        other = own_axes(middle[TURNED] + ASIDE * turned)
        stay = [i for i in range(3) if np.abs(other[i] - axes[i]).max() < STAYS]
        if np.count_nonzero(turned) > 1 or len(stay) != 1:
            return np.eye(3), [0, 1, 2]
        return axes, [i for i in range(3) if i not in stay]

    def _held(self, m: int, axes: Array, stay: Sequence[int]) -> Array:
        """Dampers along axes that stay."""
        return np.asarray(axes[stay].T @ np.diag(self.low[m, DAMPING][stay]) @ axes[stay])

    def _line(self, m: int, turn: Sequence[int]) -> tuple[float, float] | None:
        """a and b of E66; None where dampers do not follow stiffness."""
        given = self.low[m, DAMPING][turn]
        if np.ptp(given) == 0.0:
            return float(given[0]), 0.0
        low, high = (each[m, STIFFNESS][turn] for each in (self.low, self.high))
        if np.any(low < high) or np.ptp(low) <= STEEP * low.max():
            return None
        ends = [int(np.argmin(low)), int(np.argmax(low))]
        slope = float(np.diff(given[ends])[0] / np.diff(low[ends])[0])
        shift = float(given[ends[0]] - slope * low[ends[0]])
        apart = float(np.abs(given - shift - slope * low).max())
        return (shift, slope) if apart <= STAYS * STAYS * float(given.max()) else None

    def _turned(self, m: int, axes: Array, turn: list[int], kind: slice) -> tuple[Array, list[Spring]]:
        """Stiffness or damping along axes that turn; nothing is open of what is the same along all of them."""
        low, high = (each[m, kind][turn] for each in (self.low, self.high))
        if float(low.min()) == float(high.max()):
            return np.asarray(low[0] * axes[turn].T @ axes[turn]), []
        return self._in_plane(m, axes, turn, kind) if len(turn) == 2 else self._in_space(m, kind)

    def _along(self, m: int, axes: Array, chosen: Sequence[int]) -> tuple[Array, list[Spring]]:
        """Along axes that stay."""
        middle, reach, springs, total = self.middle(m), self.reach(m), [], np.zeros((3, 3))
        for i in chosen:
            total += middle[i] * np.outer(axes[i], axes[i])
            if reach[i] > 0.0:
                parts = [(j, gain * self.half[j]) for j, gain in self.drives[m][i]]
                terms = tuple((self.numbers.of(("one", j), [j]), np.array([[h]])) for j, h in parts)
                side = np.array([[reach[i]]])
                sides = (side, 1.0), (side, -1.0)
                springs.append(Spring(m, axes[i][:, None], terms, sides, ((side, side),), float(reach[i])))
        return total, springs

    def _in_plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Array, list[Spring]]:
        """Two axes that turn about the third, in axes that do not (E52, E63)."""
        key, plane, sign = self._plane(m, axes, pair, kind)
        box = plane.whole if self._boxes is None else self._boxes[key]
        first = 3 * self.planes.setdefault(key, (len(self.planes), plane))[0]
        (c1, c2, c3), halves = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
        one, two, both = np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), sign * (np.ones((2, 2)) - np.eye(2))
        terms = tuple(
            (self.numbers.of((k, key), [len(self.half) + first + k]), halves[k] * matrix)
            for k, matrix in enumerate((one, two, both))
        )
        centre = c1 * one + c2 * two + c3 * both
        low, high = plane.own(box)
        # of a box |K12| <= h3 is under any diag(h3 w, h3 / w)
        w = math.sqrt((halves[0] + TINY * high) / (halves[1] + TINY * high))
        near, size = np.diag([halves[0] + w * halves[2], halves[1] + halves[2] / w]), float(halves.max()) or 1.0
        most = float(np.linalg.norm(np.array([[halves[0], halves[2]], [halves[2], halves[1]]]), 2))
        sides = [(centre - low * np.eye(2), 1.0), (high * np.eye(2) - centre, -1.0)]
        spans = [(sides[0][0], sides[1][0])]
        if self._boxes is not None:
            sides += [(near, 1.0), (near, -1.0)]
            spans += [(most * np.eye(2), most * np.eye(2))]
        spring = Spring(m, axes[pair].T, terms, tuple(sides), tuple(spans), size)
        top = min(high * np.eye(2), centre + near, key=lambda each: float(np.trace(each)))
        rest = np.delete(axes, pair, axis=0)
        aside = {k: float(each[m, kind][np.setdiff1d(range(3), pair)[0]]) * rest.T @ rest
                 for k, each in enumerate((self.low, self.high))}  # fmt: skip
        self._ends[m, kind.start] = (
            axes[pair].T @ (low * np.eye(2)) @ axes[pair] + aside[0], axes[pair].T @ top @ axes[pair] + aside[1]
        )  # fmt: skip
        return np.asarray(axes[pair].T @ centre @ axes[pair]), [spring]

    def _plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Any, Plane, float]:
        """What is open of a plane, by what it follows, and the sign of K12 in these axes."""
        number = kind.start + np.array(pair)
        turns = [(k, j, gain) for k in range(TURNED.start, TURNED.stop) for j, gain in self.drives[m].get(k, [])]
        axis, _, gain = turns[0]
        # what several numbers turn is its own
        turned = tuple((k, j, abs(gain)) for k, j, gain in turns) if len(turns) == 1 else (m, *turns)
        drives = [drive for k in number for drive in self.drives[m].get(int(k), [])]
        side = math.copysign(1.0, gain)
        angles = sorted(side * (float(each[m, axis]) - float(self._frames[m, axis])) for each in (self.low, self.high))
        ahead = self._frames[m, TURNED].copy()
        ahead[axis - TURNED.start] += side * ASIDE
        sign = math.copysign(1.0, float(own_axes(ahead)[pair[0]] @ axes[pair[1]]))
        given = (*self.start[m, number], side * (self.start[m, axis] - self._frames[m, axis]))
        key = (kind.start, tuple(drives), turned, tuple(round(float(each), 9) for each in given))
        near = self._frames[m, number]
        return key, Plane(self.low[m, number], self.high[m, number], (angles[0], angles[1]), near), sign

    def _in_space(self, m: int, kind: slice) -> tuple[Array, list[Spring]]:
        """A matrix between the least and the largest of its own."""
        low, high = float(self.low[m, kind].min()), float(self.high[m, kind].max())
        half, follows = 0.5 * (high - low), sorted({j for drives in self.drives[m].values() for j, _ in drives})
        terms = []
        for a, b in combinations_with_replacement(range(3), 2):
            matrix = np.zeros((3, 3))
            matrix[a, b] = matrix[b, a] = half
            terms.append((self.numbers.of(("space", kind.start, m, a, b), follows), matrix))
        side = half * np.eye(3)
        middle = 0.5 * (low + high) * np.eye(3)
        return middle, [Spring(m, np.eye(3), tuple(terms), ((side, 1.0), (side, -1.0)), ((side, side),), half)]

    def least_and_most(self, m: int, kind: slice) -> tuple[Array, Array]:
        """Matrices that stiffness or damping is not under and not over, shape (3, 3) each; after its springs."""
        if (m, kind.start) in self._ends:
            return self._ends[m, kind.start]
        low, high = self.low[m, kind], self.high[m, kind]
        if np.any(self.reach(m)[TURNED] > 0.0):
            return float(low.min()) * np.eye(3), float(high.max()) * np.eye(3)
        axes = own_axes(self._frames[m, TURNED])
        return np.asarray(axes.T @ np.diag(low) @ axes), np.asarray(axes.T @ np.diag(high) @ axes)

    def places(self) -> tuple[Place, ...]:
        """By decision, axis and loss."""
        found: dict[tuple[int, int, float, float], list[tuple[int, float]]] = {}
        for m, drives in enumerate(self.drives):
            for k in range(POSITION.start, POSITION.stop):
                for j, gain in drives.get(k, []):
                    if self.half[j] > 0.0:
                        key = j, k - POSITION.start, float(self.low[m, LOSS]), float(self.low[m, LAG])
                        found.setdefault(key, []).append((m, gain * self.half[j]))
        return tuple(
            Place(self.numbers.of(("one", j), [j]), *self._along_axis(axis, mounts))
            for (j, axis, *_), mounts in found.items()
        )

    def _along_axis(
        self, axis: int, mounts: Sequence[tuple[int, float]]
    ) -> tuple[Array, tuple[tuple[int, float], ...], Array, bool]:
        """The axis, mounts that move along it, the axes across it, and whether any of the mounts has a damper."""
        is_damped = any(bool(np.any(self.low[m, DAMPING])) for m, _ in mounts)
        return np.eye(3)[axis], tuple(mounts), np.delete(np.eye(3), axis, axis=0), is_damped


def own_axes(angles: Array) -> Array:
    """Own axes of a mount as rows, shape (3, 3) (E2)."""
    return np.array(turned_axes(NUMBERS, angles.tolist()))
