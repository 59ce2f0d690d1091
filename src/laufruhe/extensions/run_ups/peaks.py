"""Peaks of run-up and shut-down over open mounts and unbalances, from the exact model, with slopes (E28b).

A peak is the largest length of a measure in one interval of a run at one place. It is smooth between designs at which
another time step takes over; its slope is that of the length at its own time step.
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

STEP, MIN_SHARE = 1e-5, 0.1
"""Relative step of a difference quotient, and its smallest scale as a share of the range of an open number."""


class RunPeaks:
    """Peaks of measures of run-ups, one measure after the other, on elastic mounts with open numbers and unbalances.

    Steps are `coarser` times as long as in a final evaluation. Above 1 peaks are interpolated between steps.
    """

    def __init__(self, problem: Problem, measures: Sequence[Measure], coarser: int = 1) -> None:
        engine_alone = replace(problem, objective=(), limits=(), ranks=(), origin=None, known_rows={})
        self._problem, self.measures, self._coarser = engine_alone, tuple(measures), coarser
        self._decisions, self._domains = problem.mount_decisions, domains_of(problem.unbalances)
        # cache of the last design, which a search evaluates several times in succession
        self._last: tuple[bytes, Array, Array] = (b"", np.zeros(0), np.zeros((0, 0)))
        self._known: tuple[bytes, Array] = (b"", np.zeros(0))

    def __reduce__(self) -> tuple[type[Self], tuple[Problem, tuple[Measure, ...], int]]:
        # copies compute loads over time again
        return type(self), (self._problem, self.measures, self._coarser)

    @property
    def is_known(self) -> bool:
        """True if the runs have few enough time steps to be computed."""
        return bool(self.sweeps)

    @property
    def counts(self) -> tuple[int, ...]:
        """Count of peaks of each measure."""
        places = {False: 1, True: len(self._problem.engine.mounts)}
        return tuple(2 * STRETCHES * places[measure.channel.unit != "rad"] for measure in self.measures)

    def values(self, point: Array) -> Array:
        """Return the local maxima of run-up measures for a design, shape (peaks,); NaN if its time steps fail.

        `point` has the open numbers of mounts, then the unbalances.
        """
        if self.has_stops:
            # with stops the differences cost little more than one design
            return self._at(point)[1]
        key = point.tobytes()
        if key == self._last[0]:
            return self._last[1]
        if key != self._known[0]:
            (signals,) = self._signals([point])
            self._known = key, self._unknown if signals is None else _peaks(signals, self._coarser > 1)
        return self._known[1]

    def slopes(self, point: Array) -> Array:
        """Return the derivatives of the peaks by differences at their time steps, shape (peaks, numbers)."""
        return self._at(point)[2]

    def rows(self, points: Sequence[Array]) -> list[dict[Measure, Array]] | None:
        """Return the signals of measures at each time step and place of both runs, for each design.

        A point has the open numbers of mounts, then the unbalances.

        Return None if signals are not linear in the loads, as with bump stops.
        """
        designs = [] if self.has_stops else self._signals(points)
        resolved = [run_signals for run_signals in designs if run_signals is not None]
        if not resolved or len(resolved) < len(points):
            return None
        triples = (zip(self.measures, signals[::2], signals[1::2], strict=True) for signals in resolved)
        return [{measure: np.concatenate(runs) for measure, *runs in each_measure} for each_measure in triples]

    @cached_property
    def has_stops(self) -> bool:
        """True if a spring has a bump stop within a finite gap."""
        springs = (spring for _, spring in every_spring(self._problem.engine.mounts))
        return any(spring.stop_stiffness > 0.0 and spring.stop_gap < math.inf for spring in springs)

    @property
    def _unknown(self) -> Array:
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
        base, *shifted = self._signals(ends)
        if base is None or any(shifted_signals is None for shifted_signals in shifted):
            return self._unknown, np.full((sum(self.counts), len(point)), np.nan)
        peak_steps, interpolates = [steps_of_part for _, steps_of_part in _tops(base)], self._coarser > 1
        rows = []
        for signals in shifted:
            parts = zip(signals or [], peak_steps, strict=True)
            rows.append(np.concatenate([_lengths(_squares(part), steps, interpolates) for part, steps in parts]))
        pairs = zip(rows[::2], rows[1::2], widths, strict=True)
        return _peaks(base, interpolates), np.column_stack([(high - low) / width for low, high, width in pairs])

    def _sides(self, point: Array, k: int) -> tuple[Array, Array]:
        """Return two designs for a difference quotient: open number k is a small step lower and higher."""
        count = len(self._decisions)
        if k < count:
            decision = self._decisions[k]
            low, high = decision.lower, decision.upper
        else:
            high = next(d.scale for d in self._domains if d.columns.start <= k - count < d.columns.stop)
            low = -high
        step = STEP * min(high - low, max(abs(float(point[k])), MIN_SHARE * (high - low)))
        ends = (point.copy(), point.copy())
        for end, value in zip(ends, (point[k] - step, point[k] + step), strict=True):
            end[k] = float(np.clip(value, low, high)) if k < count else value
        return ends

    def _signals(self, points: Sequence[Array]) -> list[list[Array] | None]:
        """Return the signals of measures in both runs for each design; None if its time steps fail."""
        count, runs = len(self._decisions), []
        models = [self._model(point[:count]) for point in points]
        for sweep, (base, columns) in zip(self.sweeps, self._wrenches, strict=True):
            pairs = (zip(point[count:], columns, strict=True) for point in points)
            wrenches = [sum((u * loads for u, loads in shares), base) for shares in pairs]
            runs.append(responses_to(models, sweep, wrenches))
        return [
            None if any(response is None for response in responses) else [
                signal_of(measure, response)
                for measure in self.measures for response in responses if response is not None
            ]
            for responses in zip(*runs, strict=True)
        ]  # fmt: skip

    def _model(self, numbers: Array) -> TimeModel | None:
        engine = self._problem.engine
        if engine.block is None:
            raise TypeError("a run-up needs elastic mounts")
        try:
            design = self._problem.numbers(numbers.tolist(), self._decisions).engine(engine)
            return time_model(elastic_mounting(engine.block, design.mounts))
        except (ModelError, np.linalg.LinAlgError):
            return None

    @cached_property
    def sweeps(self) -> tuple[Sweep, ...]:
        """Time steps of run-up and shut-down; () if they are too many."""
        run = self._problem.engine.extra(Run)
        if run is None:
            raise TypeError("the problem has no run-up")
        arguments = ((0.0, run.speed, run.up), (run.speed, 0.0, run.down))
        sweeps = [sweep_of(*sweep, self._coarser) for sweep in arguments]
        return tuple(sweep for sweep in sweeps if sweep is not None) if None not in sweeps else ()

    @property
    def wrenches(self) -> tuple[Array, ...]:
        """Wrenches in both runs without open unbalances."""
        return tuple(base for base, _ in self._wrenches)

    @cached_property
    def _wrenches(self) -> list[tuple[Array, list[Array]]]:
        """Wrenches in both runs without open unbalances, and changes by one unit of each column (E28)."""
        problem, unbalances = self._problem, self._problem.unbalances
        run = problem.engine.extra(Run)
        assert run is not None
        units = [(k, direction) for k, domain in enumerate(self._domains) for direction in domain.set.directions]
        values = [[0.0] * len(unbalances)] + [
            [direction if j == k else 0.0 for j in range(len(unbalances))] for k, direction in units
        ]
        point = point_of(run, problem.points)
        engine_alone = replace(problem.engine, extras=())
        designs = [
            problem.numbers(value, unbalances).engine(engine_alone) if unbalances else engine_alone for value in values
        ]
        loads = [run_loads(design, point, problem.fidelity) for design in designs]
        wrenches = []
        for sweep in self.sweeps:
            base, *unit_wrenches = (
                sweep.wrenches([(part.orders, part.coefficients) for part in parts if part is not None])
                for parts in loads
            )
            wrenches.append((base, [unit_wrench - base for unit_wrench in unit_wrenches]))
        return wrenches


def signal_of(measure: Measure, response: RunResponse) -> Array:
    """Return the signal whose largest length is the measure, shape (times, places, d)."""
    channel = measure.channel
    if not isinstance(channel, RunChannel):
        raise TypeError(f"{measure.name} is no measure of a run-up")
    signal: Array = getattr(response, channel.part)
    return signal


def _peaks(parts: Sequence[Array], between: bool) -> Array:
    return np.concatenate([_lengths(squares, peak_steps, between) for squares, peak_steps in _tops(parts)])


def _squares(vectors: Array) -> Array:
    return np.asarray(np.einsum("sma,sma->sm", vectors, vectors))


def _tops(parts: Sequence[Array]) -> list[tuple[Array, NDArray[np.intp]]]:
    # for each part its squares, and the step of the maximum by interval and place, shape (intervals, places)
    tops_of_parts = []
    for vectors in parts:
        squares = _squares(vectors)
        count, places = len(squares) // STRETCHES, np.arange(squares.shape[1])
        step_in_interval = squares[:-1].reshape(STRETCHES, count, -1).argmax(axis=1)
        tops = step_in_interval + count * np.arange(STRETCHES)[:, None]
        # the last step of a run belongs to its last interval
        tops[-1] = np.where(squares[-1] > squares[tops[-1], places], len(squares) - 1, tops[-1])
        tops_of_parts.append((squares, tops))
    return tops_of_parts


def _lengths(squares: Array, tops: NDArray[np.intp], between: bool) -> Array:
    places = np.arange(squares.shape[1])
    middle = squares[tops, places]
    if between:
        before, after = (squares[np.clip(tops + k, 0, len(squares) - 1), places] for k in (-1, 1))
        # no interpolation at both ends of a run
        inside = (tops > 0) & (tops < len(squares) - 1)
        middle = np.where(inside, parabola_tops(before, middle, after), middle)
    return np.sqrt(np.maximum(middle, 0.0)).reshape(-1)


def parabola_tops(before: Array, middle: Array, after: Array) -> Array:
    """Return the maximum of the parabola through three values at equal steps; `middle` if it lies outside them."""
    curvature, difference = before - 2.0 * middle + after, after - before
    inside = np.abs(difference) < -2.0 * curvature
    return np.asarray(middle - np.where(inside, difference**2 / (8.0 * np.where(inside, curvature, -1.0)), 0.0))
