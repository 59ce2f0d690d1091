"""Simulated measures in a smooth program: peaks computed by an external model (E28b)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import peaks_of, simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import decision_vector, domains_of
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector
from laufruhe.solvers.smooth.nonlinear import ExternalValues


class SimulatedVariables:
    """Peaks of the simulated measures of a problem, as symbols.

    Parameters
    ----------
    arguments
        Open numbers of mounts and columns of unbalances, as expressions.
    constraints
        Constraints of the program, to which those of the peaks are added.
    coarser
        Time step relative to that of the final evaluation.
    """

    def __init__(self, problem: Problem, arguments: Any, constraints: ConstraintCollector, coarser: int) -> None:
        self._arguments, self._constraints = arguments, constraints
        measures, self._peaks = simulated_measures(problem), peaks_of(problem, coarser)
        self.symbols, self._symbols_of, self._sizes = ca.MX(0, 1), dict[Measure, Any](), dict[Measure, float]()
        if self._peaks is None:
            return
        if not self._peaks.is_known:
            raise ModelError("a simulation of so many turns can be evaluated, but not optimised; make it shorter")
        self.symbols = ca.MX.sym("simulated", sum(self._peaks.counts))
        ends = np.cumsum(self._peaks.counts)
        columns = decision_vector(domains_of(problem.unbalances))
        initial = self.peaks_at([d.real_start for d in problem.mount_decisions], columns)
        for measure, end, count in zip(measures, ends.tolist(), self._peaks.counts, strict=True):
            self._symbols_of[measure] = self.symbols[end - count : end]
            maximum = float(np.max(initial[end - count : end]))
            self._sizes[measure] = maximum if 0.0 < maximum < math.inf else 1.0

    @property
    def external(self) -> ExternalValues | None:
        """External model of the peaks; None without simulated measures."""
        return None if self._peaks is None else ExternalValues(self.symbols, self._arguments, self._peaks)

    def peaks_at(self, mounts: Sequence[float], columns: Array) -> Array:
        """Return the peaks at numbers of the mounts and columns of the unbalances, shape (peaks,)."""
        return np.zeros(0) if self._peaks is None else self._peaks.values(np.concatenate([mounts, columns]))

    def minimum(self, measure: Measure) -> Any:
        """Return a new variable for the largest peak of a simulated measure: it is at least every peak (E22)."""
        size, collector = self._sizes[measure], self._constraints.named(measure.name)
        peaks = self._symbols_of[measure] / size
        largest = collector.head(ca.mmax(peaks))
        collector.hold(peaks - largest)
        return size * largest

    def limit(self, limit: Limit, tight: float) -> None:
        """Add the constraints that every peak of a limited measure is at most the share `tight` of the limit."""
        unit = limit.maximum or 1.0
        side = ((limit, "at most"), tight / unit)
        self._constraints.add(
            self._symbols_of[limit.measure] / unit, -math.inf, tight * limit.maximum / unit, limit.name, maximum=side
        )
