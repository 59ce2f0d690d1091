"""Limits on sag, frequencies and stiffness over a box of mounts, as polynomials that multipliers can add (E70).

For all open numbers of mounts, a quadratic form y' A y is a quadratic in s plus a remainder (E68). The Rayleigh
quotient of any y lies between the squares of the lowest and the highest frequency, and for any y

    p' A^-1 p >= 2 p' y - y' A y,

so each limit has a polynomial in s that is nowhere above its violation.
"""

from __future__ import annotations

import math

import numpy as np

from laufruhe.extensions.joint_mounts.bernstein import coefficients
from laufruhe.extensions.joint_mounts.mount_loops import open_stiffness
from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import STIFFNESS
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK, number_ranges

CHANNELS = (channels.SAG, channels.FREQUENCIES, channels.TOTAL_STIFFNESS)


class RestLimits:
    """Limits of a problem on sag, frequencies and total stiffness of the block at rest."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        block = mounting_in(problem.engine).block
        weight = weight_wrench(block)
        # weight of the block in coordinates with unit mass, and its size [N]
        self._pull, self._weight = mass_root(block) @ weight, -float(weight[2])
        self._limits = [limit for limit in problem.mount_limits if limit.measure.channel in CHANNELS]
        gains = [
            [d.gain for d in decision.mount_drives if d.number < STIFFNESS.stop] for decision in problem.mount_decisions
        ]
        self._stiffness_slopes = np.array([sum(decision_gains) for decision_gains in gains], dtype=float)

    def over(self, lower: Array, upper: Array) -> list[Array]:
        """Return Bernstein coefficients of lower bounds of the relative violation of each limit, shape (4^n,) each."""
        violations: list[Array] = []
        if not self._limits:
            return violations
        count, bernstein = len(lower), coefficients(len(lower))
        middle, form = open_stiffness(self._problem, lower, upper)
        for limit in self._limits:
            if limit.measure.channel is channels.SAG:
                maximum = limit.maximum * self._weight * (1.0 + SLACK)
                if 0.0 < maximum < math.inf:
                    y = np.asarray(np.linalg.solve(middle, self._pull), dtype=np.float64)
                    powers, remainder = form(y)
                    violations.append(
                        (2.0 * float(self._pull @ y) - bernstein @ powers - remainder - maximum) / maximum
                    )
            elif limit.measure.channel is channels.FREQUENCIES:
                # modes at the middle by rising frequency
                modes: Array = np.linalg.eigh(0.5 * (middle + middle.T))[1]
                if limit.minimum > 0.0:
                    powers, remainder = form(modes[:, 0])
                    minimum = (math.tau * limit.minimum * (1.0 - SLACK)) ** 2
                    violations.append((minimum - bernstein @ powers - remainder) / minimum)
                if limit.maximum < math.inf:
                    powers, remainder = form(modes[:, -1])
                    maximum = (math.tau * limit.maximum * (1.0 + SLACK)) ** 2
                    violations.append((bernstein @ powers - remainder - maximum) / maximum)
            else:
                ends = [float(numbers[:, STIFFNESS].sum()) for numbers in number_ranges(self._problem, lower, upper)]
                slopes = 0.5 * (upper - lower) * self._stiffness_slopes
                total = bernstein @ np.concatenate([[0.5 * sum(ends)], slopes, np.zeros(count**2)])
                edges = ((1.0, limit.maximum), (-1.0, limit.minimum))
                violations += [sign * (total - edge) / edge - SLACK for sign, edge in edges if 0.0 < edge < math.inf]
        return violations
