"""Maps from numbers s to springs, dampers and places of mounts (E42, E52, E63, E66).

The numbers s lie between -1 and 1 on a box; all orders share them.

A mount that turns in a plane has the stiffnesses k1 and k2; b is the angle of its first axis from the first of axes
that do not turn. With p = (k1 + k2) / 2 and d = (k1 - k2) / 2 its matrix is

    K11 = p + d cos 2b,    K22 = p - d cos 2b,    K12 = d sin 2b.                            (E63)

All three are linear in spring forces, so that boxes of them are divided, in place of stiffnesses and angle.

Dampers of a mount lie along its axes, so that they turn with it. If its stiffness is fixed, and c_i = a + b k_i along
all axes that turn, each design has

    C = a I + b K                                                                           (E66)

in these axes. Turning then changes C by b times the change of stiffness, without further numbers or products.
Otherwise C is a matrix between its smallest and its largest value, with numbers and products of its own, like K.
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

# test angle that shows which axes of a mount do not turn [rad], and the difference of axes that counts as none
TEST_ANGLE = 0.3
AXIS_TOL = 1e-9
# shares of the largest stiffness: smallest range over which dampers are fitted, largest range that counts as none
MIN_RANGE, ZERO_RANGE = 1e-3, 1e-6


@dataclass(frozen=True, eq=False)
class SpringTerm:
    """Open part of a spring or damper along some axes: sum of s_j times matrices, added to its value at the middle.

    Attributes
    ----------
    mount
        Number of the spring among those of all mounts.
    axes
        Unit vectors, shape (3, b).
    terms
        Pairs of a number j and its matrix, shape (b, b) [N/m or N s/m].
    sides
        Pairs of a matrix C and a sign: C + sign * sum is positive semidefinite.
    spans
        Pairs of matrices C and D: (C + sum)(D - sum) is positive semidefinite.
    size
        Size of the sum [N/m or N s/m].
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
        """Return the change of the spring's stiffness by each shared number s, shape (numbers, b, b)."""
        slopes = np.zeros((numbers, *self.terms[0][1].shape))
        for j, matrix in self.terms:
            slopes[j] += matrix
        return slopes

    def force_scaled(self, products: ComplexArray, omega: float) -> ComplexArray:
        """Return products, shape (b, d), scaled to the size of their forces."""
        return np.asarray(math.hypot(self.elastic, omega * self.viscous) * products, dtype=np.complex128)

    @property
    def largest(self) -> float:
        """Upper bound of the norm of the sum."""
        return float(sum(np.linalg.norm(matrix, 2) for _, matrix in self.terms))


@dataclass(frozen=True, eq=False)
class PlaceTerm:
    """Open position of mounts along an axis: they move by s_j times their reach.

    Attributes
    ----------
    number
        Index j of s.
    axis
        Unit vector in the axes of C2, shape (3,).
    mounts
        Number and reach [m] of each spring that moves; all have one loss factor.
    turn_axes
        Unit vectors across the axis about which turns move the mounts, shape (n, 3).
    is_damped
        True if any of these mounts has a damper.
    """

    number: int
    axis: Array
    mounts: tuple[tuple[int, float], ...]
    turn_axes: Array
    is_damped: bool

    @property
    def products(self) -> int:
        """Count of complex products: turns, moments of springs without loss, and moments of dampers over i W."""
        return (3 if self.is_damped else 2) * len(self.turn_axes)

    def force_scaled(self, products: ComplexArray, omega: float) -> ComplexArray:
        """Return the rows of moments among products, with moments of dampers scaled to the size of their forces."""
        count = len(self.turn_axes)
        return np.concatenate([products[count : 2 * count], omega * products[2 * count :]])

    @property
    def arms(self) -> Array:
        """Motion of a mount per turn about each axis, and moment per force, shape (n, 3)."""
        return np.cross(self.turn_axes, self.axis)


