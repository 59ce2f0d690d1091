"""Numbers that open springs and places of mounts follow (E42, E52)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.decision import LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.transmitted import number_ranges

# angle by which a mount is turned to see which of its axes stay [rad]
ASIDE = 0.3
STAYS = 1e-9


@dataclass(frozen=True, eq=False)
class Spring:
    """Open stiffness of a spring along some axes, its middle left out: the sum of s_j times a matrix.

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
    size
        Of the sum [N/m].
    """

    mount: int
    axes: Array
    terms: tuple[tuple[int, Array], ...]
    sides: tuple[tuple[Array, float], ...]
    size: float

    def slopes(self, numbers: int) -> Array:
        """By s, shape (numbers, b, b)."""
        out = np.zeros((numbers, *self.terms[0][1].shape))
        for j, matrix in self.terms:
            out[j] += matrix
        return out

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
    """

    number: int
    axis: Array
    mounts: tuple[tuple[int, float], ...]
    aside: Array

    @property
    def arms(self) -> Array:
        """What a turn about each of these moves a mount by, and takes of its force as moment, shape (n, 3)."""
        return np.cross(self.aside, self.axis)


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

    def __init__(self, problem: Problem, lower: Array, upper: Array) -> None:
        self.low, self.high = number_ranges(problem, lower, upper)
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

    def springs(self, m: int) -> tuple[Array, list[Spring]]:
        """Stiffness at the middle, shape (3, 3), and what is open of it."""
        middle, reach = self.middle(m), self.reach(m)
        axes = own_axes(middle[TURNED])
        turned = reach[TURNED] > 0.0
        if not turned.any():
            return self._along(m, axes, range(3))
        other = own_axes(middle[TURNED] + ASIDE * turned)
        stay = [i for i in range(3) if np.abs(other[i] - axes[i]).max() < STAYS]
        if np.count_nonzero(turned) > 1 or len(stay) != 1:
            return self._in_space(m)
        total, springs = self._along(m, axes, stay)
        added, spring = self._in_plane(m, axes, [i for i in range(3) if i not in stay])
        return np.asarray(total + added), [*springs, spring]

    def _along(self, m: int, axes: Array, chosen: Sequence[int]) -> tuple[Array, list[Spring]]:
        """Along axes that stay."""
        middle, reach, springs, total = self.middle(m), self.reach(m), [], np.zeros((3, 3))
        for i in chosen:
            total += middle[i] * np.outer(axes[i], axes[i])
            if reach[i] > 0.0:
                parts = [(j, gain * self.half[j]) for j, gain in self.drives[m][i]]
                terms = tuple((self.numbers.of(("one", j), [j]), np.array([[h]])) for j, h in parts)
                side = np.array([[reach[i]]])
                springs.append(Spring(m, axes[i][:, None], terms, ((side, 1.0), (side, -1.0)), float(reach[i])))
        return total, springs

    def _in_plane(self, m: int, axes: Array, pair: list[int]) -> tuple[Array, Spring]:
        """Two axes that turn about the third (E52), as they stand at the middle of the angle."""
        number = STIFFNESS.start + np.array(pair)
        (low1, low2), (high1, high2) = self.low[m, number], self.high[m, number]
        turns = [(k, j, gain) for k in range(TURNED.start, TURNED.stop) for j, gain in self.drives[m].get(k, [])]
        gain = turns[0][2]
        # what several numbers turn is its own
        turned = tuple((k, j, abs(gain)) for k, j, gain in turns) if len(turns) == 1 else (m, *turns)
        angle = float(self.reach(m)[TURNED].max())
        mixed = math.sin(min(angle, 0.5 * math.pi)) ** 2
        apart = max(abs(high1 - low2), abs(high2 - low1))
        sides = [
            (min(a, (1.0 - mixed) * a + mixed * b), max(c, (1.0 - mixed) * c + mixed * d))
            for a, b, c, d in ((low1, low2, high1, high2), (low2, low1, high2, high1))
        ]
        across = 0.5 * apart * math.sin(min(2.0 * angle, 0.5 * math.pi))
        centre, halves = np.diag([0.5 * (a + b) for a, b in sides]), [0.5 * (b - a) for a, b in sides]
        drives = [drive for k in number for drive in self.drives[m].get(int(k), [])]
        key = (tuple(drives), turned, angle, low1, high1, low2, high2)
        follows = [*(j for _, j, _ in turns), *(j for j, _ in drives)]
        one, two = np.diag([1.0, 0.0]), np.diag([0.0, 1.0])
        both = math.copysign(1.0, gain) * (np.ones((2, 2)) - np.eye(2))
        matrices = (halves[0] * one, halves[1] * two, across * both)
        terms = tuple((self.numbers.of((k, key), follows), matrix) for k, matrix in enumerate(matrices))
        bounds = ((centre - min(low1, low2) * np.eye(2), 1.0), (max(high1, high2) * np.eye(2) - centre, -1.0))
        spring = Spring(m, axes[pair].T, terms, bounds, max(*halves, across))
        return np.asarray(axes[pair].T @ centre @ axes[pair]), spring

    def _in_space(self, m: int) -> tuple[Array, list[Spring]]:
        """A matrix between the least and the largest stiffness."""
        low, high = float(self.low[m, STIFFNESS].min()), float(self.high[m, STIFFNESS].max())
        half, follows = 0.5 * (high - low), sorted({j for drives in self.drives[m].values() for j, _ in drives})
        terms = []
        for a, b in combinations_with_replacement(range(3), 2):
            matrix = np.zeros((3, 3))
            matrix[a, b] = matrix[b, a] = half
            terms.append((self.numbers.of(("space", m, a, b), follows), matrix))
        side = half * np.eye(3)
        middle = 0.5 * (low + high) * np.eye(3)
        return middle, [Spring(m, np.eye(3), tuple(terms), ((side, 1.0), (side, -1.0)), half)]

    def least_and_most(self, m: int) -> tuple[Array, Array]:
        """Matrices that the mount's stiffness is not under and not over, shape (3, 3) each."""
        low, high, axes = self.low[m, STIFFNESS], self.high[m, STIFFNESS], np.eye(3)
        if np.any(self.reach(m)[TURNED] > 0.0):
            low, high = np.full(3, low.min()), np.full(3, high.max())
        else:
            axes = own_axes(self.middle(m)[TURNED])
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
            Place(self.numbers.of(("one", j), [j]), np.eye(3)[axis], tuple(mounts), np.delete(np.eye(3), axis, axis=0))
            for (j, axis, *_), mounts in found.items()
        )


def own_axes(angles: Array) -> Array:
    """Own axes of a mount as rows, shape (3, 3) (E2)."""
    return np.array(turned_axes(NUMBERS, angles.tolist()))
