"""Measured orders of a run (J1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import ComplexArray
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured orders of one quantity in one run.

    Attributes
    ----------
    name
        Name of the file.
    problem
        Problem of the run, whose open numbers are estimated.
    channel
        Quantity that was measured.
    points, orders
        Index of the operating point, and order of crank speed, of each row.
    values
        Complex amplitudes c of Re c e^{i k phi}, shape (rows, places, d) [SI]; nan if not measured (C8).
    deviation
        Standard deviation of real and imaginary parts [SI]; None if it is unknown.
    column_names
        Name of each place with its direction, as in headings, shape (places, d).
    """

    name: str
    problem: Problem
    channel: LoadChannel
    points: tuple[int, ...]
    orders: tuple[float, ...]
    values: ComplexArray
    deviation: float | None
    column_names: tuple[tuple[str, ...], ...]

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """Mask of the amplitudes that were measured, shape (rows, places, d)."""
        return np.isfinite(self.values)

    def predicted(self, evaluation: Evaluation) -> ComplexArray:
        """Return the amplitudes of a design, shape (rows, places, d) [SI]."""
        signals = evaluation.signals(self.channel)
        return np.stack([signals[k].at(order) for k, order in zip(self.points, self.orders, strict=True)])
