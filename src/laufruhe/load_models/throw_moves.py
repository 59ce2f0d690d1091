"""Throws, bank angle and split pin as deviations from a crank star at a fixed firing order (S20).

Deviations may be numbers or CasADi symbols.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from laufruhe.machine.firing import firing_turns
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing

# largest deviation of a throw without bounds [rad]
MAX_DEVIATION = math.radians(60.0)
# deviation that counts as zero [rad]
ZERO_DEVIATION = 1e-8
MIN_INTERVAL = 1e-6
"""Smallest firing interval of open throws [rad], because simultaneous firings have no order."""


class ThrowMoves:
    """Open angles of a crank: their bounds, and their effect on the firing intervals.

    Parameters
    ----------
    phasing
        Open crank star with the bounds of its angles.
    start
        Crank star, with its firing order, from which deviations are counted.

    Attributes
    ----------
    size
        Number of open angles: throws, then bank angle, then split pin.
    lower, upper
        Bounds of the deviations [rad], shape (size,).
    """

    def __init__(self, phasing: Phasing, layout: Layout, start: Candidate, intervals: Intervals) -> None:
        self.phasing, self.layout, self.start = phasing, layout, start
        self.intervals = Intervals(max(intervals.minimum, min(MIN_INTERVAL, intervals.maximum)), intervals.maximum)
        self._throws = range(0 if phasing.throw_bounds else 1, len(start.throws))
        self._open_bank, self._open_split = phasing.is_geometry_open
        ends = [(-MAX_DEVIATION, MAX_DEVIATION)] * len(self._throws)
        if phasing.throw_bounds:
            ends = [(low - x, high - x) for (low, high), x in zip(phasing.throw_bounds, start.throws, strict=True)]
        for is_open, bounds, initial in (
            (self._open_bank, phasing.bank, start.bank_angle),
            (self._open_split, phasing.split, start.split_pin),
        ):
            if is_open and bounds is not None and initial is not None:
                ends.append((bounds[0] - initial, bounds[1] - initial))
        self.size = len(ends)
        self.lower, self.upper = np.array(ends).reshape(-1, 2).T

    def angles(self, x: Any) -> tuple[list[Any], Any, Any]:
        """Return throw angles, bank angle and split pin angle [rad] at deviations x from the start, shape (size,)."""
        start, position = self.start, len(self._throws)
        bank, split = start.bank_angle, start.split_pin
        if self._open_bank:
            bank = bank + x[position]
            position += 1
        if self._open_split:
            split = split + x[position]
        first = start.throws[0]
        if bank is not None and start.bank_angle is not None:
            # crank angle zero stays the dead centre of cylinder 1
            first = first + 0.5 * (bank - start.bank_angle)
        if split is not None and start.split_pin is not None:
            first = first + 0.5 * (split - start.split_pin)
        moved = [start.throws[k] + x[j] for j, k in enumerate(self._throws)]
        return moved if self.phasing.throw_bounds else [first, *moved], bank, split

    def candidate(self, x: Array) -> Candidate:
        """Return the crank whose open angles deviate by x from the start [rad], shape (size,)."""
        # a rounding error of a deviation would count as another firing angle
        throws, bank, split = self.angles(np.where(np.abs(x) < ZERO_DEVIATION, 0.0, x))
        return replace(
            self.start,
            throws=tuple(float(angle) % math.tau for angle in throws),
            bank_angle=None if bank is None else float(bank),
            split_pin=None if split is None else float(split),
        )

    def firing_intervals(self, x: Any) -> tuple[list[Any], list[str]]:
        """Return the firing intervals [rad] at deviations x of the open angles, linear in x (S20), and their names."""
        throws, bank, split = self.angles(x)
        start, cycle, pins = self.start, self.phasing.cycle, self.layout.pins
        order = start.firing_order or ()
        moments = []
        for turn, number in zip(firing_turns(self.layout, start.throws, order), order, strict=True):
            k = number - 1
            side = self.layout.side(k)
            moved = start.throws[pins[k]] - throws[pins[k]]
            if bank is not None and start.bank_angle is not None:
                moved = moved + side * (bank - start.bank_angle)
            if split is not None and start.split_pin is not None:
                moved = moved + side * (split - start.split_pin)
            moments.append(math.tau * turn + moved)
        next_moments = [*moments[1:], moments[0] + cycle.angle]
        intervals = [b - a for a, b in zip(moments, next_moments, strict=True)]
        return intervals, [f"firing interval after cylinder {number}" for number in order]
