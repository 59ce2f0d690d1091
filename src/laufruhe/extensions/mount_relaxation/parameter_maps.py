"""Numbers s that open springs, dampers and places of mounts follow (E42, E52, E63, E66).

A mount that turns in a plane has the stiffnesses k1 and k2, b the angle of its first axis from the first of axes that
do not turn. With p = (k1 + k2) / 2 and d = (k1 - k2) / 2 its matrix is

    K11 = p + d cos 2b,    K22 = p - d cos 2b,    K12 = d sin 2b.                            (E63)

All three are linear in spring forces, so that boxes of them are divided, in place of stiffnesses and angle.

Dampers of a mount are given along its own axes, so that they turn with it. Where its stiffness is given too, and
c_i = a + b k_i along all axes that turn, they are in every design

    C = a I + b K                                                                           (E66)

along these, and turning changes them by b times the change of stiffness: no number and no product more.
Otherwise C is a matrix of its own between its least and its largest, with numbers and products of its own, as K is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import number_ranges

# angle by which a mount is turned to see which of its axes stay [rad]
ASIDE = 0.3
STAYS = 1e-9
# shares of the largest stiffness: least difference along which dampers are fitted, largest width that counts as none
STEEP, TINY = 1e-3, 1e-6
# share of the largest stiffness that roundings may take
ROUNDING = 1e-9
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class SpringTerm:
    """The open part of a spring or damper along some axes, its middle left out: the sum of s_j times a matrix.

    Attributes
    ----------
    mount
        Number of the spring among those of all mounts.
    axes
        Unit vectors, shape (3, b).
    terms
        Number j and matrix, shape (b, b) [N/m].
    sides
        Matrices C and signs: C + sign times the sum is positive semidefinite.
    spans
        Matrices C and D: (C + the sum)(D - the sum) is positive semidefinite.
    size
        Of the sum [N/m, or N s/m].
    elastic, viscous
        Factors of the sum in stiffness and damping: 1 and b of a spring, 0 and 1 of a damper (E66).
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
        """Return the matrices by s, shape (numbers, b, b)."""
        out = np.zeros((numbers, *self.terms[0][1].shape))
        for j, matrix in self.terms:
            out[j] += matrix
        return out

    def force_scaled(self, products: ComplexArray, omega: float) -> ComplexArray:
        """Return products in the size of their forces."""
        return np.asarray(math.hypot(self.elastic, omega * self.viscous) * products, dtype=np.complex128)

    @property
    def largest(self) -> float:
        """Return an upper bound of the norm of the sum."""
        return float(sum(np.linalg.norm(matrix, 2) for _, matrix in self.terms))


@dataclass(frozen=True, eq=False)
class PlaceTerm:
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
        """Return the count of complex products: turns, moments of springs without loss, and those of dampers over W."""
        return (3 if self.is_damped else 2) * len(self.aside)

    def force_scaled(self, products: ComplexArray, omega: float) -> ComplexArray:
        """Return the moments alone, those of dampers in the size of their forces."""
        count = len(self.aside)
        return np.concatenate([products[count : 2 * count], omega * products[2 * count :]])

    @property
    def arms(self) -> Array:
        """Return the motion of a mount per turn about each axis, and the moment per force, shape (n, 3)."""
        return np.cross(self.aside, self.axis)


@dataclass(frozen=True, eq=False)
class PlaneFrames:
    """Axes in which planes are stated, and boxes in them (E63).

    Attributes
    ----------
    frames
        Numbers of every spring whose angles these have, shape (springs, 14).
    boxes
        K11, K22 and K12 by the key of a plane, shape (3, 2) each; None where all is open.
    """

    frames: Array
    boxes: Mapping[Any, Array] | None = None


class _SharedNumbers:
    """Numbers s by keys, so that mirrored mounts share theirs."""

    def __init__(self) -> None:
        self._known: dict[Any, tuple[int, tuple[int, ...]]] = {}

    def index(self, key: Any, decisions: Sequence[int]) -> int:
        return self._known.setdefault(key, (len(self._known), tuple(sorted(set(decisions)))))[0]

    @property
    def decisions(self) -> tuple[tuple[int, ...], ...]:
        return tuple(decisions for _, decisions in self._known.values())


