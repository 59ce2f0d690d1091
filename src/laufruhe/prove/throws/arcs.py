"""Bounds of sums of waves over arcs of throw angles (S27, S30).

With given multipliers, objective and limits are no less than a constant and, for every throw by itself, a function
Re sum_h c_h e^{i h theta} + s theta of its angle. Its minimum between two bounds is taken on a grid, less the most that
it can fall between two angles. An open bank or split-pin angle is shared by all these functions: with it fixed they are
of one throw each again, so the minimum of the sum is that over the shared angle of the sum of minima.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray

GRIDS = (65, 33, 17)
"""Angles of every throw and shared angle, by how many shared angles are open."""


class ArcBox:
    """Box of throws and shared angles, with the waves e^{i (h theta + m . beta)} at its angles.

    Parameters
    ----------
    orders
        h and m of the waves whose phase counts, shape (waves, 1 + shared angles); of further waves only the size does.
    lower, upper
        Bounds of every throw, then of every shared angle [rad].
    """

    def __init__(self, orders: Array, lower: Array, upper: Array) -> None:
        shared = orders.shape[1] - 1
        self.throws, grid = len(lower) - shared, GRIDS[shared]
        self.angles = lower[:, None] + (upper - lower)[:, None] * np.linspace(0.0, 1.0, grid)
        self._shared = np.array(list(product(*self.angles[self.throws :]))).reshape(grid**shared, shared)
        self._by_throw = np.exp(1j * self.angles[: self.throws, :, None] * orders[:, 0])
        self._by_shared = np.exp(1j * self._shared @ orders[:, 1:].T)
        # between angles a function leaves its chord by no more than the sum of a'' step^2 / 8 over them, and no wave
        # by more than twice its size
        steps = np.square((upper - lower) / (grid - 1)) / 8.0
        curvatures = (
            np.square(orders[:, 0]) * steps[: self.throws, None] + np.square(orders[:, 1:]) @ steps[self.throws :]
        )
        self._chord_errors = np.minimum(curvatures, 2.0)

    def functions(self, waves: ComplexArray, slopes: Array, shared: Array) -> Arcs:
        """Evaluate a separable function on arcs: the windows of throw angles theta and shared angles beta.

        It is the sum over throws of Re sum_j c_j e^{i (h_j theta + m_j . beta)} + s theta, and of sigma . beta.

        Parameters
        ----------
        waves, slopes
            c, shape (throws, waves), and s of every throw.
        shared
            sigma of every shared angle.
        """
        count, size = self._chord_errors.shape[1], np.abs(waves)
        shifted = waves[:, None, :count] * self._by_shared
        values = np.matmul(shifted, self._by_throw.swapaxes(1, 2)).real
        values += slopes[:, None, None] * self.angles[: self.throws, None, :]
        bend = float((size[:, :count] * self._chord_errors).sum() + size[:, count:].sum())
        # minimum over each throw by itself where shared angles are fixed, and what that leaves of the sum
        minima = values.min(axis=2)
        total = minima.sum(axis=0) + self._shared @ shared
        throw_minima = (values + (total - minima)[:, :, None]).min(axis=1)
        cells = total.reshape((self.angles.shape[1],) * len(shared))
        shared_minima = [cells.min(axis=tuple(j for j in range(cells.ndim) if j != k))[None] for k in range(cells.ndim)]
        return Arcs(self.angles, np.concatenate([throw_minima, *shared_minima]), bend)


@dataclass(frozen=True, eq=False)
class Arcs:
    """Minima of a sum of functions of throws over a box of their angles.

    Attributes
    ----------
    angles, values
        Grid of every throw and shared angle, and the minimum of the sum with that angle fixed, shape (angles, grid).
    bend
        Largest fall of the sum between two angles of the grid.
    """

    angles: Array
    values: Array
    bend: float

    @property
    def minimum(self) -> float:
        """Lower bound of the sum."""
        return float(self.values[0].min()) - self.bend

    def cut(self, margin: float) -> tuple[Array, Array] | None:
        """Return bounds of the angles at which the sum may be less than `margin` above its minimum; None if nowhere."""
        # between two angles of the grid both ends bound the sum
        is_open = np.minimum(self.values[:, :-1], self.values[:, 1:]) - self.bend - self.minimum < margin
        if not is_open.any(axis=1).all():
            return None
        first, last = is_open.argmax(axis=1), is_open.shape[1] - 1 - is_open[:, ::-1].argmax(axis=1)
        rows = np.arange(len(is_open))
        return self.angles[rows, first], self.angles[rows, last + 1]
