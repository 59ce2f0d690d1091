"""Rows of run-up and shut-down, affine in the unbalances (E28a)."""

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
"""Share of a limit above which a row joins the program."""


@dataclass(frozen=True, eq=False)
class RunRows:
    """Rows of each step of run-up and shut-down, affine in the unbalances.

    Attributes
    ----------
    constants, slopes
        By measure, shapes (steps, places, d) and (steps, places, d, n).
    """

    constants: dict[Measure, Array]
    slopes: dict[Measure, Array]

    @classmethod
    def from_problem(cls, problem: Problem, measures: Sequence[Measure]) -> RunRows | None:
        """Return the rows of measures; None if run-ups are not linear in the loads."""
        count = sum(domain.width for domain in domains_of(problem.unbalances))
        signals = RunPeaks(problem, measures).rows([np.zeros(count), *np.eye(count)])
        if signals is None:
            return None
        constants, *unit_signals = signals
        slopes = {
            measure: np.stack([signal[measure] - constant for signal in unit_signals], axis=-1)
            for measure, constant in constants.items()
        }
        return cls(constants, slopes)

    def worst(self, measure: Measure, x: Array) -> float:
        """Return the largest length of a row at unbalances `x`, shape (n,)."""
        return float(self._lengths(measure, x).max())

    def near(self, measure: Measure, x: Array, height: float) -> NDArray[np.intp]:
        """Return flat indices of the longest row of each interval and place, if above NEAR times `height` at `x`."""
        sizes = self._lengths(measure, x)
        interval_length = -(-len(sizes) // (2 * STRETCHES))
        places = []
        for start in range(0, len(sizes), interval_length):
            interval = sizes[start : start + interval_length]
            longest = interval.argmax(axis=0)
            is_near = interval[longest, np.arange(interval.shape[1])] >= NEAR * height
            places.append((start + longest[is_near]) * sizes.shape[1] + np.flatnonzero(is_near))
        return np.concatenate(places)

    def known(self, measure: Measure, places: NDArray[np.intp]) -> KnownRows:
        """Return the rows with these flat indices."""
        constant, slope = self.constants[measure], self.slopes[measure]
        d, n = slope.shape[2:]
        return KnownRows(constant.reshape(-1, d)[places], slope.reshape(-1, d, n)[places])

    def _lengths(self, measure: Measure, x: Array) -> Array:
        return np.asarray(np.linalg.norm(self.constants[measure] + self.slopes[measure] @ x, axis=-1))
