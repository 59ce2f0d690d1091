"""Rows of run-up and shut-down, affine in what loads are affine in (E28a)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.run_ups.peaks import RunPeaks
from laufruhe.extensions.run_ups.runs import STRETCHES
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import domains_of
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import KnownRows, Problem

NEAR = 0.98
"""Share of a limit from which a row counts."""


@dataclass(frozen=True, eq=False)
class RunRows:
    """Rows of every step of run-up and shut-down, affine in the unbalances.

    Attributes
    ----------
    constants, slopes
        Constants and slopes of every measure, shapes (steps, places, d) and (steps, places, d, n).
    """

    constants: dict[Measure, Array]
    slopes: dict[Measure, Array]

    @classmethod
    def from_problem(cls, problem: Problem, measures: Sequence[Measure]) -> RunRows | None:
        """Return the rows of measures; None where run-ups are not linear in the loads."""
        count = sum(domain.width for domain in domains_of(problem.unbalances))
        signals = RunPeaks(problem, measures).rows([np.zeros(count), *np.eye(count)])
        if signals is None:
            return None
        constants, *moved = signals
        slopes = {m: np.stack([signal[m] - constant for signal in moved], axis=-1) for m, constant in constants.items()}
        return cls(constants, slopes)

    def worst(self, measure: Measure, x: Array) -> float:
        """Return the largest length at x."""
        return float(self._lengths(measure, x).max())

    def near(self, measure: Measure, x: Array, height: float) -> NDArray[np.intp]:
        """Return flat places of the longest row of every stretch and place that comes near a height at x."""
        sizes = self._lengths(measure, x)
        count = -(-len(sizes) // (2 * STRETCHES))
        places = []
        for start in range(0, len(sizes), count):
            part = sizes[start : start + count]
            tops = part.argmax(axis=0)
            near = part[tops, np.arange(part.shape[1])] >= NEAR * height
            places.append((start + tops[near]) * sizes.shape[1] + np.flatnonzero(near))
        return np.concatenate(places)

    def known(self, measure: Measure, places: NDArray[np.intp]) -> KnownRows:
        """Return some of the rows."""
        constant, slope = self.constants[measure], self.slopes[measure]
        d, n = slope.shape[2:]
        return KnownRows(constant.reshape(-1, d)[places], slope.reshape(-1, d, n)[places])

    def _lengths(self, measure: Measure, x: Array) -> Array:
        return np.asarray(np.linalg.norm(self.constants[measure] + self.slopes[measure] @ x, axis=-1))
