"""Limits on sag, frequencies and stiffness over a box of mounts, as polynomials that multipliers can add (E70).

Let s be the open numbers of mounts, from -1 to 1 on a box, and A the stiffness matrix of the block on its mounts. For
any motion y, y' A y is a quadratic in s plus a remainder (E68). The Rayleigh quotient of y lies between the squares of
the lowest and the highest frequency, and for the weight p of the block

    p' A^-1 p >= 2 p' y - y' A y,

so each limit has a polynomial in s that is nowhere above its violation. The smallest Bernstein coefficient of a
polynomial is a lower bound of it over the box (N6).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.joint_mounts.mount_loops import open_stiffness
from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, mounting_in
from laufruhe.problem.decision import STIFFNESS
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK, number_ranges

Form: TypeAlias = Callable[[Array], tuple[Array, float]]
# coefficients of (1 - t) and t times 1, s and s^2, s = 2 t - 1, in the basis (1 - t)^3, 3 (1 - t)^2 t, 3 (1 - t) t^2,
# t^3: shape (4, ends, powers)
_TIMES = np.array(
    [
        [[1.0, -1.0, 1.0], [0.0, 0.0, 0.0]],
        [[2.0 / 3.0, 0.0, -2.0 / 3.0], [1.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0]],
        [[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], [2.0 / 3.0, 0.0, -2.0 / 3.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]],
    ]
)


def corners_of(count: int) -> Array:
    """Return the vertices of the box from -1 to 1 in each number, shape (2^n, n)."""
    return np.array(list(itertools.product((-1.0, 1.0), repeat=count))).reshape(-1, count)


@lru_cache(maxsize=8)
def mixed(count: int) -> Array:
    """Return the matrix that mixes quadratic functions, one for each vertex of a box, into one polynomial.

    The quadratics are functions of `count` numbers s, with coefficients of (1, s, s s'). The mixture is multilinear.
    The mixture has Bernstein coefficients. The map has the shape (4^n, 2^n, 1 + n + n^2).
    """
    unit = np.eye(count, dtype=int)
    powers = [np.zeros(count, dtype=int), *unit, *(first + second for first in unit for second in unit)]
    weights = np.ones((4,) * count + (2,) * count + (len(powers),))
    for j in range(count):
        shape = np.ones(2 * count + 1, dtype=int)
        shape[j], shape[count + j], shape[-1] = 4, 2, len(powers)
        weights = weights * np.stack([_TIMES[:, :, power[j]] for power in powers], axis=-1).reshape(shape)
    return weights.reshape(4**count, 2**count, len(powers))


@lru_cache(maxsize=8)
def coefficients(count: int) -> Array:
    """Return the map from one quadratic by (1, s, s s') to Bernstein coefficients, shape (4^n, 1 + n + n^2)."""
    return np.asarray(mixed(count).sum(axis=1))


class RestLimits:
    """Limits of a problem on sag, frequencies and total stiffness of the block at rest."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        block = mounting_in(problem.engine).block
        weight = weight_wrench(block)
        # weight of the block in coordinates with unit mass, and its size [N]
        self._pull, self._weight = mass_root(block) @ weight, -float(weight[2])
        self._limits = [limit for limit in problem.mount_limits if limit.measure.channel in OVER]
        gains = [
            [d.gain for d in decision.mount_drives if d.number < STIFFNESS.stop] for decision in problem.mount_decisions
        ]
        self._stiffness_slopes = np.array([sum(decision_gains) for decision_gains in gains], dtype=float)

    def over(self, lower: Array, upper: Array) -> list[Array]:
        """Return a lower bound of the relative violation of each limit at rest over a box, such as sag.

        Each bound is a polynomial with Bernstein coefficients of shape (4^n,).
        """
        if not self._limits:
            return []
        box = lower, upper, *open_stiffness(self._problem, lower, upper)
        return [violation for limit in self._limits for violation in OVER[limit.measure.channel](self, limit, *box)]

    def _sag(self, limit: Limit, lower: Array, _: Array, middle: Array, form: Form) -> list[Array]:
        maximum = limit.maximum * self._weight * (1.0 + SLACK)
        if not 0.0 < maximum < math.inf:
            return []
        y = np.asarray(np.linalg.solve(middle, self._pull), dtype=np.float64)
        powers, remainder = form(y)
        return [(2.0 * float(self._pull @ y) - coefficients(len(lower)) @ powers - remainder - maximum) / maximum]

    def _frequencies(self, limit: Limit, lower: Array, _: Array, middle: Array, form: Form) -> list[Array]:
        # modes at the middle by rising frequency
        modes: Array = np.linalg.eigh(0.5 * (middle + middle.T))[1]
        violations = []
        if limit.minimum > 0.0:
            powers, remainder = form(modes[:, 0])
            minimum = (math.tau * limit.minimum * (1.0 - SLACK)) ** 2
            violations.append((minimum - coefficients(len(lower)) @ powers - remainder) / minimum)
        if limit.maximum < math.inf:
            powers, remainder = form(modes[:, -1])
            maximum = (math.tau * limit.maximum * (1.0 + SLACK)) ** 2
            violations.append((coefficients(len(lower)) @ powers - remainder - maximum) / maximum)
        return violations

    def _total_stiffness(self, limit: Limit, lower: Array, upper: Array, *_: object) -> list[Array]:
        ends = [float(numbers[:, STIFFNESS].sum()) for numbers in number_ranges(self._problem, lower, upper)]
        slopes = 0.5 * (upper - lower) * self._stiffness_slopes
        powers = np.concatenate([[0.5 * sum(ends)], slopes, np.zeros(len(lower) ** 2)])
        total = coefficients(len(lower)) @ powers
        edges = ((1.0, limit.maximum), (-1.0, limit.minimum))
        return [sign * (total - edge) / edge - SLACK for sign, edge in edges if 0.0 < edge < math.inf]


# Bernstein coefficients by channel
OVER: Mapping[Channel, Callable[..., list[Array]]] = {
    channels.SAG: RestLimits._sag,
    channels.FREQUENCIES: RestLimits._frequencies,
    channels.TOTAL_STIFFNESS: RestLimits._total_stiffness,
}
