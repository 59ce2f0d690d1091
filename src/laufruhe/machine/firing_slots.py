"""Assign the firings of a cycle to throws within bounds on firing intervals (S25).

The interval between cylinders of one throw is the angle between their banks and pins, plus whole turns. It does
not depend on the throw. Firings are numbered from 0 to n - 1. A throw takes a set of them, and all throws
together take each once. For given sets, a linear program finds the moments of the firings.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from laufruhe.machine.engine import Cycle

Shape: TypeAlias = tuple[tuple[int, float, float], ...]
"""Further cylinders of a throw: slots after the first one, whole turns [rad], share of bank plus split pin angle."""
SlotAssignment: TypeAlias = tuple[tuple[int, Shape], ...]
"""Assignment of all firings to throws: slot of the first cylinder and shape of every throw."""

# largest number of slot assignments: within the bounds, and with widened bounds; and of steps of the search for them
_MAX_ASSIGNMENTS = 500
_MAX_BROKEN = 40
_MAX_LOOKED_AT = 20_000
_SLACK = 1e-9
# weight of the violation of bounds over that of unevenness
_BROKEN = 1e3


@dataclass(frozen=True)
class FiringPattern:
    """Firings of a cycle that are assigned to throws.

    Attributes
    ----------
    moments
        Crank angle of every firing after the first [rad].
    members
        Slots of the cylinders of every throw, in the order of the cylinders; throws are in no order.
    angle
        Bank angle plus split pin angle [rad].
    broken
        Largest violation of the bounds of intervals [rad].
    """

    moments: tuple[float, ...]
    members: tuple[tuple[int, ...], ...]
    angle: float
    broken: float

    def intervals(self, cycle: Cycle) -> tuple[float, ...]:
        """Return the crank angles from firing to firing [rad]."""
        return tuple(b - a for a, b in itertools.pairwise((*self.moments, cycle.angle)))


@dataclass(frozen=True)
class FiringSlots:
    """Firings to assign to throws, and the bounds of intervals.

    Attributes
    ----------
    sides
        Share of bank angle plus split pin by which the dead centre of each cylinder comes after the angle of its throw.
    angle
        Smallest and largest bank angle plus split pin angle [rad].
    minimum, maximum
        Bounds of a firing interval [rad].
    """

    cycle: Cycle
    throws: int
    sides: tuple[float, ...]
    angle: tuple[float, float]
    minimum: float
    maximum: float

    @property
    def count(self) -> int:
        """Number of firings in a cycle."""
        return self.throws * len(self.sides)

    def patterns(self, throw_slots: Sequence[Sequence[int]] | None = None) -> tuple[list[FiringPattern], bool]:
        """Return the firing patterns within the bounds of firing intervals, and True if these are all.

        If no pattern keeps the bounds, those with the least violation are returned. If the firing order is given,
        `throw_slots` has the slots of the cylinders of every throw.
        """
        even, slack, maximum = self.cycle.angle / self.count, 0.0, min(_MAX_ASSIGNMENTS, 300_000 // self.count**2)

        def unevenness(pattern: FiringPattern) -> float:
            return round(max(abs(interval - even) for interval in pattern.intervals(self.cycle)), 9)

        while True:
            # roughly the most even assignments come first
            nodes = itertools.count(1)
            widened = replace(self, minimum=self.minimum - slack, maximum=self.maximum + slack)
            assignments = [*itertools.islice(widened._assignments(throw_slots, nodes), maximum + 1)]
            if slack == 0.0:
                complete = len(assignments) <= maximum and next(nodes) <= _MAX_LOOKED_AT
            patterns = [pattern for x in assignments[:maximum] if (pattern := self._timed(x)) is not None]
            patterns.sort(key=lambda pattern: (round(pattern.broken, 9), unevenness(pattern)))
            minimum = patterns[0].broken if patterns else math.inf
            if minimum <= max(slack, 1e-7) or slack > self.cycle.angle:
                return [pattern for pattern in patterns if pattern.broken <= minimum + 1e-7], complete
            slack, maximum = max(0.05 * even, 1.3 * slack), _MAX_BROKEN

    def _shapes(self) -> list[Shape]:
        """Return the shapes of a throw: slot offset, whole turns and angle share of its further cylinders."""
        cycle_angle, count = self.cycle.angle, self.count
        low, high = max(self.minimum, 0.0), self.maximum
        choices = []
        for side in self.sides[1:]:
            offset = side - self.sides[0]
            ends = sorted(offset * angle for angle in self.angle)
            shapes = []
            for turns in range(math.floor(-ends[1] / math.tau), math.ceil((cycle_angle - ends[0]) / math.tau) + 1):
                first, last = ends[0] + math.tau * turns, ends[1] + math.tau * turns
                shapes += [
                    (d, math.tau * turns, offset)
                    for d in range(1, count)
                    if max(d * low, cycle_angle - (count - d) * high) <= last + _SLACK
                    and min(d * high, cycle_angle - (count - d) * low) >= first - _SLACK
                ]
            # shapes that hardly change the intervals come first
            shapes.sort(key=lambda part: abs(0.5 * sum(ends) + part[1] - part[0] * cycle_angle / count))
            choices.append(shapes)
        return [shape for shape in itertools.product(*choices) if len({d for d, _, _ in shape}) == len(shape)]

    def _assignments(
        self, throw_slots: Sequence[Sequence[int]] | None, nodes: Iterator[int]
    ) -> Iterator[SlotAssignment]:
        """Yield assignments of all firings to throws; `nodes` counts the steps of the search."""
        count, shapes = self.count, self._shapes()
        if throw_slots is not None:
            offset_choices = [
                [
                    (slots[0], shape)
                    for shape in shapes
                    if all((slots[0] + d) % count == s for (d, _, _), s in zip(shape, slots[1:], strict=True))
                ]
                for slots in throw_slots
            ]
            yield from itertools.product(*offset_choices)
            return
        offsets = [(0, *(d for d, _, _ in shape)) for shape in shapes]

        def grow(taken: frozenset[int], placed: tuple[tuple[int, int], ...]) -> Iterator[tuple[tuple[int, int], ...]]:
            free = next((slot for slot in range(count) if slot not in taken), None)
            if free is None:
                yield placed
                return
            if next(nodes) >= _MAX_LOOKED_AT:
                return
            for number, offset_choices in enumerate(offsets):
                for member in offset_choices:
                    first = (free - member) % count
                    slots = frozenset((first + d) % count for d in offset_choices)
                    if not slots & taken:
                        yield from grow(taken | slots, (*placed, (first, number)))

        seen = set()
        for placed in grow(frozenset(), ()):
            turned = min(tuple(sorted(((f - first) % count, number) for f, number in placed)) for first, _ in placed)
            if turned not in seen:
                seen.add(turned)
                yield tuple((first, shapes[number]) for first, number in turned)

    def _timed(self, assignment: SlotAssignment) -> FiringPattern | None:
        """Return the best firing angles for an assignment: least violation of bounds, then most even.

        The result is None without any.
        """
        from scipy.optimize import linprog

        count, cycle_angle = self.count, self.cycle.angle
        even = cycle_angle / count
        # unknowns: moments of the firings, angle between the banks, unevenness, violation
        size = count + 3
        steps = np.zeros((count, size))
        for k in range(count):
            steps[k, k] -= 1.0
            steps[k, (k + 1) % count] += 1.0
        turn = np.zeros(count)
        turn[-1] = cycle_angle
        uneven, broken = np.zeros((2, count, size))
        uneven[:, count + 1] = 1.0
        broken[:, count + 2] = 1.0
        rows = np.concatenate([steps - uneven, -steps - uneven, steps - broken, -steps - broken])
        maximum = np.concatenate([even - turn, turn - even, self.maximum - turn, turn - self.minimum])
        fixed, values, members = [], [], []
        for first, shape in assignment:
            members.append((first, *((first + d) % count for d, _, _ in shape)))
            for slot, (_, turns, offset) in zip(members[-1][1:], shape, strict=True):
                row = np.zeros(size)
                row[slot], row[first], row[count] = 1.0, -1.0, -offset
                fixed.append(row)
                values.append(turns - (cycle_angle if slot < first else 0.0))
        bounds = [(0.0, 0.0), *([(None, None)] * (count - 1)), self.angle, (0.0, None), (0.0, None)]
        cost = np.zeros(size)
        cost[count + 1 :] = 1.0, _BROKEN
        answer = linprog(
            cost, rows, maximum, np.array(fixed) if fixed else None, values or None, bounds, method="highs"
        )
        if answer.x is None:
            return None
        return FiringPattern(
            tuple(float(t) for t in answer.x[:count]), tuple(members), float(answer.x[count]), float(answer.x[-1])
        )
