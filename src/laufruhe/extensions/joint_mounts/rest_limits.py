"""Limits on numbers of the block at rest over a box of mounts, as polynomials that are over zero where broken (E70).

A quadratic form y' A y is a quadratic in s and a rest, whatever of the mounts is open (E68). No frequency is over that
of any motion, nor the highest under it, and for every y

    p' A^-1 p >= 2 p' y - y' A y,

so that each of these is a function of s that is nowhere over what the limit is of: it has a price.
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
class _Rest:
    """A block at rest over a box of mounts.

    Attributes
    ----------
    count
        Open numbers.
    pull, weight
        Weight of the block in coordinates in which its mass is one, and its size [N].
    stiffness
        In all, by (1, s, s s') [N/m].
    """

    count: int
    at: OpenStiffness
    pull: Array
    weight: float
    stiffness: Array

    def form(self, y: Array) -> tuple[Array, float]:
        """Coefficients of y' A y, (4^n,), and what it may differ by."""
        powers, rest = self.at.form(y, self.count)
        return coefficients(self.count) @ powers, rest

    @cached_property
    def motions(self) -> Array:
        """Of the middle, those of the lowest frequency first, shape (6, 6)."""
        return np.asarray(np.linalg.eigh(0.5 * (self.at.middle + self.at.middle.T))[1], dtype=np.float64)


def _sag(limit: Limit, rest: _Rest) -> list[Array]:
    most = limit.maximum * rest.weight * (1.0 + SLACK)
    if not 0.0 < most < math.inf:
        return []
    y = np.asarray(np.linalg.solve(rest.at.middle, rest.pull), dtype=np.float64)
    form, off = rest.form(y)
    return [(2.0 * float(rest.pull @ y) - form - off - most) / most]


def _frequencies(limit: Limit, rest: _Rest) -> list[Array]:
    found = []
    if limit.minimum > 0.0:
        least, (form, off) = (math.tau * limit.minimum * (1.0 - SLACK)) ** 2, rest.form(rest.motions[:, 0])
        found.append((least - form - off) / least)
    if limit.maximum < math.inf:
        most, (form, off) = (math.tau * limit.maximum * (1.0 + SLACK)) ** 2, rest.form(rest.motions[:, -1])
        found.append((form - off - most) / most)
    return found


def _stiffness(limit: Limit, rest: _Rest) -> list[Array]:
    given, edges = coefficients(rest.count) @ rest.stiffness, ((1.0, limit.maximum), (-1.0, limit.minimum))
    return [sign * (given - edge) / edge - SLACK for sign, edge in edges if 0.0 < edge < math.inf]


OVER: Mapping[Channel, Callable[[Limit, _Rest], list[Array]]] = {
    channels.SAG: _sag,
    channels.FREQUENCIES: _frequencies,
    channels.TOTAL_STIFFNESS: _stiffness,
}
"""Coefficients that are nowhere over the excess over a limit of a number, as a share of it."""


class RestLimits:
    """Of a problem that is open in numbers of mounts: those of its limits that are in the table."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        block = mounting_in(problem.engine).block
        weight = weight_wrench(block)
        self._pull, self._weight = mass_root(block) @ weight, -float(weight[2])
        self._limits = [limit for limit in problem.mount_limits if limit.measure.channel in OVER]
        stiffer = [[d.gain for d in each.mount_drives if d.number < STIFFNESS.stop] for each in problem.mount_decisions]
        self._stiffer = np.array([sum(gains) for gains in stiffer], dtype=float)

    def over(self, lower: Array, upper: Array) -> list[Array]:
        """Of every limit the Bernstein coefficients of what is not over its excess, as a share of it, (4^n,) each."""
        if not self._limits:
            return []
        whole = [float(edge[:, STIFFNESS].sum()) for edge in number_ranges(self._problem, lower, upper)]
        stiffness = [[0.5 * sum(whole)], 0.5 * (upper - lower) * self._stiffer, np.zeros(len(lower) ** 2)]
        at = open_stiffness(self._problem, lower, upper)
        rest = _Rest(len(lower), at, self._pull, self._weight, np.concatenate(stiffness))
        return [each for limit in self._limits for each in OVER[limit.measure.channel](limit, rest)]
