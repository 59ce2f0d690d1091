"""What no degree of irregularity goes under while leads lie in a box (P14).

At two angles a and b the squares u = w^2 of the speed differ by (E + W_a) / m_a - (E + W_b) / m_b, twice, with E the
energy at the start (F2-F4). Work and inertia of what a shaft carries change by no more than a lead times the largest
torque and slope of it; E falls with W and rises with m, so that it lies between two numbers found as it is itself:

    delta >= (u_a - u_b) / (w_a + w_b) / w_0,   numerator from below, denominator from above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.led_model import LedModel, carried
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import curvature
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.irregularity import FINE
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.physics.uneven_speed import gas_torque, moving_inertia, start_energy
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class _Part:
    """What one shaft brings, or what stands: work and inertia, and how fast they change at most by the angle."""

    work: Spectrum
    inertia: Spectrum
    torque: float
    slope: float


class LeadSwing:
    """The degree of irregularity over leads."""

    def __init__(self, problem: Problem, model: LedModel, measure: Measure) -> None:
        fidelity, inertia = problem.fidelity, turning_inertia(problem.engine, problem.fidelity)
        if inertia is None:
            raise ModelError("degree of irregularity: the inertia of what turns is not told; add [flywheel]")
        self._start, self._turning = model.start, inertia
        self._steps = FINE * fidelity.samples
        names = model.names
        engines = [
            carried(problem, test).engine for test in (lambda n: n not in names, *(name.__eq__ for name in names))
        ]
        angles = problem.engine.cycle.angle * np.arange(self._steps) / self._steps
        self._points: list[tuple[float, list[_Part]]] = []
        for point in problem.points:
            if measure.counts_point(point):
                parts = []
                for engine in engines:
                    torque = gas_torque(engine, point, fidelity)
                    own = spectrum_of(moving_inertia(engine, fidelity, angles)[0], engine.cycle.base_order)
                    mass = float(np.abs(own.coefficients[1:] * own.orders[1:]).sum())
                    parts.append(_Part(torque.integral, own, _most(torque), mass))
                self._points.append((point.speed, parts))

    def least(self, middle: Array, half: Array) -> float:
        """What it is not under on a box, the most of all operating points."""
        return max(self._of_point(speed, parts, middle, half) for speed, parts in self._points)

    def _of_point(self, speed: float, parts: Sequence[_Part], middle: Array, half: Array) -> float:
        by = [0.0, *(middle - self._start)]
        work: Array = np.sum(
            [_earlier(part.work, d).sample(self._steps) for part, d in zip(parts, by, strict=True)], axis=0
        )
        swinging = [_earlier(part.inertia, d).sample(self._steps) for part, d in zip(parts, by, strict=True)]
        inertia: Array = self._turning + np.sum(swinging, axis=0)
        more = float(sum(part.torque * r for part, r in zip(parts[1:], half, strict=True)))
        heavier = float(sum(part.slope * r for part, r in zip(parts[1:], half, strict=True)))
        if inertia.min() <= heavier:
            return 0.0
        try:
            low = start_energy(work, inertia - heavier, speed) - more
            high = start_energy(work, inertia + heavier, speed) + more
        except ModelError:
            # the crank may stop: nothing is known
            return 0.0
        squares = (0.5 * (low + high) + work) / inertia
        a, b = int(np.argmax(squares)), int(np.argmin(squares))
        least_a, most_b = inertia[a] + heavier, inertia[b] - heavier
        # linear in the energy, so least at an end
        apart = min(
            2.0 * ((energy + work[a] - more) / least_a - (energy + work[b] + more) / most_b) for energy in (low, high)
        )
        fastest = [math.sqrt(2.0 * max(high + work[k] + more, 0.0) / (inertia[k] - heavier)) for k in (a, b)]
        return max(float(apart), 0.0) / sum(fastest) / speed


def _earlier(signal: Spectrum, lead: float) -> Spectrum:
    return signal.later(-lead / signal.period, -lead) if lead else signal


def _most(torque: Spectrum) -> float:
    own = torque.holding(np.concatenate([[0.0], torque.coefficients[1:]]))
    steps = max(8 * len(own.coefficients), 64)
    values = np.concatenate([own.sample(steps), own.values(own.bends)])
    bent = curvature(own.each(lambda each: each[:, None, None]))[0]
    return float(np.abs(values).max() + (own.period / steps) ** 2 / 8.0 * bent.max(initial=0.0))