class ParameterMaps:
    """Maps from s to stiffness, damping and places, one mount after the other."""

    def __init__(self, problem: Problem, lower: Array, upper: Array, framed: PlaneFrames | None = None) -> None:
        self.low, self.high = number_ranges(problem, lower, upper)
        self.start = np.array(problem.mount_numbers, dtype=float)
        self._frames = 0.5 * (self.low + self.high) if framed is None else framed.frames
        self._boxes = None if framed is None else framed.boxes
        self.planes: dict[Any, tuple[int, PlaneStiffness]] = {}
        self._bounds: dict[tuple[int, int], tuple[Array, Array]] = {}
        self.half = 0.5 * (upper - lower)
        self.numbers = _SharedNumbers()
        self.drives: list[dict[int, list[tuple[int, float]]]] = [{} for _ in self.low]
        for j, decision in enumerate(problem.mount_decisions):
            for drive in decision.mount_drives:
                self.drives[drive.mount].setdefault(drive.number, []).append((j, drive.gain))

    def middle(self, m: int) -> Array:
        """Return the middles of all numbers of a spring."""
        return np.asarray(0.5 * (self.low[m] + self.high[m]))

    def reach(self, m: int) -> Array:
        """Return half the ranges of all numbers of a spring."""
        return np.asarray(0.5 * (self.high[m] - self.low[m]))

    def springs(self, m: int) -> tuple[Array, Array, list[SpringTerm]]:
        """Return stiffness and damping at the middle, shape (3, 3), and the open terms of both (E66)."""
        axes, turning = self._turning(m)
        stay = [i for i in range(3) if i not in turning]
        stiffness, springs = self._along(m, axes, stay)
        damping = np.asarray(axes[stay].T @ np.diag(self.low[m, DAMPING][stay]) @ axes[stay])
        if not turning:
            return stiffness, damping, springs
        added, terms = self._turned(m, axes, turning, STIFFNESS)
        line, dampers = self._damping_line(m, turning), self.low[m, DAMPING][turning]
        if line is None:
            lost, viscous = self._turned(m, axes, turning, DAMPING)
            terms += [replace(each, elastic=0.0, viscous=1.0) for each in viscous]
        else:
            plane = axes[turning].T @ axes[turning]
            lost = line[0] * plane + line[1] * added
            terms = [replace(each, viscous=line[1]) for each in terms]
            self._bounds[m, DAMPING.start] = damping + dampers.min() * plane, damping + dampers.max() * plane
        return stiffness + added, damping + lost, [*springs, *terms]

    def _turning(self, m: int) -> tuple[Array, list[int]]:
        """Return own axes, and which of them turn."""
        middle, turned = self.middle(m), self.reach(m)[TURNED] > 0.0
        if np.count_nonzero(turned) == 1:
            middle[TURNED] = self._frames[m, TURNED]
        axes = mount_axes(middle[TURNED])
        if not turned.any():
            return axes, []
        other = mount_axes(middle[TURNED] + ASIDE * turned)
        stay = [i for i in range(3) if np.abs(other[i] - axes[i]).max() < STAYS]
        if np.count_nonzero(turned) > 1 or len(stay) != 1:
            return np.eye(3), [0, 1, 2]
        return axes, [i for i in range(3) if i not in stay]

    def _damping_line(self, m: int, turning: Sequence[int]) -> tuple[float, float] | None:
        """Return a and b of E66; None where dampers do not follow stiffness."""
        dampers = self.low[m, DAMPING][turning]
        if np.ptp(dampers) == 0.0:
            return float(dampers[0]), 0.0
        low, high = (each[m, STIFFNESS][turning] for each in (self.low, self.high))
        if np.any(low < high) or np.ptp(low) <= STEEP * low.max():
            return None
        ends = [int(np.argmin(low)), int(np.argmax(low))]
        slope = float(np.diff(dampers[ends])[0] / np.diff(low[ends])[0])
        shift = float(dampers[ends[0]] - slope * low[ends[0]])
        misfit = float(np.abs(dampers - shift - slope * low).max())
        return (shift, slope) if misfit <= STAYS * STAYS * float(dampers.max()) else None

    def _turned(self, m: int, axes: Array, turning: list[int], kind: slice) -> tuple[Array, list[SpringTerm]]:
        low, high = (each[m, kind][turning] for each in (self.low, self.high))
        if float(low.min()) == float(high.max()):
            return np.asarray(low[0] * axes[turning].T @ axes[turning]), []
        return self._in_plane(m, axes, turning, kind) if len(turning) == 2 else self._in_space(m, kind)

    def _along(self, m: int, axes: Array, chosen: Sequence[int]) -> tuple[Array, list[SpringTerm]]:
        # stiffness along axes that stay
        middle, reach, springs, total = self.middle(m), self.reach(m), [], np.zeros((3, 3))
        for i in chosen:
            total += middle[i] * np.outer(axes[i], axes[i])
            if reach[i] > 0.0:
                parts = [(j, gain * self.half[j]) for j, gain in self.drives[m][i]]
                terms = tuple((self.numbers.index(("one", j), [j]), np.array([[h]])) for j, h in parts)
                side = np.array([[reach[i]]])
                sides = (side, 1.0), (side, -1.0)
                springs.append(SpringTerm(m, axes[i][:, None], terms, sides, ((side, side),), float(reach[i])))
        return total, springs

    def _in_plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Array, list[SpringTerm]]:
        """Return stiffness along two axes that turn about the third, in axes that do not turn (E52, E63)."""
        key, plane, sign = self._plane(m, axes, pair, kind)
        box = plane.full_box if self._boxes is None else self._boxes[key]
        first = 3 * self.planes.setdefault(key, (len(self.planes), plane))[0]
        (c1, c2, c3), halves = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
        one, two, both = np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), sign * (np.ones((2, 2)) - np.eye(2))
        terms = tuple(
            (self.numbers.index((k, key), [len(self.half) + first + k]), halves[k] * matrix)
            for k, matrix in enumerate((one, two, both))
        )
        centre = c1 * one + c2 * two + c3 * both
        low, high = plane.stiffness_range(box)
        # of a box |K12| <= h3 is under any diag(h3 w, h3 / w)
        w = math.sqrt((halves[0] + TINY * high) / (halves[1] + TINY * high))
        near, size = np.diag([halves[0] + w * halves[2], halves[1] + halves[2] / w]), float(halves.max()) or 1.0
        maximum = float(np.linalg.norm(np.array([[halves[0], halves[2]], [halves[2], halves[1]]]), 2))
        sides = [(centre - low * np.eye(2), 1.0), (high * np.eye(2) - centre, -1.0)]
        spans = [(sides[0][0], sides[1][0])]
        if self._boxes is not None:
            sides += [(near, 1.0), (near, -1.0)]
            spans += [(maximum * np.eye(2), maximum * np.eye(2))]
        spring = SpringTerm(m, axes[pair].T, terms, tuple(sides), tuple(spans), size)
        top = min(high * np.eye(2), centre + near, key=lambda each: float(np.trace(each)))
        rest = np.delete(axes, pair, axis=0)
        aside = [
            float(each[m, kind][np.setdiff1d(range(3), pair)[0]]) * rest.T @ rest for each in (self.low, self.high)
        ]
        self._bounds[m, kind.start] = (
            axes[pair].T @ (low * np.eye(2)) @ axes[pair] + aside[0], axes[pair].T @ top @ axes[pair] + aside[1]
        )  # fmt: skip
        return np.asarray(axes[pair].T @ centre @ axes[pair]), [spring]

    def _plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Any, PlaneStiffness, float]:
        """Return the key of a plane, its stiffness, and the sign of K12 in these axes."""
        number = kind.start + np.array(pair)
        turns = [(k, j, gain) for k in range(TURNED.start, TURNED.stop) for j, gain in self.drives[m].get(k, [])]
        axis, _, gain = turns[0]
        # a plane that several numbers turn is shared with no other mount
        turned = tuple((k, j, abs(gain)) for k, j, gain in turns) if len(turns) == 1 else (m, *turns)
        drives = [drive for k in number for drive in self.drives[m].get(int(k), [])]
        side = math.copysign(1.0, gain)
        angles = sorted(side * (float(each[m, axis]) - float(self._frames[m, axis])) for each in (self.low, self.high))
        ahead = self._frames[m, TURNED].copy()
        ahead[axis - TURNED.start] += side * ASIDE
        sign = math.copysign(1.0, float(mount_axes(ahead)[pair[0]] @ axes[pair[1]]))
        start = (*self.start[m, number], side * (self.start[m, axis] - self._frames[m, axis]))
        key = (kind.start, tuple(drives), turned, tuple(round(float(each), 9) for each in start))
        near = self._frames[m, number]
        return key, PlaneStiffness(self.low[m, number], self.high[m, number], (angles[0], angles[1]), near), sign

    def _in_space(self, m: int, kind: slice) -> tuple[Array, list[SpringTerm]]:
        # matrix of six numbers between the least and the largest of its own
        low, high = float(self.low[m, kind].min()), float(self.high[m, kind].max())
        half, decisions = 0.5 * (high - low), sorted({j for drives in self.drives[m].values() for j, _ in drives})
        terms = []
        for a, b in combinations_with_replacement(range(3), 2):
            matrix = np.zeros((3, 3))
            matrix[a, b] = matrix[b, a] = half
            terms.append((self.numbers.index(("space", kind.start, m, a, b), decisions), matrix))
        side = half * np.eye(3)
        middle = 0.5 * (low + high) * np.eye(3)
        return middle, [SpringTerm(m, np.eye(3), tuple(terms), ((side, 1.0), (side, -1.0)), ((side, side),), half)]

    def bounds(self, m: int, kind: slice) -> tuple[Array, Array]:
        """Return lower and upper bounds of stiffness or damping, shape (3, 3) each; call `springs` first."""
        if (m, kind.start) in self._bounds:
            return self._bounds[m, kind.start]
        low, high = self.low[m, kind], self.high[m, kind]
        if np.any(self.reach(m)[TURNED] > 0.0):
            return float(low.min()) * np.eye(3), float(high.max()) * np.eye(3)
        axes = mount_axes(self._frames[m, TURNED])
        return np.asarray(axes.T @ np.diag(low) @ axes), np.asarray(axes.T @ np.diag(high) @ axes)

    def places(self) -> tuple[PlaceTerm, ...]:
        """Return the places that move, by decision, axis and loss."""
        groups: dict[tuple[int, int, float, float], list[tuple[int, float]]] = {}
        for m, drives in enumerate(self.drives):
            for k in range(POSITION.start, POSITION.stop):
                for j, gain in drives.get(k, []):
                    if self.half[j] > 0.0:
                        key = j, k - POSITION.start, float(self.low[m, LOSS]), float(self.low[m, LAG])
                        groups.setdefault(key, []).append((m, gain * self.half[j]))
        places = []
        for (j, axis, *_), mounts in groups.items():
            is_damped = any(bool(np.any(self.low[m, DAMPING])) for m, _ in mounts)
            number, across = self.numbers.index(("one", j), [j]), np.delete(np.eye(3), axis, axis=0)
            places.append(PlaceTerm(number, np.eye(3)[axis], tuple(mounts), across, is_damped))
        return tuple(places)


