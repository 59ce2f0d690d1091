"""Loads as waves of throws and of open bank and split-pin angles (S30).

A cylinder alone with its axis upright loads by A, with the axis a quarter turn further by B, and in roll by C.
On the bank b = s beta its axis leans by b, and it is later by b: order h is e^{i h (theta - b)} times
A_h cos b + B_h sin b + C_h, waves of b of the orders h - 1, h and h + 1, with coefficients from the exact model.
A split pin makes it later alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.lone_parts import lone
from laufruhe.load_models.throw_waves import ThrowWaves
from laufruhe.machine import Engine
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

Wave = tuple[Fraction, ...]


class AngleWaves(ThrowWaves):
    """Norms of a problem as waves of throws, bank angle and split pins.

    Parameters
    ----------
    problem
        Nothing of its phasing open; unbalances that are open ride on no throw.
    layout
        Of its engine.
    rides
        Throw that every rotor turns with.
    opened
        Whether the bank angle and split pins are open.
    turns
        What an open angle adds to every throw: side of cylinder 1 where throws are counted from its dead centre.
    """

    def __init__(
        self, problem: Problem, layout: Layout, rides: dict[str, int], opened: tuple[bool, bool], turns: float
    ) -> None:
        self._opened, self._turns = opened, turns
        if len(layout.throw_positions) == 1:
            # one throw is cheap to follow
            self.share_left_out, self._followed = (1e-6, 1e-6), (1e-9, 1e-9)
        super().__init__(problem, layout, rides)
        self._at = [
            None if k is None else [evaluate(self._acting(part), self._turned_to(k, bank)) for bank in self._banks(k)]
            for part, k in ((part, part.cylinder) for part in self.parts)
        ]
        every = sorted({wave for k in range(len(self.parts)) for wave, *_ in self._waves_of(k)})
        self.orders = np.array([[float(order) for order in wave] for wave in every])
        self._place_of = {wave: place for place, wave in enumerate(every)}

    def _banks(self, k: int) -> tuple[float, ...]:
        return (0.0, 0.5 * math.pi, math.pi) if self._opened[0] else (self.layout.banks[k],)

    def _turned_to(self, k: int, bank: float) -> Engine:
        """A cylinder alone, with alpha = 0 when phi = 0."""
        engine, late = self.problem.engine, self.layout.late[k] if self.layout.late else 0.0
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=late)
        return lone(engine, k, any(measure.is_inside for measure in self.problem.measures), part)

    def _components(self, spectra: Sequence[Spectrum]) -> list[ComplexArray]:
        """Of what leans with the bank, of what does not, and of what leans against it, from the banks of `_banks`."""
        found = [self.coefficients(signal) for signal in spectra]
        if not self._opened[0]:
            return found
        upright, across, upside = found
        still = 0.5 * (upright + upside)
        a, b = 0.5 * (upright - upside), across - still
        return [0.5 * (a - 1j * b), still, 0.5 * (a + 1j * b)]

    def _waves_of(self, k: int) -> Iterator[tuple[Wave, int, int]]:
        """Waves of a part, each with the place of its order and its component."""
        cylinder = self.parts[k].cylinder
        side = Fraction(0 if cylinder is None else self.layout.side(cylinder))
        steps = (-1, 0, 1) if self._opened[0] and cylinder is not None else (0,)
        for j, step in enumerate(steps):
            for h, order in enumerate(self.times):
                turned = order * Fraction(self._turns)
                each = (turned - (order + step) * side, turned - order * side)
                yield (order, *(m for m, is_open in zip(each, self._opened, strict=True) if is_open)), h, j

    def add(self, waves: ComplexArray, measure: Measure, k: int, samples: int) -> None:
        """Rows of one part to those of its waves, shape (waves, k, d)."""
        part, at = self.parts[k], self._at[k]
        if not self.acts(measure, k):
            return
        if at is None or part.cylinder is None:
            rows = [self.own_rows(measure, k, samples)]
        else:
            every = [found.signals(measure.load) for found in at]
            parts = [self._components(own) for own in zip(*every, strict=True)]
            # what is not open makes the cylinder later, or sooner
            still = 0.0 if self._opened[0] else -self.layout.banks[part.cylinder]
            still += 0.0 if self._opened[1] else self.layout.pin_offsets[part.cylinder]
            later = np.exp(1j * still * np.array([float(order) for order in self.times]))[:, None, None]
            rows = [
                self.rows_of(measure, [own[j] for own in parts], samples) * later for j in range(len(self._banks(0)))
            ]
        for wave, h, j in self._waves_of(k):
            waves[self._place_of[wave]] += rows[j][h]

    def arcs(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Bounds of the throws, which open angles turn."""
        ends = self._turns * lower[self.throws :].sum(), self._turns * upper[self.throws :].sum()
        return lower[: self.throws] + min(ends), upper[: self.throws] + max(ends)

    def _left_out(self, measure: Measure, k: int, samples: int) -> float:
        """Of one cylinder, wherever its bank: |A cos b + B sin b + C| is no more than all three."""
        at = self._at[k]
        if at is None or not self._opened[0]:
            return super()._left_out(measure, k, samples)
        upright, across, upside = (self.counted(measure, found) for found in at)
        total = 0.0
        for u, a, d in zip(upright, across, upside, strict=True):
            still = (u + d).each(lambda values: 0.5 * values)
            leaning = (u + d.each(np.negative)).each(lambda values: 0.5 * values), a + still.each(np.negative)
            total = max(total, sum(self.tail(measure, [one], samples) for one in (still, *leaning)))
        return total
