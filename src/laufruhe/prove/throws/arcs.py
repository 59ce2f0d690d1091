"""What a bound leaves of throws between bounds: the least of sums of waves over their arcs (S27, S30).

With multipliers given, what is minimised and limited is no less than a constant and, of every throw by
itself, a function Re sum_h c_h e^{i h theta} + s theta of its angle. Its least value between two bounds
is found on a grid, with the most that it can fall between two angles taken off. An open bank angle, or that of split
pins, is one angle that all these functions share: with it given they are of one throw each again, so that the least of
their sum is that over it of the sum of the least.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray

GRIDS = (65, 33, 17)
"""Angles of every throw and open angle, by how many angles are open beside throws."""


class ArcBox:
    """Angles of a box of throws, and of open angles that all of them share, and their waves e^{i (h theta + m . beta)}.

    Parameters
    ----------
    orders
        h and m of the waves that are followed, shape (waves, 1 + open angles); of those beyond only the size is known.
    lower, upper
        Of every throw, then of every open angle [rad].
    """

    def __init__(self, orders: Array, lower: Array, upper: Array) -> None:
        beside = orders.shape[1] - 1
        self.throws, grid = len(lower) - beside, GRIDS[beside]
        self.angles = lower[:, None] + (upper - lower)[:, None] * np.linspace(0.0, 1.0, grid)
        self._shared = np.array(list(product(*self.angles[self.throws :]))).reshape(grid**beside, beside)
        self._by_throw = np.exp(1j * self.angles[: self.throws, :, None] * orders[:, 0])
        self._by_shared = np.exp(1j * self._shared @ orders[:, 1:].T)
        # a function bends away from what is straight between angles by no more than the sum of a'' step^2 / 8 over
        # them, and no wave by more than twice its size
        steps = np.square((upper - lower) / (grid - 1)) / 8.0
        bends = np.square(orders[:, 0]) * steps[: self.throws, None] + np.square(orders[:, 1:]) @ steps[self.throws :]
        self._bends = np.minimum(bends, 2.0)

    def functions(self, waves: ComplexArray, slopes: Array, shared: Array) -> Arcs:
        """The sum over throws of Re sum_j c_j e^{i (h_j theta + m_j . beta)} + s theta, and of sigma . beta.

        Parameters
        ----------
        waves, slopes
            c, shape (throws, waves), and s of every throw.
        shared
            sigma of every open angle.
        """
        followed, size = self._bends.shape[1], np.abs(waves)
        turned = waves[:, None, :followed] * self._by_shared
        values = np.matmul(turned, self._by_throw.swapaxes(1, 2)).real
        values += slopes[:, None, None] * self.angles[: self.throws, None, :]
        bend = float((size[:, :followed] * self._bends).sum() + size[:, followed:].sum())
        # every throw by itself where open angles are told, and what that leaves together
        least = values.min(axis=2)
        total = least.sum(axis=0) + self._shared @ shared
        by_throw = (values + (total - least)[:, :, None]).min(axis=1)
        cells = total.reshape((self.angles.shape[1],) * len(shared))
        by_shared = [cells.min(axis=tuple(j for j in range(cells.ndim) if j != k))[None] for k in range(cells.ndim)]
        return Arcs(self.angles, np.concatenate([by_throw, *by_shared]), bend)


@dataclass(frozen=True, eq=False)
class Arcs:
    """What a sum of functions of throws leaves over a box of their angles.

    Attributes
    ----------
    angles, values
        Of every throw and open angle, and the least of the sum with that angle given, shape (angles, grid).
    bend
        What the sum may be less than at the nearest angles.
    """

    angles: Array
    values: Array
    bend: float

    @property
    def least(self) -> float:
        """Not exceeded."""
        return float(self.values[0].min()) - self.bend

    def kept(self, room: float) -> tuple[Array, Array] | None:
        """Ends of the angles that leave less than `room` above the least; None if none do."""
        # the least between two angles of the grid is bounded by both ends
        open_ = np.minimum(self.values[:, :-1], self.values[:, 1:]) - self.bend - self.least < room
        if not open_.any(axis=1).all():
            return None
        first, last = open_.argmax(axis=1), open_.shape[1] - 1 - open_[:, ::-1].argmax(axis=1)
        rows = np.arange(len(open_))
        return self.angles[rows, first], self.angles[rows, last + 1]