class ParameterMaps:
    """Maps from the shared numbers s to stiffness, damping and places of each mount.

    Parameters
    ----------
    lower, upper
        Bounds of the open numbers of mounts, shape (n,) each.
    frames
        Numbers of each spring that fix the axes in which its plane is stated (E63), shape (springs, 14); by default
        those of the middle.
    boxes
        Ranges of K11, K22 and K12 by the key of a plane, shape (3, 2) each; None for full ranges.
    """

    def __init__(
        self, problem: Problem, lower: Array, upper: Array, frames: Array | None = None,
        boxes: Mapping[Any, Array] | None = None,
    ) -> None:  # fmt: skip
        self.low, self.high = number_ranges(problem, lower, upper)
        self.start = np.array(problem.mount_numbers, dtype=float)
        self._frames, self._boxes = 0.5 * (self.low + self.high) if frames is None else frames, boxes
        self.planes: dict[Any, tuple[int, PlaneStiffness]] = {}
        self._bounds: dict[tuple[int, int], tuple[Array, Array]] = {}
        self.half = 0.5 * (upper - lower)
        # indices of s, and the decisions that each follows, by keys that mirrored mounts share
        self._numbers: dict[Any, tuple[int, tuple[int, ...]]] = {}
        self.drives: list[dict[int, list[tuple[int, float]]]] = [{} for _ in self.low]
        for j, decision in enumerate(problem.mount_decisions):
            for drive in decision.mount_drives:
                self.drives[drive.mount].setdefault(drive.number, []).append((j, drive.gain))

    def _number(self, key: Any, decisions: Sequence[int]) -> int:
        return self._numbers.setdefault(key, (len(self._numbers), tuple(decisions)))[0]

    @property
    def decisions(self) -> tuple[tuple[int, ...], ...]:
        """For each shared number s, the indices of the open numbers that it follows."""
        return tuple(decisions for _, decisions in self._numbers.values())

    def middle(self, m: int) -> Array:
        """Return the middles of the ranges of all numbers of spring `m`, shape (14,)."""
        return np.asarray(0.5 * (self.low[m] + self.high[m]))

    def reach(self, m: int) -> Array:
        """Return half the ranges of all numbers of spring `m`, shape (14,)."""
        return np.asarray(0.5 * (self.high[m] - self.low[m]))

    def springs(self, m: int) -> tuple[Array, Array, list[SpringTerm]]:
        """Return stiffness and damping of spring `m` at the box's middle, (3, 3) each, and their open terms (E66)."""
        axes, turning = self._turning(m)
        fixed_axes = [i for i in range(3) if i not in turning]
        stiffness, fixed_terms = self._along(m, axes, fixed_axes)
        damping = np.asarray(axes[fixed_axes].T @ np.diag(self.low[m, DAMPING][fixed_axes]) @ axes[fixed_axes])
        if not turning:
            return stiffness, damping, fixed_terms
        turned_stiffness, terms = self._turned(m, axes, turning, STIFFNESS)
        damping_line, dampers = self._damping_line(m, turning), self.low[m, DAMPING][turning]
        if damping_line is None:
            turned_damping, viscous = self._turned(m, axes, turning, DAMPING)
            terms += [replace(term, elastic=0.0, viscous=1.0) for term in viscous]
        else:
            plane = axes[turning].T @ axes[turning]
            turned_damping = damping_line[0] * plane + damping_line[1] * turned_stiffness
            terms = [replace(term, viscous=damping_line[1]) for term in terms]
            self._bounds[m, DAMPING.start] = damping + dampers.min() * plane, damping + dampers.max() * plane
        return stiffness + turned_stiffness, damping + turned_damping, [*fixed_terms, *terms]

    def _turning(self, m: int) -> tuple[Array, list[int]]:
        """Return the axes of spring `m`, shape (3, 3), and the indices of the axes that turn."""
        middle, is_turned = self.middle(m), self.reach(m)[TURNED] > 0.0
        if np.count_nonzero(is_turned) == 1:
            middle[TURNED] = self._frames[m, TURNED]
        axes = mount_axes(middle[TURNED])
        if not is_turned.any():
            return axes, []
        turned_test_axes = mount_axes(middle[TURNED] + TEST_ANGLE * is_turned)
        fixed_axes = [i for i in range(3) if np.abs(turned_test_axes[i] - axes[i]).max() < AXIS_TOL]
        if np.count_nonzero(is_turned) > 1 or len(fixed_axes) != 1:
            return np.eye(3), [0, 1, 2]
        return axes, [i for i in range(3) if i not in fixed_axes]

    def _damping_line(self, m: int, turning: Sequence[int]) -> tuple[float, float] | None:
        """Return a and b of damping = a + b stiffness for spring `m` (E66).

        The result is None if its damping does not follow stiffness.
        """
        dampers = self.low[m, DAMPING][turning]
        if np.ptp(dampers) == 0.0:
            return float(dampers[0]), 0.0
        low, high = (ranges[m, STIFFNESS][turning] for ranges in (self.low, self.high))
        if np.any(low < high) or np.ptp(low) <= MIN_RANGE * low.max():
            return None
        ends = [int(np.argmin(low)), int(np.argmax(low))]
        slope = float(np.diff(dampers[ends])[0] / np.diff(low[ends])[0])
        intercept = float(dampers[ends[0]] - slope * low[ends[0]])
        misfit = float(np.abs(dampers - intercept - slope * low).max())
        return (intercept, slope) if misfit <= AXIS_TOL * AXIS_TOL * float(dampers.max()) else None

    def _turned(self, m: int, axes: Array, turning: list[int], kind: slice) -> tuple[Array, list[SpringTerm]]:
        low, high = (ranges[m, kind][turning] for ranges in (self.low, self.high))
        if float(low.min()) == float(high.max()):
            return np.asarray(low[0] * axes[turning].T @ axes[turning]), []
        return self._in_plane(m, axes, turning, kind) if len(turning) == 2 else self._in_space(m, kind)

    def _along(self, m: int, axes: Array, chosen: Sequence[int]) -> tuple[Array, list[SpringTerm]]:
        # stiffness along axes that do not turn
        middle, reach, springs, total = self.middle(m), self.reach(m), [], np.zeros((3, 3))
        for i in chosen:
            total += middle[i] * np.outer(axes[i], axes[i])
            if reach[i] > 0.0:
                half_ranges = [(j, gain * self.half[j]) for j, gain in self.drives[m][i]]
                terms = tuple(
                    (self._number(("one", j), [j]), np.array([[half_range]])) for j, half_range in half_ranges
                )
                bound = np.array([[reach[i]]])
                sides = (bound, 1.0), (bound, -1.0)
                springs.append(SpringTerm(m, axes[i][:, None], terms, sides, ((bound, bound),), float(reach[i])))
        return total, springs

    def _in_plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Array, list[SpringTerm]]:
        """Return stiffness or damping in the plane in which a spring turns, and its open terms (E52, E63)."""
        key, plane, sign = self._plane(m, axes, pair, kind)
        box = plane.full_box if self._boxes is None else self._boxes[key]
        first_number = 3 * self.planes.setdefault(key, (len(self.planes), plane))[0]
        (centre1, centre2, centre3), halves = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
        first_entry, second_entry = np.diag([1.0, 0.0]), np.diag([0.0, 1.0])
        off_diagonal = sign * (np.ones((2, 2)) - np.eye(2))
        terms = tuple(
            (self._number((k, key), [len(self.half) + first_number + k]), halves[k] * matrix)
            for k, matrix in enumerate((first_entry, second_entry, off_diagonal))
        )
        centre = centre1 * first_entry + centre2 * second_entry + centre3 * off_diagonal
        low, high = float(plane.low.min()), float(plane.high.max())
        # on a box [[0, K12], [K12, 0]] with |K12| <= h3 lies below diag(h3 w, h3 / w) for any w
        ratio = math.sqrt((halves[0] + ZERO_RANGE * high) / (halves[1] + ZERO_RANGE * high))
        box_bound = np.diag([halves[0] + ratio * halves[2], halves[1] + halves[2] / ratio])
        size = float(halves.max()) or 1.0
        radius = float(np.linalg.norm(np.array([[halves[0], halves[2]], [halves[2], halves[1]]]), 2))
        sides = [(centre - low * np.eye(2), 1.0), (high * np.eye(2) - centre, -1.0)]
        spans = [(sides[0][0], sides[1][0])]
        if self._boxes is not None:
            sides += [(box_bound, 1.0), (box_bound, -1.0)]
            spans += [(radius * np.eye(2), radius * np.eye(2))]
        spring = SpringTerm(m, axes[pair].T, terms, tuple(sides), tuple(spans), size)
        upper = min(high * np.eye(2), centre + box_bound, key=lambda matrix: float(np.trace(matrix)))
        third_axis = np.delete(axes, pair, axis=0)
        third_axis_terms = [
            float(ranges[m, kind][np.setdiff1d(range(3), pair)[0]]) * third_axis.T @ third_axis
            for ranges in (self.low, self.high)
        ]
        self._bounds[m, kind.start] = (
            axes[pair].T @ (low * np.eye(2)) @ axes[pair] + third_axis_terms[0],
            axes[pair].T @ upper @ axes[pair] + third_axis_terms[1]
        )  # fmt: skip
        return np.asarray(axes[pair].T @ centre @ axes[pair]), [spring]

    def _plane(self, m: int, axes: Array, pair: list[int], kind: slice) -> tuple[Any, PlaneStiffness, float]:
        """Return the key of the plane in which spring `m` turns, its plane stiffness, and the sign of the entry K12."""
        number = kind.start + np.array(pair)
        turns = [(k, j, gain) for k in range(TURNED.start, TURNED.stop) for j, gain in self.drives[m].get(k, [])]
        axis, _, gain = turns[0]
        # mounts share a plane only if a single number turns it
        turn_key = tuple((k, j, abs(gain)) for k, j, gain in turns) if len(turns) == 1 else (m, *turns)
        drives = [drive for k in number for drive in self.drives[m].get(int(k), [])]
        side = math.copysign(1.0, gain)
        angles = sorted(
            side * (float(values[m, axis]) - float(self._frames[m, axis])) for values in (self.low, self.high)
        )
        turned_angles = self._frames[m, TURNED].copy()
        turned_angles[axis - TURNED.start] += side * TEST_ANGLE
        sign = math.copysign(1.0, float(mount_axes(turned_angles)[pair[0]] @ axes[pair[1]]))
        start = (*self.start[m, number], side * (self.start[m, axis] - self._frames[m, axis]))
        key = (kind.start, tuple(drives), turn_key, tuple(round(float(entry), 9) for entry in start))
        near_stiffness = self._frames[m, number]
        plane = PlaneStiffness(self.low[m, number], self.high[m, number], (angles[0], angles[1]), near_stiffness)
        return key, plane, sign

    def _in_space(self, m: int, kind: slice) -> tuple[Array, list[SpringTerm]]:
        # matrix of six numbers between the smallest and the largest value
        low, high = float(self.low[m, kind].min()), float(self.high[m, kind].max())
        half, decisions = 0.5 * (high - low), sorted({j for drives in self.drives[m].values() for j, _ in drives})
        terms = []
        for a, b in combinations_with_replacement(range(3), 2):
            matrix = np.zeros((3, 3))
            matrix[a, b] = matrix[b, a] = half
            terms.append((self._number(("space", kind.start, m, a, b), decisions), matrix))
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
        """Return the open mount positions, grouped by decision, axis, loss factor and lag."""
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
            number, turn_axes = self._number(("one", j), [j]), np.delete(np.eye(3), axis, axis=0)
            places.append(PlaceTerm(number, np.eye(3)[axis], tuple(mounts), turn_axes, is_damped))
        return tuple(places)


