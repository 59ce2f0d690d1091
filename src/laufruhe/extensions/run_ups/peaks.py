"""Peaks of run-up and shut-down over open mounts and unbalances, as the exact model has them, with slopes (E28b).

A stretch of a run has its largest length of each measure at every place. Between designs at which another moment takes
over, that length is smooth, and its slope is that of the motion at its own moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.channels import RunChannel
from laufruhe.extensions.run_ups.linear_run import RunResponse, Sweep
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import STRETCHES, point_of, run_loads, sweep_of
from laufruhe.extensions.run_ups.stopped_run import responses_to
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.time_model import TimeModel, time_model
from laufruhe.problem.decision import domains_of
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

STEP, LEAST_SHARE = 1e-5, 0.1
"""Of a slope, as a share of a number or of this much of its range."""


class RunPeaks:
    """Peaks of some measures, those of one after those of the other.

    Parameters
    ----------
    problem
        Problem with a run on elastic mounts; numbers of mounts and unbalances are open.
    coarser
        Times as long as those of the last word steps are. Peaks are then sought between them too.
    """

    def __init__(self, problem: Problem, measures: Sequence[Measure], coarser: int = 1) -> None:
        engine_alone = replace(problem, objective=(), limits=(), ranks=(), origin=None, known_rows={})
        self._problem, self.measures, self._coarser = engine_alone, tuple(measures), coarser
        self._decisions, self._domains = problem.mount_decisions, domains_of(problem.unbalances)
        # a search asks about one design several times in succession
        self._last: tuple[bytes, Array, Array] = (b"", np.zeros(0), np.zeros((0, 0)))
        self._known: tuple[bytes, Array] = (b"", np.zeros(0))

    def __reduce__(self) -> tuple[type[Self], tuple[Problem, tuple[Measure, ...], int]]:
        # loads over time are made anew where they are needed
        return type(self), (self._problem, self.measures, self._coarser)

    @property
    def is_known(self) -> bool:
        """Return whether steps follow the run."""
        return bool(self.sweeps)

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of peaks of every measure."""
        places = {False: 1, True: len(self._problem.engine.mounts)}
        return tuple(2 * STRETCHES * places[measure.channel.unit != "rad"] for measure in self.measures)

    def values(self, point: Array) -> Array:
        """Return the peaks at open numbers of mounts, then columns of unbalances; not numbers where there are none."""
        if self.is_stopped:
            # designs side by side cost hardly more than one
            return self._at(point)[1]
        key = point.tobytes()
        if key == self._last[0]:
            return self._last[1]
        if key != self._known[0]:
            (signals,) = self._signals([point])
            self._known = key, self._none if signals is None else _peaks(signals, self._coarser > 1)
        return self._known[1]

    def slopes(self, point: Array) -> Array:
        """Return the derivatives of the peaks by differences of the motion at their moments, shape (peaks, numbers)."""
        return self._at(point)[2]

    def rows(self, points: Sequence[Array]) -> list[dict[Measure, Array]] | None:
        """Return the signals of measures at every step and place of both runs, for each point; None on bump stops.

        None where that is not linear in the loads, as on bump stops.
        """
        designs = [] if self.is_stopped else self._signals(points)
        known = [both for both in designs if both is not None]
        if not known or len(known) < len(points):
            return None
        pairs = [dict(zip(self.measures, zip(both[::2], both[1::2], strict=True), strict=True)) for both in known]
        return [{measure: np.concatenate(runs) for measure, runs in pair.items()} for pair in pairs]

    @cached_property
    def is_stopped(self) -> bool:
        """Return whether any bump stop can be met."""
        springs = (spring for _, spring in every_spring(self._problem.engine.mounts))
        return any(spring.stop_stiffness > 0.0 and spring.stop_gap < math.inf for spring in springs)

    @property
    def _none(self) -> Array:
        return np.full(sum(self.counts), np.nan)

    def _at(self, point: Array) -> tuple[bytes, Array, Array]:
        key = point.tobytes()
        if self._last[0] != key:
            self._last = (key, *self._sloped(point))
        return self._last

    def _sloped(self, point: Array) -> tuple[Array, Array]:
        ends, widths = [point], []
        for k in range(len(point)):
            low, high = self._sides(point, k)
            ends += [low, high]
            widths.append(high[k] - low[k])
        base, *others = self._signals(ends)
        if base is None or any(other is None for other in others):
            return self._none, np.full((sum(self.counts), len(point)), np.nan)
        tops, fine = [top for _, top in _tops(base)], self._coarser > 1
        rows = [
            np.concatenate([_lengths(_squares(part), top, fine) for part, top in zip(other or [], tops, strict=True)])
            for other in others
        ]
        pairs = zip(rows[::2], rows[1::2], widths, strict=True)
        return _peaks(base, fine), np.column_stack([(high - low) / width for low, high, width in pairs])

    def _sides(self, point: Array, k: int) -> tuple[Array, Array]:
        """Two points about one, within the bounds of a number of the mounts."""
        count = len(self._decisions)
        if k < count:
            decision = self._decisions[k]
            low, high = decision.lower, decision.upper
        else:
            high = next(d.scale for d in self._domains if d.columns.start <= k - count < d.columns.stop)
            low = -high
        step = STEP * min(high - low, max(abs(float(point[k])), LEAST_SHARE * (high - low)))
        ends = (point.copy(), point.copy())
        for end, moved in zip(ends, (point[k] - step, point[k] + step), strict=True):
            end[k] = float(np.clip(moved, low, high)) if k < count else moved
        return ends

    def _signals(self, points: Sequence[Array]) -> list[list[Array] | None]:
        """Return the signals of measures in both runs for each point; None where no steps follow it."""
        models = [self._model(point[: len(self._decisions)]) for point in points]
        wrenches = [
            [
                sum((u * loads for u, loads in zip(point[len(self._decisions) :], by, strict=True)), base)
                for point in points
            ]
            for base, by in self._wrenches
        ]
        runs = [responses_to(models, sweep, loads) for sweep, loads in zip(self.sweeps, wrenches, strict=True)]
        return [
            None if any(response is None for response in both) else [
                signal_of(measure, response) for measure in self.measures for response in both if response is not None
            ]
            for both in zip(*runs, strict=True)
        ]  # fmt: skip

    def _model(self, numbers: Array) -> TimeModel | None:
        engine = self._problem.engine
        if engine.block is None:
            raise TypeError("a run-up needs elastic mounts")
        try:
            moved = self._problem.numbers(numbers.tolist(), self._decisions).engine(engine)
            return time_model(elastic_mounting(engine.block, moved.mounts))
        except (ModelError, np.linalg.LinAlgError):
            return None

    @cached_property
    def sweeps(self) -> tuple[Sweep, ...]:
        """Steps of run-up and shut-down; empty where these are too many."""
        run = self._problem.engine.extra(Run)
        if run is None:
            raise TypeError("there is no run-up")
        ways = ((0.0, run.speed, run.up), (run.speed, 0.0, run.down))
        sweeps = [sweep_of(*way, self._coarser) for way in ways]
        return tuple(way for way in sweeps if way is not None) if None not in sweeps else ()

    @property
    def wrenches(self) -> tuple[Array, ...]:
        """Wrenches of the bare design in both runs."""
        return tuple(base for base, _ in self._wrenches)

    @cached_property
    def _wrenches(self) -> list[tuple[Array, list[Array]]]:
        """Return for both runs the wrenches of the bare design, and of one unit of every column (E28)."""
        problem, opened = self._problem, self._problem.unbalances
        run = problem.engine.extra(Run)
        assert run is not None
        units = [(k, way) for k, domain in enumerate(self._domains) for way in domain.set.directions]
        values = [[0.0] * len(opened)] + [[way if j == k else 0.0 for j in range(len(opened))] for k, way in units]
        point = point_of(run, problem.points)
        plain = replace(problem.engine, bearings=(), flywheel=None, extras=())
        designs = [problem.numbers(value, opened).engine(plain) if opened else plain for value in values]
        loads = [run_loads(design, point, problem.fidelity) for design in designs]
        out = []
        for sweep in self.sweeps:
            base, *others = (
                sweep.wrenches([(part.orders, part.coefficients) for part in parts if part is not None])
                for parts in loads
            )
            out.append((base, [other - base for other in others]))
        return out


