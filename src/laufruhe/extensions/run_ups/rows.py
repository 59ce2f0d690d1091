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
    """Every step of run-up and shut-down.

    Attributes
    ----------
    constants, slopes
        Of every measure, at every step and place, shapes (steps, places, d) and (steps, places, d, n).
    """

    constants: dict[Measure, Array]
    slopes: dict[Measure, Array]

    @classmethod
    def of(cls, problem: Problem, measures: Sequence[Measure]) -> RunRows | None:
        """Of some measures; None where run-ups are not linear in the loads."""
        count = sum(domain.width for domain in domains_of(problem.unbalances))
        found = RunPeaks(problem, measures).rows([np.zeros(count), *np.eye(count)])
        if found is None:
            return None
        constants, *moved = found
        slopes = {m: np.stack([each[m] - bare for each in moved], axis=-1) for m, bare in constants.items()}
        return cls(constants, slopes)

    def worst(self, measure: Measure, x: Array) -> float:
        """The largest length at x."""
        return float(self._lengths(measure, x).max())

    def near(self, measure: Measure, x: Array, height: float) -> NDArray[np.intp]:
        """Of every stretch and place the longest row, of those that come near a height at x, as flat places of rows."""
        sizes = self._lengths(measure, x)
        count = -(-len(sizes) // (2 * STRETCHES))
        found = []
        for start in range(0, len(sizes), count):
            part = sizes[start : start + count]
            tops = part.argmax(axis=0)
            kept = part[tops, np.arange(part.shape[1])] >= NEAR * height
            found.append((start + tops[kept]) * sizes.shape[1] + np.flatnonzero(kept))
        return np.concatenate(found)

    def known(self, measure: Measure, places: NDArray[np.intp]) -> KnownRows:
        """Some of the rows."""
        constant, slope = self.constants[measure], self.slopes[measure]
        d, n = slope.shape[2:]
        return KnownRows(constant.reshape(-1, d)[places], slope.reshape(-1, d, n)[places])

    def _lengths(self, measure: Measure, x: Array) -> Array:
        return np.asarray(np.linalg.norm(self.constants[measure] + self.slopes[measure] @ x, axis=-1))
