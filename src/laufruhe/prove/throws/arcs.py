"""Bounds of sums of waves over arcs of throw angles (S27, S30).

With given multipliers, the objective with its limits has a lower bound. It is a constant plus, for every throw, a
function Re sum_h c_h e^{i h theta} + s theta of the throw angle theta. The minimum of this function between two bounds
is taken on a grid, less its largest fall between two angles. All these functions share an open bank or split-pin angle.
With the shared angle fixed, each depends on one throw only. The minimum of the sum is therefore the minimum over the
shared angle of the sum of minima.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray

GRIDS = (65, 33, 17)
"""Number of grid angles of every throw and shared angle, for no, one and two shared angles."""


class ArcBox:
    """Box of throw angles theta and shared angles beta, with the waves e^{i (h theta + m . beta)} on its grid.

    Parameters
    ----------
    orders
        Multiples h and m of the waves to evaluate, shape (waves, 1 + shared angles). Further waves count by size.
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
        # between two grid angles a function leaves its chord by at most the sum of a'' step^2 / 8 over the angles, and
        # a wave by at most twice its size
        steps = np.square((upper - lower) / (grid - 1)) / 8.0
        curvatures = (
            np.square(orders[:, 0]) * steps[: self.throws, None] + np.square(orders[:, 1:]) @ steps[self.throws :]
        )
        self._chord_errors = np.minimum(curvatures, 2.0)

    def functions(self, waves: ComplexArray, slopes: Array, shared: Array) -> Arcs:
        """Return the minimum of a function of all angles over the box, also with each angle fixed at each grid angle.

        The function of throw angles theta and shared angles beta is the sum over throws of
        Re sum_j c_j e^{i (h_j theta + m_j . beta)} + s theta, plus sigma . beta.

        Parameters
        ----------
        waves, slopes
            Coefficients c, shape (throws, waves), and slope s of every throw.
        shared
            Slope sigma of every shared angle.
        """
        count, size = self._chord_errors.shape[1], np.abs(waves)
        shifted = waves[:, None, :count] * self._by_shared
        values = np.matmul(shifted, self._by_throw.swapaxes(1, 2)).real
        values += slopes[:, None, None] * self.angles[: self.throws, None, :]
        bend = float((size[:, :count] * self._chord_errors).sum() + size[:, count:].sum())
        # with the shared angles fixed: minimum over each throw by itself, and their sum
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
        """Lower bound of the sum over the box."""
        return float(self.values[0].min()) - self.bend

    def cut(self, margin: float) -> tuple[Array, Array] | None:
        """Return the lowest and highest angles at which the function may be less than `margin` above `minimum`.

        The result has two arrays of angles [rad]; it is None if there are no such angles.
        """
        # between two angles of the grid both ends bound the sum
        is_open = np.minimum(self.values[:, :-1], self.values[:, 1:]) - self.bend - self.minimum < margin
        if not is_open.any(axis=1).all():
            return None
        first, last = is_open.argmax(axis=1), is_open.shape[1] - 1 - is_open[:, ::-1].argmax(axis=1)
        rows = np.arange(len(is_open))
        return self.angles[rows, first], self.angles[rows, last + 1]
