"""Loads of a crank with one throw as waves of its bank angle, or of the angle between split pins (S30).

A cylinder alone with its axis upright loads by A, with the axis a quarter turn further by B, and in roll by C.
At a bank b its axis leans by b and it is later by b, so that order h is e^{-i h b} (A_h cos b + B_h sin b + C_h):
waves of b of the orders h - 1, h and h + 1, with coefficients from the exact model. A split pin makes it later alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from laufruhe.load_models.lone_parts import lone, working
from laufruhe.load_models.throw_waves import PEAK_STEPS, ThrowWaves, WaveNorm, averages
from laufruhe.machine import Engine
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem


class AngleWaves(ThrowWaves):
    """Norms of a problem as waves of half the bank angle, or half that between split pins, the throw where it is.

    Parameters
    ----------
    problem
        Nothing of its phasing open; its unbalances turn with the throw, or are free in their angle.
    layout
        Of its engine, with one throw.
    laps
        Whole turns of every cylinder's firing.
    of_bank
        Whether the bank angle moves, or the split pins.
    """

    # one angle is cheap to follow
    share_left_out: ClassVar[tuple[float, float]] = 1e-6, 1e-6
    _followed: ClassVar[tuple[float, float]] = 1e-9, 1e-9

    def __init__(self, problem: Problem, layout: Layout, laps: Sequence[int], of_bank: bool) -> None:
        super().__init__(problem, layout, {})
        self._laps, self._of_bank = laps, of_bank
        acting = [working(problem, part.name) for part in problem.engine.slider_cranks]
        self._at = [
            [evaluate(acting[k], self._turned_to(k, bank)) for bank in self._banks(k)] for k in range(len(laps))
        ]
        around = (-1, 0, 1) if of_bank else (0,)
        self.orders = tuple(sorted({abs(order + step) for order in self.times for step in around}))
        self.numbers = np.array([float(order) for order in self.orders])
        # one angle takes the place of a throw, and all that moves turns with it
        self.throws, self.parts = 1, [replace(self.parts[0], pin=0, cylinder=None)]

    def _banks(self, k: int) -> tuple[float, ...]:
        return (0.0, 0.5 * math.pi, math.pi) if self._of_bank else (self.layout.banks[k],)

    def _turned_to(self, k: int, bank: float) -> Engine:
        """A cylinder alone, at its firing dead centre when phi = 0."""
        engine = self.problem.engine
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=0.0)
        return lone(engine, k, any(measure.is_inside for measure in self.problem.measures), part)

    def _components(self, spectra: Sequence[Spectrum]) -> list[ComplexArray]:
        """Of forward and backward waves and of what does not lean, from the banks of `_banks`."""
        found = [self.coefficients(signal) for signal in spectra]
        if not self._of_bank:
            return found
        upright, across, upside = found
        still = 0.5 * (upright + upside)
        a, b = 0.5 * (upright - upside), across - still
        return [0.5 * (a - 1j * b), still, 0.5 * (a + 1j * b)]

    def norm(self, measure: Measure, samples: int) -> WaveNorm:
        """As of throws (S26), with waves of the one angle."""
        fixed = self.rest.norm(
            measure, samples, averaged=True, peaks=PEAK_STEPS if averages(self.problem, measure) else 0
        )
        waves = np.zeros((1, len(self.orders), *fixed.constant.shape), complex)
        if not measure.is_load:
            return WaveNorm(fixed, waves, 0.0)
        throw = self.problem.engine.slider_cranks[0].throw - self.layout.pin_offsets[0]
        steps = (-1, 0, 1) if self._of_bank else (0,)
        for k, found in enumerate(self._at):
            sign = 2.0 * self.layout.side(k)
            # what does not move makes the cylinder later, or sooner
            still = self.layout.pin_offsets[k] if self._of_bank else -self.layout.banks[k]
            every = [evaluation.signals(measure.load) for evaluation in found]
            parts = [self._components(own) for own in zip(*every, strict=True)]
            for j, step in enumerate(steps):
                rows = self.rows_of(measure, [own[j] for own in parts], samples)
                for order, row in zip(self.times, rows, strict=True):
                    turned = row * np.exp(1j * float(order) * (throw + still - math.tau * self._laps[k]))
                    backwards = sign * float(order + step) > 0.0
                    waves[0, self.orders.index(abs(order + step))] += turned.conj() if backwards else turned
        return WaveNorm(fixed, waves, self.left_out(measure, samples))

    def left_out(self, measure: Measure, samples: int) -> float:
        """What the orders that are left out amount to at most, whatever the angle."""
        return sum(self._left_out(measure, k, samples) for k in range(len(self._at))) if measure.is_load else 0.0

    def _left_out(self, measure: Measure, k: int, samples: int) -> float:
        """Of one cylinder, wherever its bank: no more than of all three of its own together."""
        total, mine = 0.0, self._alone[k]
        try:
            for found in self._at[k]:
                self._alone[k] = found
                total += super()._left_out(measure, k, samples)
        finally:
            self._alone[k] = mine
        # |A cos b + B sin b + C|, with A, B and C of the three
        return (3.0 if self._of_bank else 1.0) * total
