"""Whether run-ups are asked about, and what they make of points that a search may start from (E28b)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from laufruhe.load_models.run_peaks import RunPeaks
from laufruhe.machine import Mount
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

COARSER = 4
"""Times as long as those of the last word steps of a search are."""


def asks_runs(problem: Problem) -> bool:
    """Whether run-ups are asked about, beyond those whose rows are known."""
    return bool(run_measures(problem))


def run_measures(problem: Problem) -> tuple[Measure, ...]:
    """Measures of run-ups that are minimised or limited, beyond those whose rows are known."""
    asked = (measure for measure in problem.measures if measure.channel.is_checked)
    return tuple(dict.fromkeys(measure for measure in asked if measure not in problem.known_rows))


class RunLook:
    """What run-ups make of points that a search may start from; bump stops, which cost too much for that, left out."""

    def __init__(self, problem: Problem) -> None:
        mounts = tuple(mount.each(_without_stop) for mount in problem.engine.mounts)
        free = replace(problem, engine=replace(problem.engine, mounts=mounts))
        self._problem, self._measures = problem, run_measures(problem)
        self._peaks = RunPeaks(free, self._measures, COARSER) if self._measures else None

    @property
    def asked(self) -> bool:
        """Whether any are asked about."""
        return self._peaks is not None and self._peaks.is_known

    def at(self, x: Array) -> tuple[float, float]:
        """Relative excess over their limits, and their share of the objective."""
        if self._peaks is None:
            return 0.0, 0.0
        ends = np.cumsum(self._peaks.counts)[:-1]
        most = dict(zip(self._measures, map(np.max, np.split(self._peaks.values(x), ends)), strict=True))
        problem = self._problem
        over = (float(most[x.measure]) / (x.maximum or 1.0) - 1.0 for x in problem.limits if x.measure in most)
        terms = (term.weight * float(most[term.measure]) for term in problem.objective if term.measure in most)
        return sum(max(each, 0.0) for each in over), sum(terms)


def _without_stop(spring: Mount) -> Mount:
    return replace(spring, stop_stiffness=0.0, stop_gap=math.inf)
