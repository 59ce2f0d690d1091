"""Peaks of run-ups with slopes, and bounds of run-ups over boxes of stiffness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.extensions.run_ups.boxes import RunBoxes, bounds_runs
from laufruhe.extensions.run_ups.peaks import RunPeaks
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import BoxModel


def peaks(problem: Problem, measures: Sequence[Measure], coarser: int, without_stops: bool) -> RunPeaks:
    """Return the peaks of measures of run-ups; `without_stops` omits bump stops, which cost most of the time."""
    if without_stops:
        mounts = (
            mount.mapped(lambda spring: replace(spring, stop_stiffness=0.0, stop_gap=math.inf))
            for mount in problem.engine.mounts
        )
        problem = replace(problem, engine=replace(problem.engine, mounts=tuple(mounts)))
    return RunPeaks(problem, measures, coarser)


def boxes(model: BoxModel, measures: Sequence[Measure]) -> RunBoxes | None:
    """Return the bounds over boxes of stiffness, or None if boxes cannot bound the run-ups."""
    return RunBoxes(model, measures) if bounds_runs(model.problem) else None
