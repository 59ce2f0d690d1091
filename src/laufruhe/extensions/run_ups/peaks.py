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
from laufruhe.extensions.run_ups.linear_run import Response, Sweep
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
        With a run, on elastic mounts; numbers of mounts and unbalances are open.
    coarser
        Times as long as those of the last word steps are. Peaks are then sought between them too.
    """

    def __init__(self, problem: Problem, measures: Sequence[Measure], coarser: int = 1) -> None:
        bare = replace(problem, objective=(), limits=(), ranks=(), origin=None, known_rows={})
        self._problem, self.measures, self._coarser = bare, tuple(measures), coarser
        self._decisions, self._domains = problem.mount_decisions, domains_of(problem.unbalances)
        # a search asks about one design several times in succession
        self._last: tuple[bytes, Array, Array] = (b"", np.zeros(0), np.zeros((0, 0)))
        self._told: tuple[bytes, Array] = (b"", np.zeros(0))

    def __reduce__(self) -> tuple[type[Self], tuple[Problem, tuple[Measure, ...], int]]:
        # loads over time are made anew where they are needed
        return type(self), (self._problem, self.measures, self._coarser)

    @property
    def is_known(self) -> bool:
        """Whether steps follow the run."""
        return bool(self.sweeps)

    @property
    def counts(self) -> tuple[int, ...]:
        """Peaks of every measure."""
        places = {False: 1, True: len(self._problem.engine.mounts)}
        return tuple(2 * STRETCHES * places[measure.channel.unit != "rad"] for measure in self.measures)

    def values(self, asked: Array) -> Array:
        """Peaks where open numbers of mounts, then columns of unbalances, have these values; no numbers where none."""
        if self.is_stopped:
            # designs side by side cost hardly more than one
            return self._at(asked)[1]
        key = asked.tobytes()
        if key == self._last[0]:
            return self._last[1]
        if key != self._told[0]:
            (found,) = self._found([asked])
            self._told = key, self._none if found is None else _peaks(found, self._coarser > 1)
        return self._told[1]

    def slopes(self, asked: Array) -> Array:
        """Of those peaks, shape (peaks, numbers), by differences of the motion at their moments."""
        return self._at(asked)[2]

    def rows(self, points: Sequence[Array]) -> list[dict[Measure, Array]] | None:
        """Of designs what measures are the lengths of, at every step and place of both runs, one after the other.

        None where that is not linear in the loads, as on bump stops.
        """
        found = [] if self.is_stopped else self._found(points)
        told = [both for both in found if both is not None]
        if not told or len(told) < len(points):
            return None
        pairs = [dict(zip(self.measures, zip(both[::2], both[1::2], strict=True), strict=True)) for both in told]
        return [{measure: np.concatenate(runs) for measure, runs in each.items()} for each in pairs]

    @cached_property
    def is_stopped(self) -> bool:
        """Whether any bump stop can be met."""
        springs = (spring for _, spring in every_spring(self._problem.engine.mounts))
        return any(spring.stop_stiffness > 0.0 and spring.stop_gap < math.inf for spring in springs)

    @property
    def _none(self) -> Array:
        return np.full(sum(self.counts), np.nan)

    def _at(self, asked: Array) -> tuple[bytes, Array, Array]:
        """Peaks and slopes of the design that was asked about last."""
        key = asked.tobytes()
        if self._last[0] != key:
            self._last = (key, *self._sloped(asked))
        return self._last

    def _sloped(self, asked: Array) -> tuple[Array, Array]:
        ends, widths = [asked], []
        for k in range(len(asked)):
            low, high = self._sides(asked, k)
            ends += [low, high]
            widths.append(high[k] - low[k])
        base, *others = self._found(ends)
        if base is None or any(other is None for other in others):
            return self._none, np.full((sum(self.counts), len(asked)), np.nan)
        tops, fine = [top for _, top in _tops(base)], self._coarser > 1
        rows = [
            np.concatenate([_lengths(_squares(part), top, fine) for part, top in zip(other or [], tops, strict=True)])
            for other in others
        ]
        pairs = zip(rows[::2], rows[1::2], widths, strict=True)
        return _peaks(base, fine), np.column_stack([(high - low) / width for low, high, width in pairs])

    def _sides(self, asked: Array, k: int) -> tuple[Array, Array]:
        """Two points about one, within the bounds of a number of the mounts."""
        count = len(self._decisions)
        if k < count:
            own = self._decisions[k]
            low, high = own.lower, own.upper
        else:
            high = next(d.scale for d in self._domains if d.columns.start <= k - count < d.columns.stop)
            low = -high
        step = STEP * min(high - low, max(abs(float(asked[k])), LEAST_SHARE * (high - low)))
        ends = (asked.copy(), asked.copy())
        for end, moved in zip(ends, (asked[k] - step, asked[k] + step), strict=True):
            end[k] = float(np.clip(moved, low, high)) if k < count else moved
        return ends

    def _found(self, points: Sequence[Array]) -> list[list[Array] | None]:
        """What measures are the lengths of, at every step and place of both runs; None where no steps follow it."""
        models = [self._model(point[: len(self._decisions)]) for point in points]
        wrenches = [
            [sum((u * own for u, own in zip(point[len(self._decisions) :], by, strict=True)), bare) for point in points]
            for bare, by in self._wrenches
        ]
        runs = [responses_to(models, sweep, own) for sweep, own in zip(self.sweeps, wrenches, strict=True)]
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
        """Of run-up and shut-down; none where they take too many steps."""
        run = self._problem.engine.extra(Run)
        if run is None:
            raise TypeError("there is no run-up")
        told = ((0.0, run.speed, run.up), (run.speed, 0.0, run.down))
        found = [sweep_of(*each, self._coarser) for each in told]
        return tuple(each for each in found if each is not None) if None not in found else ()

    @property
    def wrenches(self) -> tuple[Array, ...]:
        """Of both runs those of the bare design."""
        return tuple(bare for bare, _ in self._wrenches)

    @cached_property
    def _wrenches(self) -> list[tuple[Array, list[Array]]]:
        """Of both runs: those of the bare design, and of one unit of every column (E28)."""
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
            bare, *others = (
                sweep.wrenches([(part.orders, part.coefficients) for part in own if part is not None]) for own in loads
            )
            out.append((bare, [other - bare for other in others]))
        return out


def signal_of(measure: Measure, response: Response) -> Array:
    """Return what a measure is the largest length of, shape (times, places, d)."""
    channel = measure.channel
    if not isinstance(channel, RunChannel):
        raise TypeError(f"{measure.name} is not of a run-up")
    return channel.part(response)


def _peaks(parts: Sequence[Array], between: bool) -> Array:
    return np.concatenate([_lengths(squares, top, between) for squares, top in _tops(parts)])


def _squares(vectors: Array) -> Array:
    """Squared lengths at the start, and at the end of every step, at every place, shape (steps + 1, places)."""
    return np.asarray(np.einsum("sma,sma->sm", vectors, vectors))


def _tops(parts: Sequence[Array]) -> list[tuple[Array, NDArray[np.intp]]]:
    """Of every part its squares, and the step of the largest in every stretch and place, shape (stretches, places)."""
    found = []
    for vectors in parts:
        squares = _squares(vectors)
        count, places = len(squares) // STRETCHES, np.arange(squares.shape[1])
        inside = squares[:-1].reshape(STRETCHES, count, -1).argmax(axis=1)
        tops = inside + count * np.arange(STRETCHES)[:, None]
        # the end of a run stands in its last stretch
        tops[-1] = np.where(squares[-1] > squares[tops[-1], places], len(squares) - 1, tops[-1])
        found.append((squares, tops))
    return found


def _lengths(squares: Array, tops: NDArray[np.intp], between: bool) -> Array:
    """Lengths at some steps; between steps the top of the parabola through three, flat."""
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
