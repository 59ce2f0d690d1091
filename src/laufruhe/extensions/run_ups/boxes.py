"""Simulation of runs: their peaks, and lower bounds of these over boxes of stiffness (E65)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.extensions.run_ups.dampers import Maps, mapped, pairs_of
from laufruhe.extensions.run_ups.matrices import Rows, RunMatrices
from laufruhe.extensions.run_ups.moments import RunMoments
from laufruhe.extensions.run_ups.motion import FARTHEST, REACH, MotionEquations, RunMotion, Steps, motion_of
from laufruhe.extensions.run_ups.peaks import RunPeaks, parabola_tops
from laufruhe.extensions.run_ups.stopped_run import QUICKEST, quickest
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.numerics.arrays import Array, Indices, Mask
from laufruhe.physics.time_model import time_model
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_norms import PARTS, LinearBound, choose
from laufruhe.prove.mounts.box_response import BoxModel

# fewest long steps of a run
MIN_STEPS = 60
# smallest distance of a stop beyond the limit of travel, as a share of the limit
MARGIN = 1e-3


class RunBoxes:
    """Lower bounds of measures of run-ups over boxes of stiffness, if nothing else is open (E65)."""

    def __init__(self, model: BoxModel, measures: Sequence[Measure]) -> None:
        self._model, self._matrices, self.measures = model, RunMatrices(model), tuple(measures)
        self._peaks = RunPeaks(model.problem, measures)
        self._rows: dict[Measure, Rows] = {measure: self._matrices.maps_of(measure) for measure in measures}

    @property
    def cost(self) -> int:
        """Work of one box, as a count of the numbers that its motion has."""
        sides, n = len(self._model.lower), 2 * self._matrices.base.size
        columns = 1 + sides + len(pairs_of(sides))
        return len(self._rows) * sum(run.sweep.count // run.times for run in self._runs) * columns * n

    @cached_property
    def _scale(self) -> float:
        above = self._model.upper - self._model.lower
        return float(np.sqrt(np.linalg.eigvalsh(self._matrices.motion.position.at(above[None])[0])[-1]))

    @cached_property
    def _runs(self) -> tuple[RunMoments, ...]:
        damping = float(np.linalg.norm(self._matrices.base.damping, 2))
        runs = []
        for sweep, wrenches in zip(self._peaks.sweeps, self._peaks.wrenches, strict=True):
            maximum = min(REACH / ((self._scale + damping) * sweep.step), sweep.count / MIN_STEPS)
            runs.append(RunMoments(sweep, wrenches, self._matrices.base.load, max(int(maximum), 1)))
        return tuple(runs)

    def under(self, measure: Measure, lower: Array, upper: Array, mask: Mask | None = None) -> LinearBound:
        """Return linear lower bounds of a run-up measure on boxes of mounts, shape (boxes, open numbers).

        `mask` selects some of the boxes. The remainder is infinite if no bound is known.
        """
        box_equations = self._equations(lower, upper)
        step = max(run.step for run in self._runs)
        is_known = box_equations.known & (np.linalg.norm(box_equations.matrix, 2, axis=(-2, -1)) * step <= FARTHEST)
        indices = np.flatnonzero(is_known if mask is None else is_known & mask)
        result = LinearBound(
            np.zeros(len(lower)), np.zeros_like(lower), np.full(len(lower), np.inf), np.ones_like(lower)
        )
        if len(indices):
            if len(indices) < len(lower):
                box_equations = self._equations(lower[indices], upper[indices])
            bounds = self._under(measure, box_equations)
            for name in PARTS:
                getattr(result, name)[indices] = getattr(bounds, name)
        return result

    def _equations(self, lower: Array, upper: Array) -> MotionEquations:
        return MotionEquations(self._model, self._matrices, self._scale, lower, upper)

    def _under(self, measure: Measure, box_equations: MotionEquations) -> LinearBound:
        maps_of, d = self._rows[measure]
        maps = mapped(maps_of, box_equations.above, box_equations.halves, box_equations.turn, box_equations.roots)
        run_bounds = [_RunBounds(box_equations, run, maps, d).under() for run in self._runs]
        return choose(run_bounds, np.argmax([run_bound.minimum for run_bound in run_bounds], axis=0))


def peaks(problem: Problem, measures: Sequence[Measure], coarser: int, without_stops: bool) -> RunPeaks:
    """Return a function object for the peaks of run-up measures, without bump stops if `without_stops`."""
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


def bounds_runs(problem: Problem) -> bool:
    """Return True if boxes bound the run-ups: steps resolve them, and no feasible design meets a stop."""
    measures = simulated_measures(problem)
    peaks = RunPeaks(problem, measures)
    return bool(measures) and peaks.is_known and (not peaks.has_stops or _stays_off_stops(problem, peaks))


def _stays_off_stops(problem: Problem, peaks: RunPeaks) -> bool:
    # Limits of travel must lie below each gap. If stops alone turn no motion by more than half a radian in a step, they
    # push back at most a 24th of the travel beyond their gaps. So a design that meets a stop also exceeds the limit in
    # steps, and the run-up of all others is that without stops.
    travels = [measure for measure in peaks.measures if measure.unit == "m"]
    limits = (limit for limit in problem.limits if limit.measure in travels)
    maximum = min((limit.maximum for limit in limits), default=math.inf)
    model = time_model(mounting_in(problem.engine))
    gaps = model.stops.gaps[model.stops.stiffness > 0.0]
    is_too_stiff = any(quickest(model) * sweep.step > QUICKEST for sweep in peaks.sweeps)
    return not is_too_stiff and maximum * (1.0 + MARGIN) < float(gaps.min())


class _RunBounds:
    """Lower bounds of one run on boxes, from maps of its motion to a signal with `d` rows for each place."""

    def __init__(self, box_equations: MotionEquations, run: RunMoments, maps: Maps, d: int) -> None:
        self._equations, self._run, self._maps, self._d = box_equations, run, maps, d
        self._steps = Steps(box_equations, run.step)

    def under(self) -> LinearBound:
        """Return the best lower bound of the largest signal of the run: on each box, that at one time and one mount.

        The long time steps are placed so that one of them ends where the design in the middle of the box has its peak.
        """
        steps = [self._run.ending_at(int(place)) for place in self._peaks()]
        count = min(len(long_steps.impulses) for long_steps in steps)
        moments = np.stack([long_steps.moments[..., :count].reshape(-1, count) for long_steps in steps])
        impulses, peak_loads = (
            np.stack([getattr(long_steps, k)[:count] for long_steps in steps]) for k in ("impulses", "peak_loads")
        )
        return self._of_motion(motion_of(self._steps, moments, impulses, peak_loads))

    def _peaks(self) -> Indices:
        """Return the index of the short time step with the largest signal, for the middle design of each box.

        It lies near the long step with the largest signal.
        """
        box_equations, run = self._equations, self._run
        steps = run.ending_at(0)
        rows = steps.moments.reshape(-1, len(steps.impulses))
        moments = np.broadcast_to(rows, (box_equations.count, *rows.shape))
        middle = self._steps.middle(moments)
        squares = self._lengths(middle) ** 2
        tops = parabola_tops(squares[..., :-2], squares[..., 1:-1], squares[..., 2:])
        peak_step = 1 + np.concatenate([tops, squares[..., -1:]], axis=-1).max(axis=1).argmax(axis=1)
        boxes, start = np.arange(box_equations.count), run.times * (peak_step - 1)
        places = start[:, None] + np.arange(2 * run.times)
        short = Steps(box_equations, run.sweep.step, orders=False)
        short_moments = run.short(places).reshape(box_equations.count, 2 * run.times, -1)
        z = middle[boxes, :, peak_step - 1][..., None]
        sizes = [self._lengths(z)[..., 0].max(axis=1)]
        for k in range(2 * run.times):
            z = short.moves[0] @ z + short.loads[0] @ short_moments[:, k, :, None]
            sizes.append(self._lengths(z)[..., 0].max(axis=1))
        places = start + np.arange(2 * run.times + 1)[:, None]
        return np.asarray(start + np.where(places <= run.sweep.count, sizes, 0.0).argmax(axis=0))

    def _rows(self, position: Array, rate: Array) -> Array:
        return np.concatenate([position / self._equations.scale, rate], axis=-1)

    def _places(self, rows: Array) -> Array:
        return rows.reshape(*rows.shape[:-2], -1, self._d, rows.shape[-1])

    def _lengths(self, z: Array) -> Array:
        signal = self._rows(self._maps.position, self._maps.rate) @ z
        return np.asarray(np.linalg.norm(self._places(signal), axis=-2))

    def _of_motion(self, motion: RunMotion) -> LinearBound:
        maps, pairs = self._maps, self._steps.pairs
        at_middle, slopes_of_maps = self._rows(maps.position, maps.rate), self._rows(maps.positions, maps.rates)
        value = at_middle @ motion.middle
        first = at_middle[:, None] @ motion.first + slopes_of_maps @ motion.middle[:, None]
        bends = self._rows(np.zeros_like(maps.bends), maps.bends)
        second = at_middle[:, None] @ motion.second + bends @ motion.middle[:, None]
        for number, (j, k) in enumerate(pairs):
            second[:, number] += slopes_of_maps[:, j] @ motion.first[:, k]
            if j != k:
                second[:, number] += slopes_of_maps[:, k] @ motion.first[:, j]
        rows = self._places(value)
        size = np.linalg.norm(rows, axis=-2)
        directions = rows / np.where(size > 0.0, size, 1.0)[..., None, :]
        remainder = self._gains(directions) * motion.remainder[:, None] + self._higher_orders(motion, slopes_of_maps)
        slopes, second_terms = (
            np.einsum("bpdt,bspdt->bspt", directions, self._places(order)) for order in (first, second)
        )
        is_square = np.array([j == k for j, k in pairs])[:, None, None]
        # squares are not negative
        second_terms = np.where(is_square, np.maximum(-second_terms, 0.0), np.abs(second_terms))
        return self._best(size, slopes, second_terms, remainder)

    def _best(self, size: Array, slopes: Array, second_order: Array, remainder: Array) -> LinearBound:
        """Return the largest of the linear lower bounds at all places and times.

        `size` is the length of the signal at the middle of the box, shape (boxes, places, times). The other arrays are
        its first and second orders by open numbers, and the bound of its remainder.
        """
        bound = size - np.abs(slopes).sum(axis=1) - second_order.sum(axis=1) - remainder
        finite_bound = np.nan_to_num(bound, nan=-np.inf)
        boxes = np.arange(len(size))
        place, time = np.unravel_index(finite_bound.reshape(len(size), -1).argmax(axis=1), bound.shape[1:])
        size, remainder = (array[boxes, place, time] for array in (size, remainder))
        slopes, second_order = (array[boxes, :, place, time] for array in (slopes, second_order))
        changes = np.linalg.norm(self._equations.first, axis=(-2, -1))
        share = changes / np.maximum(changes.sum(axis=1), 1e-300)[:, None]
        scores = np.abs(slopes) + share * np.minimum(remainder, size)[:, None]
        for number, (j, k) in enumerate(self._steps.pairs):
            for side in {j, k}:
                scores[:, side] += second_order[:, number]
        return LinearBound(size, slopes, remainder + second_order.sum(axis=1), scores)

    def _gains(self, directions: Array) -> Array:
        # largest signal of a motion with energy 1 along directions (boxes, places, d, times), as (boxes, places, times)
        maps, box_equations = self._maps, self._equations
        softest = np.swapaxes(np.linalg.inv(np.linalg.cholesky(box_equations.softest)), 1, 2)

        def sizes(matrices: Array) -> Array:
            return np.asarray(np.linalg.norm(self._places(matrices), axis=(-2, -1)))

        middle = np.linalg.norm(np.einsum("bpdt,bpdn->bpnt", directions, self._places(maps.position @ softest)), axis=2)
        position = middle + sizes(maps.positions @ softest[:, None]).sum(axis=1)[..., None]
        rate_part = sizes(maps.rate) + sizes(maps.rates).sum(axis=1) + sizes(maps.beyond_linear)
        return np.asarray(np.hypot(position, rate_part[..., None]))

    def _higher_orders(self, motion: RunMotion, slopes_of_maps: Array) -> Array:
        # largest signal of third and fourth order, shape (boxes, places, times)
        maps, n = self._maps, self._equations.softest.shape[-1]
        if maps.is_constant:
            return np.zeros(1)
        signals = (self._places(slopes_of_maps[:, j, None] @ motion.second) for j in range(slopes_of_maps.shape[1]))
        total = sum(np.linalg.norm(order, axis=-2).sum(axis=1) for order in signals)
        rates = [np.abs(order[..., n:, :]) for order in (motion.middle, motion.first, motion.second)]
        bends = np.abs(maps.bends).sum(axis=1) @ (rates[1].sum(axis=1) + rates[2].sum(axis=1))
        remainder = maps.remainder @ (rates[0] + rates[1].sum(axis=1) + rates[2].sum(axis=1))
        return np.asarray(total + np.linalg.norm(self._places(bends + remainder), axis=-2))
