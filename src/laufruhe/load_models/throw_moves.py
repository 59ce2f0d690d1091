"""Throws, bank and split pin as deviations from a star, its firing order kept (S20).

Nothing here asks whether a deviation is a number or a symbol.
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

REACH = math.radians(60.0)
# [rad]
STAYS = 1e-8
APART = 1e-6
"""What cylinders that move fire apart at least [rad]: those that fire at once have no order."""


class ThrowMoves:
    """The open angles of a star, their bounds, and their effect on its firing intervals.

    Parameters
    ----------
    phasing
        What is open.
    layout
        Of the star.
    start
        The star and its firing order.
    intervals
        Allowed.
    """

    def __init__(self, phasing: Phasing, layout: Layout, start: Candidate, intervals: Intervals) -> None:
        self.phasing, self.layout, self.start = phasing, layout, start
        self.intervals = Intervals(max(intervals.minimum, min(APART, intervals.maximum)), intervals.maximum)
        self._throws = range(0 if phasing.throw_bounds else 1, len(start.throws))
        self._open_bank, self._open_split = phasing.is_geometry_open
        self.size = len(self._throws) + self._open_bank + self._open_split
        self.lower, self.upper = self._bounds()

    def _bounds(self) -> tuple[Array, Array]:
        low, high = [], []
        start, phasing = self.start, self.phasing
        for k in self._throws:
            pair = phasing.throw_bounds[k] if phasing.throw_bounds else None
            low.append(-REACH if pair is None else pair[0] - start.throws[k])
            high.append(REACH if pair is None else pair[1] - start.throws[k])
        for is_open, bounds, given in (
            (self._open_bank, phasing.bank, start.bank_angle),
            (self._open_split, phasing.split, start.split_pin),
        ):
            if is_open and bounds is not None and given is not None:
                low.append(bounds[0] - given)
                high.append(bounds[1] - given)
        return np.array(low), np.array(high)

    def angles(self, x: Any) -> tuple[list[Any], Any, Any]:
        """Throws, bank and split pin at deviations x of length `size`."""
        start, position = self.start, len(self._throws)
        bank, split = start.bank_angle, start.split_pin
        if self._open_bank:
            bank = bank + x[position]
            position += 1
        if self._open_split:
            split = split + x[position]
        first = start.throws[0]
        if bank is not None and start.bank_angle is not None:
            # cylinder 1 stays at its dead centre when phi = 0
            first = first + 0.5 * (bank - start.bank_angle)
        if split is not None and start.split_pin is not None:
            first = first + 0.5 * (split - start.split_pin)
        throws = [first] if not self.phasing.throw_bounds else []
        throws += [start.throws[k] + x[j] for j, k in enumerate(self._throws)]
        return throws, bank, split

    def candidate(self, x: Array) -> Candidate:
        """The design at deviations x."""
        # a rounding beside a step would pass for another firing angle
        throws, bank, split = self.angles(np.where(np.abs(x) < STAYS, 0.0, x))
        return replace(
            self.start,
            throws=tuple(float(angle) % math.tau for angle in throws),
            bank_angle=None if bank is None else float(bank),
            split_pin=None if split is None else float(split),
        )

    def firing(self, x: Any) -> tuple[list[Any], list[str]]:
        """Firing intervals, linear in the deviations (S20), and their names."""
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
        following = [*moments[1:], moments[0] + cycle.angle]
        rows = [b - a for a, b in zip(moments, following, strict=True)]
        return rows, [f"firing interval after cylinder {number}" for number in order]
