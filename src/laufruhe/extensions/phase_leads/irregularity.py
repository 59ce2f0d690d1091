"""Lower bounds of the degree of irregularity delta over boxes of lead angles (P14).

At two crank angles a and b the squares u = w^2 of the speed differ by twice (E + W_a) / m_a - (E + W_b) / m_b. E is the
energy at the start, W the work of the torque, and m the inertia (F2-F4). A change of a lead changes work and inertia on
its shaft by at most this change times the largest torque, and times the largest slope of the inertia. E falls with W
and rises with m, so the equation of E with changed W and m bounds it. With the mean speed w_0,

    delta >= (u_a - u_b) / (w_a + w_b) / w_0,   with a lower bound of the numerator and upper bounds of w_a and w_b.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.phase_leads.model import PhaseLeadModel, earlier, problem_of_shafts
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import curvature
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.torque import FINE_SPEED, turning_inertia
from laufruhe.physics.uneven_speed import driving_torque, moving_inertia, start_energy
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class _Part:
    """Work and inertia on one shaft, or of the fixed parts, with upper bounds of their slopes (`torque`, `slope`)."""

    work: Spectrum
    inertia: Spectrum
    torque: float
    slope: float


class LeadSwing:
    """Lower bounds of the degree of irregularity over boxes of lead angles."""

    def __init__(self, problem: Problem, model: PhaseLeadModel, measure: Measure) -> None:
        fidelity, inertia = problem.fidelity, turning_inertia(problem.engine, problem.fidelity)
        if inertia is None:
            raise ModelError("the degree of irregularity needs the inertia of all rotating parts; add [flywheel]")
        self._start, self._turning = model.start, inertia
        self._steps = FINE_SPEED * fidelity.samples
        names = model.names
        engines = [
            problem_of_shafts(problem, test).engine
            for test in (lambda n: n not in names, *(name.__eq__ for name in names))
        ]
        angles = problem.engine.cycle.angle * np.arange(self._steps) / self._steps
        self._points: list[tuple[float, list[_Part]]] = []
        for point in problem.points:
            if measure.includes_point(point):
                parts = []
                for engine in engines:
                    torque = driving_torque(engine, point, fidelity)
                    swing = spectrum_of(moving_inertia(engine, fidelity, angles)[0], engine.cycle.base_order)
                    slope = float(np.abs(swing.coefficients[1:] * swing.orders[1:]).sum())
                    parts.append(_Part(torque.integral, swing, largest_torque(torque), slope))
                self._points.append((point.speed, parts))

    def minimum_over(self, middle: Array, half: Array) -> float:
        """Return a lower bound on a box of leads [rad], shape (leads,): the largest bound of any operating point."""
        return max(self._minimum_at_point(speed, parts, middle, half) for speed, parts in self._points)

    def _minimum_at_point(self, speed: float, parts: Sequence[_Part], middle: Array, half: Array) -> float:
        changes = [0.0, *(middle - self._start)]
        work: Array = np.sum(
            [earlier(part.work, d).sample(self._steps) for part, d in zip(parts, changes, strict=True)], axis=0
        )
        swinging = [earlier(part.inertia, d).sample(self._steps) for part, d in zip(parts, changes, strict=True)]
        inertia: Array = self._turning + np.sum(swinging, axis=0)
        work_error = float(sum(part.torque * r for part, r in zip(parts[1:], half, strict=True)))
        inertia_error = float(sum(part.slope * r for part, r in zip(parts[1:], half, strict=True)))
        if inertia.min() <= inertia_error:
            return 0.0
        try:
            low = start_energy(work, inertia - inertia_error, speed) - work_error
            high = start_energy(work, inertia + inertia_error, speed) + work_error
        except ModelError:
            # the crank may stop
            return 0.0
        squares = (0.5 * (low + high) + work) / inertia
        a, b = int(np.argmax(squares)), int(np.argmin(squares))
        light, heavy = inertia[a] + inertia_error, inertia[b] - inertia_error
        # linear in the energy, so minimal at an end
        difference = min(
            2.0 * ((energy + work[a] - work_error) / light - (energy + work[b] + work_error) / heavy)
            for energy in (low, high)
        )
        fastest = [
            math.sqrt(2.0 * max(high + work[k] + work_error, 0.0) / (inertia[k] - inertia_error)) for k in (a, b)
        ]
        return max(float(difference), 0.0) / sum(fastest) / speed


def largest_torque(torque: Spectrum) -> float:
    """Return an upper bound of the deviation of a torque from its mean, anywhere in the cycle [N m]."""
    swing = torque.with_coefficients(np.concatenate([[0.0], torque.coefficients[1:]]))
    steps = max(8 * len(swing.coefficients), 64)
    values = np.concatenate([swing.sample(steps), swing.values(swing.kink_angles)])
    curvatures = curvature(swing.mapped(lambda values: values[:, None, None]))
    return float(np.abs(values).max() + (swing.period / steps) ** 2 / 8.0 * curvatures.max(initial=0.0))
