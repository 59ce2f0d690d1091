"""Simulated measures in a smooth program: peaks that the exact model gives from outside (E28b)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import peaks_of, simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import domains_of, vector_of
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.gathered import Gathered
from laufruhe.solvers.smooth.nonlinear import ExternalNumbers


class SimulatedVariables:
    """Peaks of the simulated measures of a problem, as symbols.

    Parameters
    ----------
    asked
        Open numbers of mounts and columns of unbalances, as expressions.
    coarser
        Times as long as those of the last word steps are.
    """

    def __init__(self, problem: Problem, asked: Any, held: Gathered, coarser: int) -> None:
        self._asked, self._held = asked, held
        measures, self._peaks = simulated_measures(problem), peaks_of(problem, coarser)
        self.symbols, self._own, self._sizes = ca.MX(0, 1), dict[Measure, Any](), dict[Measure, float]()
        if self._peaks is None:
            return
        if not self._peaks.is_known:
            raise ModelError("a simulation of so many turns is checked, not designed for; make it shorter")
        self.symbols = ca.MX.sym("simulated", sum(self._peaks.counts))
        ends = np.cumsum(self._peaks.counts)
        columns = vector_of(domains_of(problem.unbalances))
        given = self.at([d.start_number for d in problem.mount_decisions], columns)
        for measure, end, count in zip(measures, ends.tolist(), self._peaks.counts, strict=True):
            self._own[measure] = self.symbols[end - count : end]
            maximum = float(np.max(given[end - count : end]))
            self._sizes[measure] = maximum if 0.0 < maximum < math.inf else 1.0

    @property
    def external(self) -> ExternalNumbers | None:
        """Outside source of the peaks; None without simulated measures."""
        return None if self._peaks is None else ExternalNumbers(self.symbols, self._asked, self._peaks)

    def at(self, mounts: Sequence[float], columns: Array) -> Array:
        """Peaks of a design."""
        return np.zeros(0) if self._peaks is None else self._peaks.values(np.concatenate([mounts, columns]))

    def minimum(self, measure: Measure) -> Any:
        """The largest peak, as a variable that none exceeds (E22)."""
        size, named = self._sizes[measure], self._held.named(measure.name)
        peaks = self._own[measure] / size
        top = named.head(ca.mmax(peaks))
        named.hold(peaks - top)
        return size * top

    def limit(self, limit: Limit, tight: float) -> None:
        """Constrain every peak to at most a share of its limit."""
        unit = limit.maximum or 1.0
        side = ((limit, "at most"), tight / unit)
        self._held.add(
            self._own[limit.measure] / unit, -math.inf, tight * limit.maximum / unit, limit.name, maximum=side
        )
