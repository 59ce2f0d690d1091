"""Response of a design over a speed range, with its peaks found between samples (P23).

Samples stand at equal ratios of speed, at the kinks of limit and time shares, and wherever an order that counts meets
a natural frequency or another critical frequency of the engine. Each sample whose value or share of the limit is higher
than at its neighbours, and high enough to hold the largest one between them, is the middle of a bracket, in which
Brent's method finds the peak.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.speed_ranges.ranges import SpeedRange
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.present.numbers import RPM
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import ResultDetails

SAMPLES, COARSE, BLOCK, FINE = 160, 9, 40, 4000
"""Speeds at equal ratios, those where orders are compared, those evaluated at once, and those of the mean."""
COUNTS, NEAR = 1e-3, 0.6
"""Share of the largest amplitude from which an order counts, and of the highest sample that may hold the peak."""
BRACKET = 1e-9
"""Width of the last bracket, relative to speed."""


class Response:
    """Values of a measure of one design over a speed range.

    Attributes
    ----------
    speeds, values, limits
        Crank speeds in ascending order [rad/s], values and limits there [SI], shape (n,).
    tops
        Indices of the largest value, then of the peaks of value and share of the limit, the highest of either first.
    """

    def __init__(self, problem: Problem, evaluation: Evaluation, span: SpeedRange) -> None:
        self.span, self.measure = span, span.measure_of(problem)
        self._problem, self._evaluation = problem.at(evaluation.fidelity), evaluation
        samples = self._samples()
        known: dict[float, float] = dict(zip(samples.tolist(), self._values(samples.tolist()), strict=True))

        def value(speed: float) -> float:
            if speed not in known:
                (known[speed],) = self._values([speed])
            return known[speed]

        def share(speed: float) -> float:
            return value(speed) / float(span.limits_at(np.array(speed)))

        peaks = set(_peaks(value, samples))
        if span.limit is not None:
            peaks.update(_peaks(share, samples))
        self.speeds, self.values = (np.array(column) for column in zip(*sorted(known.items()), strict=True))
        self.limits = span.limits_at(self.speeds)
        heights = np.maximum(self.values / (self.values.max() or 1.0), self.values / self.limits / (self.ratio or 1.0))
        places = np.searchsorted(self.speeds, list(peaks)).tolist()
        self.tops = list(dict.fromkeys((self.worst, *sorted(places, key=heights.__getitem__, reverse=True))))

    def _samples(self) -> Array:
        low, high, curves = self.span.low, self.span.high, (self.span.limit, self.span.shares)
        orders, sizes = self.amplitudes(np.geomspace(low, high, COARSE))
        largest = sizes.max(axis=0)
        counted = orders[(largest > COUNTS * largest.max()) & (orders > 0.0)]
        frequencies = np.array([f for values in self.frequencies.values() for f in values])
        critical = np.divide.outer(math.tau * frequencies, counted).reshape(-1)
        kinks = [speed for curve in curves if curve is not None for speed in curve[0]]
        samples = np.concatenate([np.geomspace(low, high, SAMPLES)[1:-1], critical, kinks, [low, high]])
        return np.unique(samples[(samples >= low) & (samples <= high)])

    def _evaluated(self, speeds: Sequence[float]) -> Evaluation:
        points = tuple(self.span.at(speeds, [loads.point for loads in self._evaluation.loads]))
        return evaluate(replace(self._problem, points=points), self._evaluation.engine, self._evaluation.samples)

    def _values(self, speeds: Sequence[float]) -> list[float]:
        values: list[float] = []
        for start in range(0, len(speeds), BLOCK):
            evaluation = self._evaluated(speeds[start : start + BLOCK])
            values += [replace(evaluation, loads=(loads,)).value(self.measure) for loads in evaluation.loads]
        if not np.all(np.isfinite(values)):
            speed = RPM * speeds[int(np.argmin(np.isfinite(values)))]
            rule = f"crosses a resonance at {speed:.4g} rpm, and nothing damps it"
            raise ModelError(f"speed range '{self.span.name}' {rule}; give mounts or frame a loss factor or damping")
        return values

    def amplitudes(self, speeds: Array) -> tuple[Array, Array]:
        """Return orders, shape (n,), and the largest amplitude of each at crank speeds [SI], shape (speeds, n)."""
        evaluation = self._evaluated(speeds.tolist())
        signals = [self.measure.signal(loads, evaluation.engine) for loads in evaluation.loads]
        return signals[0].orders, np.array([order_amplitude(one.coefficients).max(axis=1) for one in signals])

    @cached_property
    def frequencies(self) -> Mapping[str, Sequence[float]]:
        """Critical frequencies [Hz] by what they are: on the mounts, and those of parts of extensions."""
        engine = self._evaluation.engine
        on_mounts = mounting_in(engine).modes.frequencies.tolist() if engine.block is not None else []
        parts = [item for extra in engine.extras for item in extra.critical_frequencies(engine).items()]
        return {"natural frequency on the mounts": [f for f in on_mounts if f > 0.0], **dict(parts)}

    @property
    def worst(self) -> int:
        """Index of the largest value."""
        return int(np.argmax(self.values))

    @property
    def tightest(self) -> int:
        """Index of the largest share of the limit."""
        return int(np.argmax(self.values / self.limits))

    @property
    def ratio(self) -> float:
        """Largest value over its limit; zero without a limit."""
        return float(np.max(self.values / self.limits))

    @cached_property
    def strongest(self) -> tuple[float, float]:
        """Order with the largest amplitude at the largest value, and its amplitude [SI]."""
        return self.strongest_at([self.worst])[0]

    def strongest_at(self, indices: Sequence[int]) -> list[tuple[float, float]]:
        """Return the order with the largest amplitude at speeds of these indices, and its amplitude [SI]."""
        orders, sizes = self.amplitudes(self.speeds[[*indices]])
        return [(float(orders[np.argmax(row)]), float(row.max())) for row in sizes]

    @property
    def mean(self) -> float:
        """Mean value over time, with monotone cubics between the speeds [SI]."""
        from scipy.interpolate import PchipInterpolator

        speeds = np.union1d(self.speeds, np.linspace(self.span.low, self.span.high, FINE))
        values = PchipInterpolator(self.speeds, self.values)(speeds)
        weights = np.ones(len(speeds)) if self.span.shares is None else np.interp(speeds, *self.span.shares)
        return float(np.trapezoid(weights * values, speeds) / np.trapezoid(weights, speeds))


@dataclass(frozen=True, eq=False)
class RangeResponses(ResultDetails):
    """Responses over the speed ranges of a problem, of its initial and its final design.

    Attributes
    ----------
    initial, final
        Response over each range.
    rounds
        Count of problems that were solved.
    own_points
        Names of the operating points of the problem file.
    """

    initial: tuple[Response, ...]
    final: tuple[Response, ...]
    rounds: int
    own_points: tuple[str, ...]


def _peaks(height: Callable[[float], float], samples: Array) -> Iterator[float]:
    """Yield the speeds of the peaks that may be the highest, each between the neighbours of a sample [rad/s]."""
    from scipy.optimize import minimize_scalar

    heights = np.array([height(speed) for speed in samples.tolist()])
    padded = np.concatenate([[-math.inf], heights, [-math.inf]])
    is_top = (heights >= padded[:-2]) & (heights >= padded[2:]) & (heights >= NEAR * heights.max())
    for k in np.flatnonzero(is_top).tolist():
        low, high = float(samples[max(k - 1, 0)]), float(samples[min(k + 1, len(samples) - 1)])
        peak = minimize_scalar(lambda s: -height(float(s)), bounds=(low, high), method="bounded",
                                options={"xatol": BRACKET * high})  # fmt: skip
        yield max((float(samples[k]), float(peak.x)), key=height)
