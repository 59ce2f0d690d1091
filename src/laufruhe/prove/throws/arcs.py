"""What a bound leaves of throws between bounds: the least of sums of waves over their arcs (S27).

With multipliers given, what is minimised and limited is no less than a constant and, of every throw by
itself, a function Re sum_h c_h e^{i h theta} + s theta of its angle. Its least value between two bounds
is found on a grid, with the most that it can fall between two angles taken off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array

GRID = 65


class ArcBox:
    """Angles of a box of throws, and their waves.

    Parameters
    ----------
    orders
        Of the waves that are followed; of those beyond only the size is known.
    lower, upper
        Of every throw [rad].
    """

    def __init__(self, orders: Array, lower: Array, upper: Array) -> None:
        self.angles = lower[:, None] + (upper - lower)[:, None] * np.linspace(0.0, 1.0, GRID)
        self._turned = np.exp(1j * self.angles[:, :, None] * orders)
        # a function bends away from its chord by no more than a'' step^2 / 8, and no wave by more than its size
        steps = (upper - lower) / (GRID - 1)
        self._bends = np.minimum(np.square(orders * steps[:, None]) / 8.0, 2.0)

    def functions(self, waves: NDArray[np.complex128], slopes: Array) -> Arcs:
        """Re sum_h c_h e^{i h theta} + s theta of every throw, from c, shape (throws, orders), and s."""
        followed, size = self._bends.shape[1], np.abs(waves)
        values = np.matmul(self._turned, waves[:, :followed, None])[:, :, 0].real + slopes[:, None] * self.angles
        bend = (size[:, :followed] * self._bends).sum(axis=1) + size[:, followed:].sum(axis=1)
        return Arcs(self.angles, values, bend)


@dataclass(frozen=True, eq=False)
class Arcs:
    """Functions of all throws over a box of their angles.

    Attributes
    ----------
    angles, values
        Of every throw, shape (throws, GRID).
    bend
        What a throw's function may be less than at the nearest angles, shape (throws,).
    """

    angles: Array
    values: Array
    bend: Array

    @property
    def least(self) -> Array:
        """Of every throw, not exceeded, shape (throws,)."""
        return np.asarray(self.values.min(axis=1) - self.bend)

    def kept(self, room: float) -> tuple[Array, Array] | None:
        """Ends of the angles of every throw that leave all together less than `room` above the least; None if none."""
        # the least between two angles of the grid is bounded by both ends
        between = np.minimum(self.values[:, :-1], self.values[:, 1:]) - self.bend[:, None]
        open_ = between - self.least[:, None] < room
        if not open_.any(axis=1).all():
            return None
        first, last = open_.argmax(axis=1), GRID - 2 - open_[:, ::-1].argmax(axis=1)
        rows = np.arange(len(open_))
        return self.angles[rows, first], self.angles[rows, last + 1]
