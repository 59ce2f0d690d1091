"""Evaluation of one design by the exact model: loads at every operating point, and measures of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, lengths
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.mount_forces import CycleMeasures
from laufruhe.physics.mounting import mounting_of, travel_of
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import MOUNT_FORCE, LoadChannel, NumberChannel
from laufruhe.problem.loads import EvaluatedDesign, PointLoads
from laufruhe.problem.measure import Limit, Measure, Rows, load_rows, mass_rows
from laufruhe.problem.problem import Problem

BETWEEN = NORMS["maximum"].refinement
"""Factor on the number of samples for maxima (M6)."""
FINE_SAMPLES = 5760
"""Number of samples over the cycle at which a mean counts as exact (P7)."""


@dataclass(frozen=True, eq=False)
class Evaluation(EvaluatedDesign):
    """Loads and measures of one design.

    Attributes
    ----------
    samples
        Number of samples over the cycle at which measures are taken.
    resonance
        Description of an undamped resonance; loads and travel of the orders concerned are then infinite.
    """

    samples: int
    resonance: str = ""
    _values: dict[Measure, Sequence[float]] = field(default_factory=dict, init=False, repr=False)
    _place_measures: dict[tuple[int, LoadChannel], list[CycleMeasures]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def mount_names(self) -> list[str]:
        """Names of the mounts in the order of the engine."""
        return [mount.name for mount in self.engine.mounts]

    def rows(self, measure: Measure, samples: int | None = None, kink_angles: Sequence[Array] | None = None) -> Rows:
        """Return the vectors (rows) of a measure of loads or masses; the value of the measure is their norm.

        `samples` is the number of samples over the cycle, by default that of the evaluation. `kink_angles` has the
        angles at which slopes jump, at each operating point [rad], by default those of the signals.
        """
        if not measure.is_load:
            return mass_rows(measure, self.engine.rotors, self.engine.slider_cranks)
        signals = with_common_base(self.engine.cycle.base_order, self.signals(measure.load))
        points = [loads.point for loads in self.loads]
        return load_rows(measure, points, signals, self.engine, samples or self.samples, kink_angles)

    def signals(self, channel: LoadChannel) -> list[Spectrum]:
        """Return the spectrum of a channel at each operating point, shape (n, places, d)."""
        return [channel.signal(loads) for loads in self.loads]

    def values(self, measure: Measure) -> Sequence[float]:
        """Return all numbers of a measure [SI], its value first; results are cached."""
        if measure not in self._values:
            self._values[measure] = self._computed(measure)
        return self._values[measure]

    def _computed(self, measure: Measure) -> Sequence[float]:
        if isinstance(measure.channel, NumberChannel):
            return measure.channel.values(measure, self)
        if not measure.is_load:
            return (self.rows(measure).value,)
        signals = self.signals(measure.load)
        if measure.norm.refinement == 1:
            signals = [signal.series for signal in signals]
        # signals that repeat within the cycle need one period only
        base = self.engine.cycle.base_order
        periodic, samples = one_period(base, signals, measure.norm.refinement * self.samples)
        with np.errstate(invalid="ignore" if self.resonance else None):
            value = load_rows(measure, [loads.point for loads in self.loads], periodic, self.engine, samples).value
        return (value if math.isfinite(value) or not self.resonance else math.inf,)

    def value(self, measure: Measure) -> float:
        """Return the value of a measure [SI]; infinite on an undamped resonance."""
        return self.values(measure)[0]

    def check_limit(self, limit: Limit) -> LimitCheck:
        """Return value and violation of a limit for this design (E15)."""
        # a shaft that is not built has no place to limit
        missing = math.inf if limit.maximum == math.inf else max(limit.minimum, 0.0)
        pairs = ((value, *limit.slack(value)) for value in self.values(limit.measure) or (missing,))
        value, slack, edge, side = min(pairs, key=lambda pair: pair[1])
        return LimitCheck(value, edge, side, -slack)

    def violation(self, limits: Sequence[Limit]) -> float:
        """Return the largest relative violation of the limits, negative if all have slack; zero without limits."""
        return max((self.check_limit(limit).violation for limit in limits), default=0.0)


@dataclass(frozen=True)
class LimitCheck:
    """Value of a measure compared with its limit.

    Attributes
    ----------
    value
        Value of the measure [SI]; of several, such as natural frequencies, the one with the smallest slack.
    edge
        Bound of the side of the limit with the smallest slack [SI].
    side
        Sense of that side: "at most" or "at least".
    violation
        Violation relative to the bound; negative if the limit is satisfied with slack.
    """

    value: float
    edge: float
    side: str
    violation: float


def fine_samples(samples: int) -> int:
    """Return the smallest multiple of `samples`, at least twice, that reaches `FINE_SAMPLES`."""
    return samples * max(2, math.ceil(FINE_SAMPLES / samples))


def with_fine_sampling(evaluation: Evaluation) -> Evaluation:
    """Return the evaluation with enough samples for exact means; few samples may overestimate a mean (P7)."""
    return replace(evaluation, samples=fine_samples(evaluation.samples))


def with_more_samples(problem: Problem, factor: int) -> Problem:
    """Return the problem with `factor` times as many samples; the samples of the gas stay."""
    fidelity = problem.fidelity
    return problem.at(replace(fidelity, samples=factor * fidelity.samples, gas_samples=fidelity.gas_steps))


def with_default_sampling(problem: Problem) -> Problem:
    """Return the problem with at least the default number of samples, at which bounds are meaningful."""
    factor = math.ceil(EXACT.samples / problem.fidelity.samples)
    return problem if factor == 1 else with_more_samples(problem, factor)


def is_coarsely_sampled(measure: Measure, samples: int) -> bool:
    """Return True if the norm of a load is computed from fewer than `FINE_SAMPLES` samples, after refinement (M6)."""
    return measure.norm.refinement * samples < FINE_SAMPLES


def limit_samples(measure: Measure, samples: int) -> int:
    """Return the number of samples for checking a limit on a load: `samples`, or more for an exact mean (P7)."""
    return fine_samples(samples) if is_coarsely_sampled(measure, samples) else samples


def with_common_base(base: Fraction, signals: Sequence[Spectrum]) -> list[Spectrum]:
    """Return signals with one common base order, of which `base` is a multiple."""
    finest = common_base([base, *(signal.base for signal in signals)])
    return [signal.with_finer_base(finest) for signal in signals]


def evaluate(problem: Problem, engine: Engine | None = None, samples: int | None = None) -> Evaluation:
    """Compute the loads of a design by the exact model.

    By default the design is that of the problem as given, and `samples` over the cycle are those of the fidelity.

    Raises
    ------
    ModelError
        If the gas model cannot be met.
    UncarriedLoadError
        If the engine drives a direction that no mount carries.
    """
    engine = problem.engine if engine is None else engine
    wrenches: list[tuple[OperatingPoint, Spectrum]] = []
    for point in problem.points:
        try:
            wrenches.append((point, shaking_loads(engine, point, problem.fidelity)))
        except ModelError as error:
            raise ModelError(f"at {point.name}: {error}", error.where) from None
    loads = _on_mounts(engine, problem.fidelity, wrenches)
    return Evaluation(engine, problem.fidelity, loads, samples or problem.fidelity.samples)


def with_mounts(evaluation: Evaluation, engine: Engine) -> Evaluation:
    """Return the evaluation with other mounts; `engine` may differ from that of the evaluation in its mounts only."""
    loads = _on_mounts(engine, evaluation.fidelity, [(loads.point, loads.wrench) for loads in evaluation.loads])
    return replace(evaluation, engine=engine, loads=loads)


def _on_mounts(
    engine: Engine, fidelity: Fidelity, wrenches: Sequence[tuple[OperatingPoint, Spectrum]]
) -> tuple[PointLoads, ...]:
    mounting = mounting_of(engine, fidelity)
    return tuple(
        PointLoads(
            point, wrench, mounting.forces(wrench, point.speed) if mounting else None,
            travel_of(engine, mounting, wrench, point.speed), engine, fidelity,
        )
        for point, wrench in wrenches
    )  # fmt: skip


def objective_value(problem: Problem, evaluation: Evaluation) -> float:
    """Return the weighted sum that the problem minimises."""
    return sum(term.weight * evaluation.value(term.measure) for term in problem.objective)


def value_of_loads(problem: Problem, evaluation: Evaluation) -> float:
    """Return the part of the objective that consists of norms of loads and masses, which the fidelity affects [SI]."""
    return sum(term.weight * evaluation.value(term.measure) for term in problem.load_terms)


def channel_samples(evaluation: Evaluation, k: int, channel: LoadChannel = MOUNT_FORCE) -> Array:
    """Return samples of a channel at operating point k over the cycle, shape (samples, places, d) [SI]."""
    signal = channel.signal(evaluation.loads[k])
    return with_common_base(evaluation.engine.cycle.base_order, [signal])[0].sample(evaluation.samples)


def place_measures(evaluation: Evaluation, k: int, channel: LoadChannel = MOUNT_FORCE) -> list[CycleMeasures]:
    """Return mean, maximum and rms over the cycle of a load at each mount, bearing or other place, at point k [SI].

    Maxima are computed with refined samples and at kinks; all are infinite on an undamped resonance.
    """
    cached = evaluation._place_measures
    if (k, channel) in cached:
        return cached[k, channel]
    signal = channel.signal(evaluation.loads[k])
    if not np.all(np.isfinite(signal.coefficients)):
        return [CycleMeasures(math.inf, math.inf, math.inf)] * signal.coefficients.shape[1]
    (periodic,), samples = one_period(evaluation.engine.cycle.base_order, [signal], BETWEEN * evaluation.samples)
    fine, coarse = (lengths(part.sample(samples)) for part in (periodic, periodic.series))
    top = np.maximum(fine.max(axis=0), lengths(signal.values(signal.kink_angles)).max(axis=0, initial=0.0))
    coarse = coarse[::BETWEEN]
    numbers = zip(coarse.mean(axis=0), top, np.sqrt(np.mean(coarse**2, axis=0)), strict=True)
    cached[k, channel] = [CycleMeasures(*map(float, triple)) for triple in numbers]
    return cached[k, channel]


def one_period(base: Fraction, signals: Sequence[Spectrum], samples: int) -> tuple[list[Spectrum], int]:
    """Return signals over their common period, and the number of samples in it of `samples` over the cycle."""
    period_base = common_base([signal.repeat_order() for signal in signals])
    periods = period_base / base
    if periods.denominator > 1 or samples % periods.numerator:
        return with_common_base(base, signals), samples
    return [signal.with_base(period_base) for signal in signals], samples // periods.numerator
