"""Largest force, travel and twist of run-up and shut-down over boxes of stiffness, bounded from below (E65)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from laufruhe.extensions.run_ups.dampers import Maps, mapped, pairs_of
from laufruhe.extensions.run_ups.matrices import Rows, RunMatrices
from laufruhe.extensions.run_ups.moments import RunMoments
from laufruhe.extensions.run_ups.motion import FARTHEST, REACH, MotionEquations, RunMotion, Steps, equations, motion_of
from laufruhe.extensions.run_ups.peaks import RunPeaks, parabola_tops
from laufruhe.extensions.run_ups.stopped_run import QUICKEST, quickest
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array, Indices, Mask
from laufruhe.physics.time_model import time_model
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_norms import LinearBound
from laufruhe.prove.mounts.box_response import BoxModel

# long steps that a run has at least
LEAST_STEPS = 60
# share of a limit of travel that a stop is beyond it
MARGIN = 1e-3


class RunBoxes:
    """Bounds of run-ups over boxes of stiffness, where nothing else is open (E65).

    Parameters
    ----------
    model
        Model of the boxes.
    measures
        Measures of run-ups.
    """

    def __init__(self, model: BoxModel, measures: Sequence[Measure]) -> None:
        self._model, self._matrices, self.measures = model, RunMatrices(model), tuple(measures)
        self._peaks = RunPeaks(model.problem, measures)
        self._rows: dict[Measure, Rows] = {measure: self._matrices.maps_of(measure) for measure in measures}

    @property
    def cost(self) -> int:
        """Return the work of one box, in numbers."""
        sides, n = len(self._model.lower), 2 * self._matrices.size
        columns = 1 + sides + len(pairs_of(sides))
        return len(self._rows) * sum(run.sweep.count // run.times for run in self._runs) * columns * n

    @cached_property
    def _scale(self) -> float:
        above = self._model.upper - self._model.lower
        return float(np.sqrt(np.linalg.eigvalsh(self._matrices.motion.position.at(above[None])[0])[-1]))

    @cached_property
    def _runs(self) -> tuple[RunMoments, ...]:
        drag = float(np.linalg.norm(self._matrices.base.damping, 2))
        runs = []
        for sweep, wrenches in zip(self._peaks.sweeps, self._peaks.wrenches, strict=True):
            maximum = min(REACH / ((self._scale + drag) * sweep.step), sweep.count / LEAST_STEPS)
            runs.append(RunMoments(sweep, wrenches, self._matrices.base.load, max(int(maximum), 1)))
        return tuple(runs)

    def under(self, measure: Measure, lower: Array, upper: Array, mask: Mask | None = None) -> LinearBound:
        """Return linear functions under a measure on boxes, shapes (boxes, open numbers), or on those of a mask.

        The rest is infinite where no bound is known.
        """
        of = self._equations(lower, upper)
        step = max(run.step for run in self._runs)
        known = of.known & (np.linalg.norm(of.matrix, 2, axis=(-2, -1)) * step <= FARTHEST)
        which = np.flatnonzero(known if mask is None else known & mask)
        out = LinearBound(np.zeros(len(lower)), np.zeros_like(lower), np.full(len(lower), np.inf), np.ones_like(lower))
        if len(which):
            of = of if len(which) == len(lower) else self._equations(lower[which], upper[which])
            bounds = self._under(measure, of)
            for name in ("value", "slopes", "rest", "bends"):
                getattr(out, name)[which] = getattr(bounds, name)
        return out

    def _equations(self, lower: Array, upper: Array) -> MotionEquations:
        return equations(self._model, self._matrices, self._scale, lower, upper)

    def _under(self, measure: Measure, of: MotionEquations) -> LinearBound:
        maps_of, d = self._rows[measure]
        maps = mapped(maps_of, of.above, of.halves, of.turn, of.roots)
        looks = [_Look(of, run, maps, d).under() for run in self._runs]
        bounds = [np.nan_to_num(one.minimum, nan=-np.inf) for one in looks]
        best, pick = np.argmax(bounds, axis=0), np.arange(of.count)
        parts = ("value", "slopes", "rest", "bends")
        return LinearBound(*(np.array([getattr(one, part) for one in looks])[best, pick] for part in parts))


def bounds_runs(problem: Problem) -> bool:
    """Return whether boxes bound the run-ups of a problem: they go in steps, and no allowed design meets a stop."""
    measures = simulated_measures(problem)
    peaks = RunPeaks(problem, measures)
    return bool(measures) and peaks.is_known and (not peaks.is_stopped or _stays_off_stops(problem, peaks))


def _stays_off_stops(problem: Problem, peaks: RunPeaks) -> bool:
    """Return whether no design that keeps the limits meets a stop, so that its run-up is that without stops.

    Limits hold travel under every gap. In steps in which stops alone turn no motion by more than half a radian, they
    take back a 24th of what goes beyond their gaps: a design that meets one is seen beyond it, and is not allowed.
    """
    travels = [measure for measure in peaks.measures if measure.unit == "m"]
    limits = (limit for limit in problem.limits if limit.measure in travels)
    maximum = min((limit.maximum for limit in limits), default=math.inf)
    model = time_model(mounting_in(problem.engine))
    gaps = model.gaps[model.stops > 0.0]
    firm = any(quickest(model) * sweep.step > QUICKEST for sweep in peaks.sweeps)
    return not firm and maximum * (1.0 + MARGIN) < float(gaps.min())


def _tops(squares: Array) -> Array:
    tops = parabola_tops(squares[..., :-2], squares[..., 1:-1], squares[..., 2:])
    return np.concatenate([tops, squares[..., -1:]], axis=-1)


class _Look:
    """Bound what one run reaches on boxes.

    Parameters
    ----------
    maps, d
        Maps from motion to the signal of a measure, d rows a place.
    """

    def __init__(self, of: MotionEquations, run: RunMoments, maps: Maps, d: int) -> None:
        self._of, self._run, self._maps, self._d = of, run, maps, d
        self._steps = Steps(of, run.step)

    def under(self) -> LinearBound:
        """The best of all moments and places, of steps of which one ends where motion at the middle is largest."""
        steps = [self._run.ending_at(int(place)) for place in self._peaks()]
        count = min(one.count for one in steps)
        moments = np.stack([one.moments[..., :count].reshape(-1, count) for one in steps])
        pushes, highest = (np.stack([getattr(one, k)[:count] for one in steps]) for k in ("pushes", "highest"))
        return self._of_motion(motion_of(self._steps, moments, pushes, highest))

    def _peaks(self) -> Indices:
        """Short steps at which motion at the middles is largest: among long ones, then about the largest of these."""
        of, run = self._of, self._run
        steps = run.ending_at(0)
        rows = steps.moments.reshape(-1, steps.count)
        moments = np.broadcast_to(rows, (of.count, *rows.shape))
        middle = self._steps.middle(moments)
        top = 1 + _tops(self._lengths(middle) ** 2).max(axis=1).argmax(axis=1)
        boxes, start = np.arange(of.count), run.times * (top - 1)
        places = start[:, None] + np.arange(2 * run.times)
        short = Steps(of, run.sweep.step, orders=False)
        short_moments = run.short(places).reshape(of.count, 2 * run.times, -1)
        z = middle[boxes, :, top - 1][..., None]
        sizes = [self._lengths(z)[..., 0].max(axis=1)]
        for k in range(2 * run.times):
            z = short.moves[0] @ z + short.loads[0] @ short_moments[:, k, :, None]
            sizes.append(self._lengths(z)[..., 0].max(axis=1))
        places = start + np.arange(2 * run.times + 1)[:, None]
        return np.asarray(start + np.where(places <= run.sweep.count, sizes, 0.0).argmax(axis=0))

    def _rows(self, position: Array, rate: Array) -> Array:
        return np.concatenate([position / self._of.scale, rate], axis=-1)

    def _places(self, rows: Array) -> Array:
        return rows.reshape(*rows.shape[:-2], -1, self._d, rows.shape[-1])

    def _lengths(self, z: Array) -> Array:
        seen = self._rows(self._maps.position, self._maps.rate) @ z
        return np.asarray(np.linalg.norm(self._places(seen), axis=-2))

    def _of_motion(self, motion: RunMotion) -> LinearBound:
        maps, pairs = self._maps, self._steps.pairs
        at_middle, by = self._rows(maps.position, maps.rate), self._rows(maps.positions, maps.rates)
        value = at_middle @ motion.middle
        first = at_middle[:, None] @ motion.first + by @ motion.middle[:, None]
        bends = self._rows(np.zeros_like(maps.bends), maps.bends)
        second = at_middle[:, None] @ motion.second + bends @ motion.middle[:, None]
        for number, (j, k) in enumerate(pairs):
            second[:, number] += by[:, j] @ motion.first[:, k]
            if j != k:
                second[:, number] += by[:, k] @ motion.first[:, j]
        rows = self._places(value)
        size = np.linalg.norm(rows, axis=-2)
        along = rows / np.where(size > 0.0, size, 1.0)[..., None, :]
        rest = self._gains(along) * motion.left[:, None] + self._further(motion, by)
        slopes, bent = (np.einsum("bpdt,bspdt->bspt", along, self._places(order)) for order in (first, second))
        alike = np.array([j == k for j, k in pairs])[:, None, None]
        # a square is not under zero
        bent = np.where(alike, np.maximum(-bent, 0.0), np.abs(bent))
        return self._best(size, slopes, bent, rest)

    def _best(self, size: Array, slopes: Array, bent: Array, rest: Array) -> LinearBound:
        """Return the highest bound of all places and times."""
        bound = size - np.abs(slopes).sum(axis=1) - bent.sum(axis=1) - rest
        known = np.nan_to_num(bound, nan=-np.inf)
        boxes = np.arange(len(size))
        place, time = np.unravel_index(known.reshape(len(size), -1).argmax(axis=1), bound.shape[1:])
        size, rest = (array[boxes, place, time] for array in (size, rest))
        slopes, bent = (array[boxes, :, place, time] for array in (slopes, bent))
        moved = np.linalg.norm(self._of.first, axis=(-2, -1))
        share = moved / np.maximum(moved.sum(axis=1), 1e-300)[:, None]
        pull = np.abs(slopes) + share * np.minimum(rest, size)[:, None]
        for number, (j, k) in enumerate(self._steps.pairs):
            for side in {j, k}:
                pull[:, side] += bent[:, number]
        return LinearBound(size, slopes, rest + bent.sum(axis=1), pull)

    def _gains(self, along: Array) -> Array:
        # largest signal of a motion of energy one along directions (boxes, places, d, times), without d
        maps, of = self._maps, self._of
        softest = np.swapaxes(np.linalg.inv(np.linalg.cholesky(of.softest)), 1, 2)

        def sizes(matrices: Array) -> Array:
            return np.asarray(np.linalg.norm(self._places(matrices), axis=(-2, -1)))

        middle = np.linalg.norm(np.einsum("bpdt,bpdn->bpnt", along, self._places(maps.position @ softest)), axis=2)
        position = middle + sizes(maps.positions @ softest[:, None]).sum(axis=1)[..., None]
        moving = sizes(maps.rate) + sizes(maps.rates).sum(axis=1) + sizes(maps.bent)
        return np.asarray(np.hypot(position, moving[..., None]))

    def _further(self, motion: RunMotion, by: Array) -> Array:
        # largest signal of both orders beyond the second, shape (boxes, places, times)
        maps, n = self._maps, self._of.softest.shape[-1]
        if maps.is_constant:
            return np.zeros(1)
        signals = (self._places(by[:, j, None] @ motion.second) for j in range(by.shape[1]))
        total = sum(np.linalg.norm(order, axis=-2).sum(axis=1) for order in signals)
        rates = [np.abs(order[..., n:, :]) for order in (motion.middle, motion.first, motion.second)]
        bends = np.abs(maps.bends).sum(axis=1) @ (rates[1].sum(axis=1) + rates[2].sum(axis=1))
        rest = maps.rest @ (rates[0] + rates[1].sum(axis=1) + rates[2].sum(axis=1))
        return np.asarray(total + np.linalg.norm(self._places(bends + rest), axis=-2))
