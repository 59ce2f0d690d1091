"""The exact model's answer to one design: loads at every operating point, and any quantity of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, lengths
from laufruhe.numerics.spectrum import Spectrum, common_base, times
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.metrics import CycleMeasures, cycle_measures
from laufruhe.physics.mounting import mounting_of, travel_of
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import MOUNT_FORCE, LoadChannel, NumberChannel
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure, Rows, load_rows, mass_rows
from laufruhe.problem.problem import Problem

BETWEEN = NORMS["maximum"].refinement
"""Times as many samples as are asked for, among which maxima of mounts are sought (M6)."""
FINE = 5760
"""Angles at which limits are read that nothing open acts on."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything known of one design at every operating point.

    Attributes
    ----------
    engine
        The design.
    fidelity
        What of the physics was kept.
    loads
        Per operating point.
    samples
        Steps over the cycle at which measures are taken.
    resonance
        What has no answer, in words; loads and travel of the orders concerned are infinite.
    """

    engine: Engine
    fidelity: Fidelity
    loads: tuple[PointLoads, ...]
    samples: int
    resonance: str = ""

    @cached_property
    def measured_so_far(self) -> dict[tuple[int, LoadChannel], list[CycleMeasures]]:
        """Of every place of a channel at an operating point: tables, files and pictures ask for the same."""
        return {}

    @cached_property
    def mount_names(self) -> list[str]:
        """In the order of the engine."""
        return [mount.name for mount in self.engine.mounts]

    def rows(self, measure: Measure, samples: int | None = None, bends: Sequence[Array] | None = None) -> Rows:
        """Rows whose norm a measure is, over the whole cycle; of a peak where it bends too, or at angles given."""
        if not measure.is_load:
            return mass_rows(measure, self.engine.rotors, self.engine.slider_cranks)
        return load_rows(
            measure,
            [loads.point for loads in self.loads],
            over(self.engine.cycle.base_order, self.signals(measure.load)),
            self.engine,
            samples or self.samples,
            bends,
        )

    def _repeated_rows(self, measure: Measure, samples: int) -> Rows:
        """Rows that repeat over the cycle as often as its signals do, once: they have the same norm."""
        if not measure.is_load:
            return self.rows(measure)
        signals = self.signals(measure.load)
        if measure.norm.refinement == 1:
            signals = [signal.series for signal in signals]
        once, samples = _one_period(self.engine.cycle.base_order, signals, samples)
        return load_rows(measure, [loads.point for loads in self.loads], once, self.engine, samples)

    def signals(self, channel: LoadChannel) -> list[Spectrum]:
        """What a channel measures at every operating point, shape (n, places, d)."""
        return [channel.signal(loads) for loads in self.loads]

    @cached_property
    def _values(self) -> dict[Measure, Sequence[float]]:
        return {}

    def values(self, measure: Measure) -> Sequence[float]:
        """Return all numbers that a measure has of this design [SI], its value first, worked out once."""
        if measure not in self._values:
            self._values[measure] = self._measured(measure)
        return self._values[measure]

    def _measured(self, measure: Measure) -> Sequence[float]:
        if isinstance(measure.channel, NumberChannel):
            return measure.channel.values(measure, self)
        finer = 1 if measure.is_mass else measure.norm.refinement
        if not self.resonance:
            return (self._repeated_rows(measure, finer * self.samples).value,)
        with np.errstate(invalid="ignore"):
            value = self._repeated_rows(measure, finer * self.samples).value
        return (value if math.isfinite(value) else math.inf,)

    def value(self, measure: Measure) -> float:
        """A measure of this design [SI]; a maximum is sought between the samples too. Infinite on a resonance."""
        return self.values(measure)[0]

    def standing(self, limit: Limit) -> Standing:
        """How this design stands to a limit (E15)."""
        # of a shaft that was left out there is no place to limit
        nothing = math.inf if limit.maximum == math.inf else max(limit.minimum, 0.0)
        pairs = ((value, *limit.room(value)) for value in self.values(limit.measure) or (nothing,))
        value, room, edge, side = min(pairs, key=lambda found: found[1])
        return Standing(value, edge, side, -room)

    def excess(self, limits: Sequence[Limit]) -> float:
        """Largest relative excess over a limit, negative where all have room; zero without limits."""
        return max((self.standing(limit).excess for limit in limits), default=0.0)


@dataclass(frozen=True)
class Standing:
    """A measured value, the side of its limit that it is nearest to breaking, or breaks, and by what share.

    Of several values, as natural frequencies, it is the one with the least room.
    """

    value: float
    edge: float
    side: str
    excess: float


def finely(evaluation: Evaluation) -> Evaluation:
    """At so many angles that a mean is what it is: at few it may be more (P7)."""
    return replace(evaluation, samples=fine_samples(evaluation.samples))


def fine_samples(samples: int) -> int:
    """Return so many times as many angles that there are `FINE`, and twice as many at least."""
    return samples * max(2, math.ceil(FINE / samples))


def finer(problem: Problem, times: int) -> Problem:
    """The problem at so many times as many angles; the gas keeps its own."""
    own = problem.fidelity
    return problem.at(replace(own, samples=times * own.samples, gas_samples=own.gas_steps))


def at_many(problem: Problem) -> Problem:
    """The problem at as many angles as by default: what bounds a mean at fewer bounds it at these alone."""
    times = math.ceil(EXACT.samples / problem.fidelity.samples)
    return problem if times == 1 else finer(problem, times)


def is_of_few(measure: Measure, samples: int) -> bool:
    """Whether a load read at so many angles is read at few; peaks are sought among more of them anyway (M6)."""
    return measure.norm.refinement * samples < FINE


def told_at(measure: Measure, samples: int) -> int:
    """Angles at which a limit of a load is told: so many, or as many as it takes where these are few (P7)."""
    return fine_samples(samples) if is_of_few(measure, samples) else samples


def over(base: Fraction, signals: Sequence[Spectrum]) -> list[Spectrum]:
    """Signals brought to one lowest order, a multiple of or equal to theirs."""
    finest = common_base([base, *(signal.base for signal in signals)])
    return [signal.rebased(finest) for signal in signals]


def evaluate(problem: Problem, engine: Engine | None = None, samples: int | None = None) -> Evaluation:
    """Loads of a design by the exact model.

    Parameters
    ----------
    problem
        Operating points and fidelity.
    engine
        The design; that of the problem as given when left out.
    samples
        Steps over the cycle at which measures are taken; those of the fidelity when
        left out.

    Raises
    ------
    ModelError
        If the gas model cannot be met.
    UncarriedLoadError
        If the engine drives a direction that no mount carries.
    """
    engine = problem.engine if engine is None else engine
    wrenches = [(point, _wrench(engine, point, problem.fidelity)) for point in problem.points]
    loads = _on_mounts(engine, problem.fidelity, wrenches)
    return Evaluation(engine, problem.fidelity, loads, samples or problem.fidelity.samples)


def _wrench(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    try:
        return shaking_loads(engine, point, fidelity)
    except ModelError as error:
        raise ModelError(f"at {point.name}: {error}", error.where) from None


def remounted(evaluation: Evaluation, engine: Engine) -> Evaluation:
    """The loads of an evaluation on other mounts; `engine` differs in its mounts alone."""
    loads = _on_mounts(engine, evaluation.fidelity, [(loads.point, loads.wrench) for loads in evaluation.loads])
    return replace(evaluation, engine=engine, loads=loads)


def _on_mounts(
    engine: Engine, fidelity: Fidelity, wrenches: Sequence[tuple[OperatingPoint, Spectrum]]
) -> tuple[PointLoads, ...]:
    mounting = mounting_of(engine, fidelity)
    return tuple(
        PointLoads(
            point,
            wrench,
            mounting.forces(wrench, point.speed) if mounting else None,
            travel_of(engine, mounting, wrench, point.speed),
            engine,
            fidelity,
        )
        for point, wrench in wrenches
    )


def objective_value(problem: Problem, evaluation: Evaluation) -> float:
    """The weighted sum that the problem minimises."""
    return sum(term.weight * evaluation.value(term.measure) for term in problem.objective)


def value_of_loads(problem: Problem, evaluation: Evaluation) -> float:
    """The same without what is asked of a block on its mounts, which no fidelity changes."""
    return sum(term.weight * evaluation.value(term.measure) for term in problem.load_terms)


def samples_of(evaluation: Evaluation, k: int, channel: LoadChannel = MOUNT_FORCE) -> Array:
    """A channel at operating point k over the whole cycle, shape (samples, places, d)."""
    signal = channel.signal(evaluation.loads[k])
    return over(evaluation.engine.cycle.base_order, [signal])[0].sample(evaluation.samples)


def measured(evaluation: Evaluation, k: int, channel: LoadChannel = MOUNT_FORCE) -> list[CycleMeasures]:
    """At every place of a channel at operating point k; a maximum is sought between the samples too, as limits are."""
    known = evaluation.measured_so_far
    if (k, channel) not in known:
        known[k, channel] = _measured(evaluation, channel.signal(evaluation.loads[k]))
    return known[k, channel]


def _measured(evaluation: Evaluation, signal: Spectrum) -> list[CycleMeasures]:
    if not np.all(np.isfinite(signal.coefficients)):
        return [CycleMeasures(math.inf, math.inf, math.inf)] * signal.coefficients.shape[1]
    (once,), samples = _one_period(evaluation.engine.cycle.base_order, [signal], BETWEEN * evaluation.samples)
    fine, coarse = (lengths(each.sample(samples)) for each in (once, once.series))
    most = np.maximum(fine.max(axis=0), lengths(signal.values(signal.bends)).max(axis=0, initial=0.0))
    return [
        replace(cycle_measures(own[:, None]), max=float(top))
        for own, top in zip(coarse[::BETWEEN].T, most, strict=True)
    ]


def _one_period(base: Fraction, signals: Sequence[Spectrum], samples: int) -> tuple[list[Spectrum], int]:
    """Signals over the period in which all repeat, and the samples of a cycle that fall into one."""
    once = common_base([signal.repeats() for signal in signals])
    periods = times(once, base)
    if not periods or samples % periods:
        return over(base, signals), samples
    return [signal.over(once) for signal in signals], samples // periods