def mount_axes(angles: Array) -> Array:
    """Return the own axes of a mount as rows, shape (3, 3) (E2)."""
    return np.array(turned_axes(NUMBERS, angles.tolist()))


@dataclass(frozen=True, eq=False)
class PlaneStiffness:
    """Stiffness of a mount that turns in a plane (E63).

    Attributes
    ----------
    low, high
        Of k1 and k2 [N/m].
    angles
        Least and largest b [rad].
    near
        k1 and k2 of the design whose own axes these are [N/m].
    """

    low: Array
    high: Array
    angles: tuple[float, float]
    near: Array

    @property
    def full_box(self) -> Array:
        """Return least and largest K11, K22 and K12, shape (3, 2)."""
        (low1, low2), (high1, high2) = self.low, self.high
        doubled = 2.0 * self.angles[0], 2.0 * self.angles[1]
        cosines = _sine_range(doubled[0] + 0.5 * math.pi, doubled[1] + 0.5 * math.pi)
        shares = [0.5 * (1.0 + cosine) for cosine in cosines]
        first = [(low1 * c + low2 * (1.0 - c), high1 * c + high2 * (1.0 - c)) for c in shares]
        second = [(low2 * c + low1 * (1.0 - c), high2 * c + high1 * (1.0 - c)) for c in shares]
        across = [d * s for d in (0.5 * (low1 - high2), 0.5 * (high1 - low2)) for s in _sine_range(*doubled)]
        ends = [(min(a for a, _ in own), max(b for _, b in own)) for own in (first, second)]
        return np.array([*ends, (min(across), max(across))])

    def stiffness_range(self, box: Array) -> tuple[float, float]:
        """Return the least and the largest of both k1 and k2 on a box."""
        (low1, low2), (high1, high2) = self.low, self.high
        near, _, steep = self._polar(box)
        # the sign of k1 - k2, where it is the same all over the box
        if steep < math.inf and near[0] > 0.0:
            return low2, high1
        if steep < math.inf and near[1] < 0.0:
            return low1, high2
        return min(low1, low2), max(high1, high2)

    def _polar(self, box: Array) -> tuple[tuple[float, float], tuple[float, float], float]:
        half, middle = self.angles[1] - self.angles[0], self.angles[0] + self.angles[1]
        along = 0.5 * (box[0] - box[1][::-1])
        cosine, sine = math.cos(middle), math.sin(middle)
        near = np.sort(np.outer([cosine, 0.0], along)[0]) + np.sort(sine * box[2])
        aside = np.sort(-sine * along) + np.sort(cosine * box[2])
        steep = math.tan(half) if half < 0.5 * math.pi - 1e-6 else math.inf
        return (float(near[0]), float(near[1])), (float(aside[0]), float(aside[1])), steep

    def contracted(self, box: Array) -> Array | None:
        """Return the part of a box that holds all possible matrices in it; None where it holds none."""
        part, rounding = box.copy(), ROUNDING * float(self.high.max())
        for _ in range(ROUNDS):
            near, aside, steep = self._polar(part)
            minimum = max(aside[0], -aside[1], 0.0)
            if minimum - rounding > steep * max(-near[0], near[1], 0.0):
                return None
            low, high = self.stiffness_range(part)
            part = _contract_by_trace(part, float(self.low.sum()) - rounding, float(self.high.sum()) + rounding)
            part = _contract_by_eigenvalues(part, low - rounding, high + rounding)
            if np.any(part[:, 0] > part[:, 1] + rounding):
                return None
            part = np.sort(part, axis=1)
        return part


