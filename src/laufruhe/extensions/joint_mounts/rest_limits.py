"""Limits on sag, frequencies and stiffness over a box of mounts, as polynomials that multipliers can add (E70).

For all open numbers of mounts, a quadratic form y' A y is a quadratic in s plus a remainder (E68). The Rayleigh
quotient of any y lies between the squares of the lowest and the highest frequency, and for any y

    p' A^-1 p >= 2 p' y - y' A y,

so each limit has a polynomial in s that is nowhere above its violation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.extensions.joint_mounts.bernstein import coefficients
from laufruhe.extensions.joint_mounts.mount_loops import OpenStiffness, open_stiffness
from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, mounting_in
from laufruhe.problem.decision import STIFFNESS
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK, number_ranges


@dataclass(frozen=True, eq=False)
class _RestingBlock:
    """Block at rest over a box of mounts.

    Attributes
    ----------
    count
        Number n of open numbers.
    stiffness_matrix
        Stiffness matrix over the box.
    pull, weight
        Weight of the block in coordinates with unit mass, shape (6,), and its size [N].
    stiffness
        Coefficients of the total stiffness by (1, s, s s'), shape (1 + n + n^2,) [N/m].
    """

    count: int
    stiffness_matrix: OpenStiffness
    pull: Array
    weight: float
    stiffness: Array

    def form(self, y: Array) -> tuple[Array, float]:
        """Return Bernstein coefficients of y' A y, shape (4^n,), and a bound of its remainder."""
        powers, remainder = self.stiffness_matrix.form(y, self.count)
        return coefficients(self.count) @ powers, remainder

    @cached_property
    def motions(self) -> Array:
        """Modes at the middle by rising frequency, as columns, shape (6, 6)."""
        return np.asarray(
            np.linalg.eigh(0.5 * (self.stiffness_matrix.middle + self.stiffness_matrix.middle.T))[1], dtype=np.float64
        )


def _sag(limit: Limit, block: _RestingBlock) -> list[Array]:
    maximum = limit.maximum * block.weight * (1.0 + SLACK)
    if not 0.0 < maximum < math.inf:
        return []
    y = np.asarray(np.linalg.solve(block.stiffness_matrix.middle, block.pull), dtype=np.float64)
    form, remainder = block.form(y)
    return [(2.0 * float(block.pull @ y) - form - remainder - maximum) / maximum]


def _frequencies(limit: Limit, block: _RestingBlock) -> list[Array]:
    violations = []
    if limit.minimum > 0.0:
        minimum, (form, remainder) = (math.tau * limit.minimum * (1.0 - SLACK)) ** 2, block.form(block.motions[:, 0])
        violations.append((minimum - form - remainder) / minimum)
    if limit.maximum < math.inf:
        maximum, (form, remainder) = (math.tau * limit.maximum * (1.0 + SLACK)) ** 2, block.form(block.motions[:, -1])
        violations.append((form - remainder - maximum) / maximum)
    return violations


def _stiffness(limit: Limit, block: _RestingBlock) -> list[Array]:
    total, edges = coefficients(block.count) @ block.stiffness, ((1.0, limit.maximum), (-1.0, limit.minimum))
    return [sign * (total - edge) / edge - SLACK for sign, edge in edges if 0.0 < edge < math.inf]


OVER: Mapping[Channel, Callable[[Limit, _RestingBlock], list[Array]]] = {
    channels.SAG: _sag,
    channels.FREQUENCIES: _frequencies,
    channels.TOTAL_STIFFNESS: _stiffness,
}
"""By channel: Bernstein coefficients of lower bounds of the relative violation of a limit."""


class RestLimits:
    """Limits of a problem on the block at rest, for channels of the table `OVER`."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        block = mounting_in(problem.engine).block
        weight = weight_wrench(block)
        self._pull, self._weight = mass_root(block) @ weight, -float(weight[2])
        self._limits = [limit for limit in problem.mount_limits if limit.measure.channel in OVER]
        gains = [
            [d.gain for d in decision.mount_drives if d.number < STIFFNESS.stop] for decision in problem.mount_decisions
        ]
        self._stiffness_slopes = np.array([sum(decision_gains) for decision_gains in gains], dtype=float)

    def over(self, lower: Array, upper: Array) -> list[Array]:
        """Return Bernstein coefficients of lower bounds of the relative violation of each limit, shape (4^n,) each."""
        if not self._limits:
            return []
        total = [float(ends[:, STIFFNESS].sum()) for ends in number_ranges(self._problem, lower, upper)]
        stiffness = [[0.5 * sum(total)], 0.5 * (upper - lower) * self._stiffness_slopes, np.zeros(len(lower) ** 2)]
        stiffness_matrix = open_stiffness(self._problem, lower, upper)
        block = _RestingBlock(len(lower), stiffness_matrix, self._pull, self._weight, np.concatenate(stiffness))
        return [
            coefficients_of_limit
            for limit in self._limits
            for coefficients_of_limit in OVER[limit.measure.channel](limit, block)
        ]
