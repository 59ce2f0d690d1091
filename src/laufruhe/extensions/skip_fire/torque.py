"""Torque of a firing pattern over several cycles (T17).

A cylinder that fires adds to the torque of the engine without combustion a pulse D, its fired less its skipped torque
over one cycle. So the torque of a pattern, and its coefficient of order h, are sums over opportunities to fire,

    T = T_skipped + sum_k x_k D_k(phi - phi_k),     c_h = sum_k x_k d_kh e^{-i h phi_k}                     (T17)

with x_k = 1 for those that fire. Gas has equal torque on crank and block.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, GasModel, OperatingPoint, SliderCrank
from laufruhe.machine.extra import Extra, MachineTorque
from laufruhe.machine.gas.charge import dead_centres
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.exact_angles import Turn, as_turn, star_orders
from laufruhe.numerics.spectrum import Spectrum, common_base, spectrum_with_kinks
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.physics.torque import crank_torque
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Firings(Extra):
    """Torque that the firings of a pattern add to an engine without combustion [N m]."""

    name: ClassVar[str] = "firings"
    torque: Spectrum

    def torques(self, _point: str, _base: Fraction, /) -> Sequence[MachineTorque]:
        """Return the torque of the firings on crank and block."""
        return (MachineTorque(self.torque, self.torque),)


@dataclass(frozen=True)
class Opportunity:
    """A cylinder that may fire at an angle of its cycle [turns]; equal cylinders share the pulse of their firing."""

    name: str
    turn: Turn
    pulse: Spectrum


@dataclass(frozen=True, eq=False)
class FiringModel:
    """Engine whose cylinders fire or are skipped in each of several cycles.

    Attributes
    ----------
    problem
        Engine with one operating point, at which all cylinders fire.
    fired, skipped
        Gas while all cylinders fire, and while none does.
    cycles
        Number of cycles after which patterns repeat.
    """

    problem: Problem
    fired: GasModel
    skipped: GasModel
    cycles: int

    @property
    def point(self) -> OperatingPoint:
        """Operating point at which no cylinder fires."""
        return replace(self.problem.points[0], gas=self.skipped)

    @cached_property
    def opportunities(self) -> tuple[Opportunity, ...]:
        """Opportunities of one cycle in the order of firing."""
        engine, fidelity, pulses, ones = self.problem.engine, self.problem.fidelity, dict[Hashable, Spectrum](), []
        for first in engine.cylinders:
            parts = [first, *(part for part in engine.slider_cranks if part.bore != 0.0 and first.faces(part))]
            kind = tuple(
                (part.shaft.ratio, round(part.firing_angle - first.firing_angle, 9), gas.alike(part))
                for part in parts for gas in (self.fired, self.skipped)
            )  # fmt: skip
            if kind not in pulses:
                pulse = self._pulse(parts, engine.cycle, fidelity.gas_steps)
                pulses[kind] = fidelity.truncated(fidelity.truncated_gas(pulse))
            ones.append(Opportunity(first.name, as_turn(first.firing_angle) % engine.cycle.turns, pulses[kind]))
        return tuple(sorted(ones, key=lambda one: float(one.turn)))

    def _pulse(self, parts: Sequence[SliderCrank], cycle: Cycle, steps: int) -> Spectrum:
        """Return the fired less the skipped torque of one cylinder in one cycle, from its firing, (n,) [N m] (T17).

        A cycle begins at the dead centre before intake, or before compression with two strokes. There the piston
        stands, and a jump of pressure has no torque.
        """
        first, period, gases = parts[0], self.cycles * cycle.angle, ((self.fired, 1.0), (self.skipped, -1.0))
        if len(first.swept.lags) > 1:
            raise ModelError(f"{first.name} has several chambers, and skip fire needs pistons; remove this case")
        top, bottom = dead_centres(first.swept.chamber)
        begin = first.swept.firing_delay - math.tau + (bottom if cycle is Cycle.TWO_STROKE else top)
        terms = [(part, part.firing_angle - first.firing_angle, *gas) for part in parts for gas in gases]

        def torque_at(angles: Array) -> Array:
            since = begin + (angles - begin) % period
            local = np.minimum(since, begin + cycle.angle)
            total = sum(sign * chamber_torque(gas, part, cycle, local - lag) for part, lag, gas, sign in terms)
            return np.where(since < begin + cycle.angle, total, 0.0)

        breaks = np.concatenate([lag + gas.breaks(part, cycle) for part, lag, gas, _ in terms])
        edges = begin + np.append((breaks - begin) % cycle.angle, [0.0, cycle.angle])
        return spectrum_with_kinks(torque_at, self.cycles * steps, cycle.base_order / self.cycles, edges)

    def torque(self, pattern: str) -> Spectrum:
        """Return the torque that the firings of a pattern add, shape (n,) [N m] (T17)."""
        cycle, count, fires = (
            self.problem.engine.cycle,
            len(self.opportunities),
            defaultdict[Spectrum, list[Turn]](list),
        )
        for k in range(self.cycles * count):
            if pattern[k % len(pattern)] == "1":
                one = self.opportunities[k % count]
                fires[one.pulse].append(one.turn + k // count * cycle.turns)
        total = Spectrum(cycle.base_order / self.cycles, np.zeros(1, dtype=complex))
        for pulse, turns in fires.items():
            delays = tuple(-turn / (self.cycles * cycle.turns) for turn in turns)
            phases = star_orders(np.ones((len(turns), 1)), delays, len(pulse.coefficients))[:, 0]
            kinks = pulse.kinks and pulse.kinks.repeated([math.tau * float(turn) for turn in turns], pulse.period)
            total = total + Spectrum(total.base, pulse.coefficients * phases, kinks)
        return total.with_base(common_base([cycle.base_order, total.repeat_order()]))

    def evaluation(self, pattern: str) -> Evaluation:
        """Return the loads of the engine with a pattern, by the exact model."""
        torque, engine, fidelity = self.torque(pattern), self.problem.engine, self.problem.fidelity
        samples = int(engine.cycle.base_order / torque.base) * fidelity.samples
        return evaluate(replace(self.problem, points=(self.point,)), engine.with_extra(Firings(torque)), samples)

    def crank_torque(self, pattern: str) -> Spectrum:
        """Return the crank torque of a pattern, shape (n,) [N m]."""
        return crank_torque(self.problem.engine, self.point, self.problem.fidelity) + self.torque(pattern)