def _contract_by_trace(box: Array, low: float, high: float) -> Array:
    part = box.copy()
    for k, other in ((0, 1), (1, 0)):
        part[k] = max(box[k, 0], low - box[other, 1]), min(box[k, 1], high - box[other, 0])
    return part


def _contract_by_eigenvalues(box: Array, low: float, high: float) -> Array:
    """Contract a box to K - low and high - K positive semidefinite."""
    part = box.copy()
    across = max(box[2, 0], -box[2, 1], 0.0)
    over, under = box[:2, 1] - low, high - box[:2, 0]
    if min(over.min(), under.min()) < 0.0:
        part[0] = 1.0, -1.0
        return np.asarray(part * high)
    for k, other in ((0, 1), (1, 0)):
        minimum = low + (across**2 / over[other] if over[other] > 0.0 else 0.0)
        maximum = high - (across**2 / under[other] if under[other] > 0.0 else 0.0)
        part[k] = max(box[k, 0], minimum), min(box[k, 1], maximum)
    reach = math.sqrt(min(over[0] * over[1], under[0] * under[1]))
    part[2] = max(box[2, 0], -reach), min(box[2, 1], reach)
    return part


def _sine_range(low: float, high: float) -> tuple[float, float]:
    turn, ends = 2.0 * math.pi, (math.sin(low), math.sin(high))
    top = math.ceil((low - 0.5 * math.pi) / turn) * turn + 0.5 * math.pi <= high
    bottom = math.ceil((low + 0.5 * math.pi) / turn) * turn - 0.5 * math.pi <= high
    return (-1.0 if bottom else min(ends), 1.0 if top else max(ends))