def mount_axes(angles: Array) -> Array:
    """Return the axes of a mount as rows, shape (3, 3), from its angles [rad], shape (3,) (E2)."""
    return np.array(turned_axes(NUMBERS, angles.tolist()))


@dataclass(frozen=True, eq=False)
class PlaneStiffness:
    """Stiffness of a mount that turns in a plane (E63).

    Attributes
    ----------
    low, high
        Ranges of k1 and k2 [N/m], shape (2,) each.
    angles
        Smallest and largest angle b of the first axis [rad].
    reference
        k1 and k2 of the design that defines the fixed axes [N/m].
    """

    low: Array
    high: Array
    angles: tuple[float, float]
    reference: Array

    @property
    def full_box(self) -> Array:
        """Smallest and largest entries K11, K22 and K12 of the plane stiffness matrix [N/m], shape (3, 2)."""
        (low1, low2), (high1, high2) = self.low, self.high
        doubled = 2.0 * self.angles[0], 2.0 * self.angles[1]
        cosines = _sine_range(doubled[0] + 0.5 * math.pi, doubled[1] + 0.5 * math.pi)
        shares = [0.5 * (1.0 + cosine) for cosine in cosines]
        first = [(low1 * c + low2 * (1.0 - c), high1 * c + high2 * (1.0 - c)) for c in shares]
        second = [(low2 * c + low1 * (1.0 - c), high2 * c + high1 * (1.0 - c)) for c in shares]
        off_diagonal = [d * s for d in (0.5 * (low1 - high2), 0.5 * (high1 - low2)) for s in _sine_range(*doubled)]
        ends = [(min(a for a, _ in values), max(b for _, b in values)) for values in (first, second)]
        return np.array([*ends, (min(off_diagonal), max(off_diagonal))])


def _sine_range(low: float, high: float) -> tuple[float, float]:
    full_turn, ends = 2.0 * math.pi, (math.sin(low), math.sin(high))
    has_maximum = math.ceil((low - 0.5 * math.pi) / full_turn) * full_turn + 0.5 * math.pi <= high
    has_minimum = math.ceil((low + 0.5 * math.pi) / full_turn) * full_turn - 0.5 * math.pi <= high
    return (-1.0 if has_minimum else min(ends), 1.0 if has_maximum else max(ends))