def signal_of(measure: Measure, response: RunResponse) -> Array:
    """Return what a measure is the largest length of, shape (times, places, d)."""
    channel = measure.channel
    if not isinstance(channel, RunChannel):
        raise TypeError(f"{measure.name} is not of a run-up")
    return channel.part(response)


def _peaks(parts: Sequence[Array], between: bool) -> Array:
    return np.concatenate([_lengths(squares, top, between) for squares, top in _tops(parts)])


def _squares(vectors: Array) -> Array:
    return np.asarray(np.einsum("sma,sma->sm", vectors, vectors))


def _tops(parts: Sequence[Array]) -> list[tuple[Array, NDArray[np.intp]]]:
    # for each part its squares, and the step of the largest by stretch and place, shape (stretches, places)
    tops_of_parts = []
    for vectors in parts:
        squares = _squares(vectors)
        count, places = len(squares) // STRETCHES, np.arange(squares.shape[1])
        inside = squares[:-1].reshape(STRETCHES, count, -1).argmax(axis=1)
        tops = inside + count * np.arange(STRETCHES)[:, None]
        # the end of a run stands in its last stretch
        tops[-1] = np.where(squares[-1] > squares[tops[-1], places], len(squares) - 1, tops[-1])
        tops_of_parts.append((squares, tops))
    return tops_of_parts


def _lengths(squares: Array, tops: NDArray[np.intp], between: bool) -> Array:
    places = np.arange(squares.shape[1])
    middle = squares[tops, places]
    if between:
        before, after = (squares[np.clip(tops + k, 0, len(squares) - 1), places] for k in (-1, 1))
        # at both ends of a run there is nothing to be between
        inside = (tops > 0) & (tops < len(squares) - 1)
        middle = np.where(inside, parabola_tops(before, middle, after), middle)
    return np.sqrt(np.maximum(middle, 0.0)).reshape(-1)


def parabola_tops(before: Array, middle: Array, after: Array) -> Array:
    """Top of the parabola through three values at equal steps, the middle one where it does not stand between them."""
    bend, lean = before - 2.0 * middle + after, after - before
    inside = np.abs(lean) < -2.0 * bend
    return np.asarray(middle - np.where(inside, lean**2 / (8.0 * np.where(inside, bend, -1.0)), 0.0))
