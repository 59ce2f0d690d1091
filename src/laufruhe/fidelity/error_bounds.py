"""Errors of cheaper models and of samples, and what the omitted physics costs a decision (F6-F9, F16).

The error of one design is its change to a finer model, plus the doubt about that model. For all designs together the
triangle inequality holds: omitting a part of a signal changes its norm by at most the norm of that part.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.machine import Cycle, Engine, PressureTrace
from laufruhe.machine.chambers import CommonGas, CylinderGases, models_of
from laufruhe.numerics.kinks import SAME_ANGLE
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.dependence import keeps_omitted, open_kinds
from laufruhe.problem.evaluation import (
    Evaluation,
    evaluate,
    objective_value,
    one_period,
    value_of_loads,
    with_common_base,
)
from laufruhe.problem.measure import Measure, load_rows
from laufruhe.problem.problem import Problem

REFERENCE_SAMPLES = 5760
"""Number of samples over the cycle of the reference, with which cheaper models are compared."""
STRAIGHT, FEWEST = 8, 16
"""Number of linear pieces between two points of a pressure trace, and smallest number of points of a trace from which
every second one may be dropped."""
ROUNDING = 2e-12
"""Relative rounding error of sums of a few thousand terms (F9)."""


def reference(problem: Problem, engine: Engine | None = None, samples: int = REFERENCE_SAMPLES) -> Evaluation:
    """Return the evaluation of a design at the highest fidelity: all orders and modes, rigid rods, many gas samples.

    The crank speed is uneven if it is in the problem. By default the design is that of the problem as given.
    """
    return evaluate(problem.at(problem.fidelity.exact(samples)), engine)


def signals(measure: Measure, evaluation: Evaluation) -> list[Spectrum]:
    """Return the spectrum of a measured load at each operating point, shape (n, places, d), with one base order."""
    spectra = [measure.signal(loads, evaluation.engine) for loads in evaluation.loads]
    return with_common_base(evaluation.engine.cycle.base_order, spectra)


def relative(bound: float, value: float) -> float:
    """Return bound / value; it is infinite if only the value is zero, and zero if both are."""
    return bound / value if value > 0.0 else (math.inf if bound > 0.0 else 0.0)


def measure_sampling_error(measure: Measure, evaluation: Evaluation) -> float:
    """Return the sampling error of a measure, in its unit; zero without samples (F7, F8)."""
    if measure.channel.simulation:
        return measure.channel.peak_error(evaluation.engine) * evaluation.value(measure)
    if measure.channel.depends_on_torque:
        # the remaining error is assumed to be at most the change to the finest steps
        fidelity = evaluation.fidelity
        samples, gas_samples = (max(2 * steps, REFERENCE_SAMPLES) for steps in (fidelity.samples, fidelity.gas_steps))
        finer = replace(evaluation, fidelity=replace(fidelity, samples=samples, gas_samples=gas_samples))
        value, finer_value = evaluation.value(measure), finer.value(measure)
        return 2.0 * abs(finer_value - value) if math.isfinite(value) and math.isfinite(finer_value) else 0.0
    if not measure.is_load:
        return 0.0
    shares = measure.shares([loads.point for loads in evaluation.loads])
    spectra, steps = one_period(evaluation.engine.cycle.base_order, signals(measure, evaluation), evaluation.samples)
    finest = math.ceil(REFERENCE_SAMPLES * steps / evaluation.samples)
    return measure.norm.sampling_bound(spectra, shares, steps, finest)


class ErrorReference:
    """Reference for the errors of cheaper models: the evaluation of one design by the best model.

    Attributes
    ----------
    best
        Evaluation by the best model.
    terms
        Terms of the objective that are norms of loads, which a fidelity can change.
    value
        Objective of loads and masses by the best model [SI].
    """

    def __init__(self, problem: Problem, best: Evaluation) -> None:
        self.problem, self.best = problem, best
        self.terms = [term for term in problem.objective if term.measure.is_load]
        self.value = value_of_loads(problem, best)
        self._values: dict[Fidelity, float] = {}

    @classmethod
    def of(cls, problem: Problem, engine: Engine | None = None) -> ErrorReference:
        """Return the reference of a design; by default that of the problem as given."""
        return cls(problem, reference(problem, engine))

    def evaluation(self, fidelity: Fidelity) -> Evaluation:
        """Return the evaluation of the same design at another fidelity."""
        return evaluate(replace(self.problem, fidelity=fidelity), self.best.engine)

    def value_at(self, fidelity: Fidelity) -> float:
        """Return the objective of loads and masses of the same design at another fidelity [SI]."""
        key = replace(fidelity, tolerance=None)
        if key not in self._values:
            self._values[key] = value_of_loads(self.problem, self.evaluation(key))
        return self._values[key]

    def relative_change(self, fidelity: Fidelity, other: Fidelity | None = None) -> float:
        """Return the relative change of the objective between a fidelity and another one, by default the reference."""
        value = self.value if other is None else self.value_at(other)
        return relative(abs(self.value_at(fidelity) - value), self.value)

    def sampling_error(self, evaluation: Evaluation) -> float:
        """Return the sampling error of the objective of an evaluation (F7, F8)."""
        return sum(term.weight * measure_sampling_error(term.measure, evaluation) for term in self.terms)

    @cached_property
    def gas_step_error(self) -> float:
        """Error of the objective of the reference from the steps of the gas torque (F9).

        With kinks in closed form the error falls at least in proportion to the step. The largest change to a half and
        to a third of the steps is therefore at least the remaining error.
        """
        gas_steps = self.best.fidelity.gas_steps
        still = replace(without_time(self.best.fidelity), samples=self.best.samples, gas_samples=gas_steps)
        if all(still.gas_of(loads.point) is None for loads in self.best.loads):
            return 0.0
        coarser = (replace(still, gas_samples=gas_steps // times) for times in (2, 3))
        return max(abs(self.value_at(fidelity) - self.value_at(still)) for fidelity in coarser)

    @cached_property
    def doubt(self) -> float:
        """Error of the reference itself, in the unit of the objective (F7-F9)."""
        return self.sampling_error(self.best) + self.gas_step_error + ROUNDING * self.value

    def error_of(self, evaluation: Evaluation) -> float:
        """Return the error of the objective of an evaluation of the same design: change and doubt (F6).

        The error is relative to the objective of this evaluation, and infinite if only that objective is zero.
        """
        value = value_of_loads(self.problem, evaluation)
        return relative(abs(value - self.value) + self.doubt, value)

    @cached_property
    def repeats(self) -> int:
        """Number of periods of all measured signals within the working cycle, for any values of the decisions."""
        rotors = [r for r in self.problem.engine.rotors if r.unbalance != 0 or r.name in self.open_rotors]
        ratios = tuple(as_order(abs(rotor.shaft.ratio)) for rotor in rotors)
        bases = [signal.repeat_order(ratios) for signal in self.exciting_signals]
        return int(min(bases) / self.problem.engine.cycle.base_order) if bases else 1

    @property
    def exciting_signals(self) -> list[Spectrum]:
        """Spectra of the loads on the block, of unit open unbalances, and of measured loads inside the crankcase."""
        inside = [s for term in self.terms if term.measure.is_inside for s in signals(term.measure, self.best)]
        return [*(loads.wrench for loads in self.best.loads), *self.open_rotor_wrenches, *inside]

    @property
    def open_rotors(self) -> set[str]:
        """Names of the rotors with open unbalance or position."""
        sized = {drive.rotor for decision in self.problem.decisions for drive in decision.rotor_drives}
        return sized | {drive.rotor for decision in self.problem.decisions for drive in decision.place_drives}

    @cached_property
    def mounting(self) -> ElasticMounting | None:
        """Block on elastic mounts; None for rigid mounts."""
        return None if self.best.engine.block is None else mounting_in(self.best.engine)

    @cached_property
    def open_rotor_wrenches(self) -> list[Spectrum]:
        """Wrenches of unit unbalances of open rotors at their places, and with each open coordinate 1 m larger."""
        rotors = [replace(r, unbalance=1.0) for r in self.problem.engine.rotors if r.name in self.open_rotors]
        by_name = {rotor.name: rotor for rotor in rotors}
        for drive in (drive for decision in self.problem.decisions for drive in decision.place_drives):
            rotor = by_name[drive.rotor]
            rotors.append(rotor.placed(*(coordinate + (k == drive.axis) for k, coordinate in enumerate(rotor.place))))
        return [rotor_loads([rotor], 1.0, self.problem.engine.cycle) for rotor in rotors]

    @cached_property
    def open_rotor_modes(self) -> set[int]:
        """Numbers of the natural modes that open rotors can excite, 1 the lowest."""
        if self.mounting is None:
            return set()
        return {mode + 1 for load in self.open_rotor_wrenches for mode in self.mounting.excited(load)}

    @cached_property
    def excited_modes(self) -> tuple[int, ...]:
        """Numbers of the natural modes that the loads or open rotors excite, 1 the lowest (E12)."""
        if self.mounting is None:
            return ()
        modes = {mode + 1 for loads in self.best.loads for mode in self.mounting.excited(loads.wrench)}
        return tuple(sorted(modes | self.open_rotor_modes))

    @cached_property
    def mode_contributions(self) -> dict[int, float]:
        """Relative change of the objective without each excited mode."""
        other_modes = {mode: tuple(m for m in self.excited_modes if m != mode) for mode in self.excited_modes}
        return {
            mode: self.relative_change(replace(self.best.fidelity, modes=modes)) for mode, modes in other_modes.items()
        }


def sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the relative error of the objective from samples of loads and gas (F7-F9a).

    The physics is that of the fidelity of `evaluation`. The error is infinite if only the objective is zero.
    """
    scale = ErrorReference(problem, evaluation)
    steps = gas_step_bound(problem, evaluation) if evaluation.fidelity.has_uneven_speed else scale.gas_step_error
    error = scale.sampling_error(evaluation) + steps + trace_error(problem, evaluation)
    return relative(error + ROUNDING * scale.value, scale.value)


def _norm_of_change(measure: Measure, ours: Evaluation, theirs: Evaluation) -> float:
    pairs = zip(signals(measure, ours), signals(measure, theirs), strict=True)
    shares = measure.shares([loads.point for loads in ours.loads])
    return measure.norm.upper_bound([x + y.mapped(np.negative) for x, y in pairs], shares)


def largest_change(problem: Problem, ours: Evaluation, theirs: Evaluation) -> float:
    """Return an upper bound of the change of the objective between two evaluations of a design [SI] (F6).

    It is the norm of the difference of the loads. If this is the same for all designs, so is the bound.
    """
    terms = [term for term in problem.objective if term.measure.is_load]
    return sum(term.weight * _norm_of_change(term.measure, ours, theirs) for term in terms)


def regret_bound(problem: Problem, design: Evaluation, lower_bound: float) -> float | None:
    """Return an upper bound of the relative excess of a design's exact objective over the best one (F16).

    `lower_bound` is that of the objective at the fidelity of the problem [SI]. The result is None if the omitted loads
    may differ between designs, if they change a limit, or if the bound says nothing.
    """
    fidelity, kinds = problem.fidelity, open_kinds(problem)
    samples, steps = (max(count, EXACT.samples) for count in (design.samples, fidelity.gas_steps))
    exact = replace(fidelity.exact(samples), gas_samples=steps)
    evaluation = evaluate(problem.at(exact), design.engine)
    omitted = 0.0
    if exact != replace(fidelity, samples=samples, gas_samples=fidelity.gas_steps, tolerance=None):
        terms, limits = ([part.measure for part in parts] for parts in (problem.objective, problem.limits))
        if any(m.depends_on_loads and not m.is_load for m in limits) or not all(m.is_mass or m.is_load for m in terms):
            return None
        if not all(keeps_omitted(m.channel, kinds, problem) for m in (*terms, *limits) if m.is_load):
            return None
        if any(_norm_of_change(m, design, evaluation) > 0.0 for m in limits if m.is_load):
            return None
        omitted = largest_change(problem, design, evaluation)
    value, minimum = objective_value(problem, evaluation), lower_bound - omitted
    return max(value / minimum - 1.0, 0.0) if minimum > 0.0 and math.isfinite(value) else None


def without_time(fidelity: Fidelity) -> Fidelity:
    """Return a fidelity with mounts in the frequency domain if it integrates them in time, which takes long."""
    return replace(fidelity, mounts="frequency") if fidelity.mounts == "time" else fidelity


def gas_step_bound(problem: Problem, evaluation: Evaluation) -> float:
    """Return a bound of the error of the objective from gas samples, the same for all designs (F9).

    Unbalances do not change the gas. The error at twice the steps is at most the change to twice the steps.
    """
    fidelity = without_time(evaluation.fidelity)
    if not (fidelity.has_uneven_speed or any(fidelity.gas_of(loads.point) for loads in evaluation.loads)):
        return 0.0
    scale = ErrorReference(problem, evaluation)
    initial = evaluation if fidelity is evaluation.fidelity else scale.evaluation(fidelity)
    finer = replace(fidelity, samples=2 * fidelity.samples, gas_samples=2 * fidelity.gas_steps)
    return 2.0 * largest_change(problem, initial, scale.evaluation(finer))


def trace_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the error of the objective from the points of measured traces, the same for all designs (F9a)."""
    fidelity = without_time(evaluation.fidelity)
    models = (model for loads in evaluation.loads for model in models_of(fidelity.gas_of(loads.point)))
    if not any(isinstance(model, PressureTrace) for model in models):
        return 0.0
    initial = evaluation if fidelity is evaluation.fidelity else evaluate(problem.at(fidelity), evaluation.engine)
    changes, cycle = [], evaluation.engine.cycle
    for change in (lambda gas: _straight(gas, cycle), _thinned):
        gases = map(fidelity.gas_of, problem.points)
        changed_gases = [g.mapped(change) if isinstance(g, CylinderGases) else g and change(g) for g in gases]
        points = tuple(replace(p, gas=gas) for p, gas in zip(problem.points, changed_gases, strict=True))
        changed = evaluate(replace(problem, points=points, fidelity=fidelity), evaluation.engine)
        terms = ErrorReference(problem, evaluation).terms
        changes.append(sum(term.weight * _norm_of_difference(term.measure, initial, changed) for term in terms))
    return min(changes)


def _norm_of_difference(measure: Measure, ours: Evaluation, theirs: Evaluation) -> float:
    # norm of the difference at many angles, which also shows spikes
    pairs = zip(ours.loads, theirs.loads, strict=True)
    differences = [measure.load.signal(a) + measure.load.signal(b).mapped(np.negative) for a, b in pairs]
    engine, points = ours.engine, [loads.point for loads in ours.loads]
    signals = with_common_base(engine.cycle.base_order, differences)
    return load_rows(measure, points, signals, engine, STRAIGHT * ours.fidelity.gas_steps).value


def _straight(gas: CommonGas, cycle: Cycle) -> CommonGas:
    if not isinstance(gas, PressureTrace):
        return gas
    angles, pressures = list(gas.angles), list(gas.pressures)
    if angles[-1] < angles[0] + cycle.angle - SAME_ANGLE:
        angles, pressures = [*angles, angles[0] + cycle.angle], [*pressures, pressures[0]]
    places = np.arange(STRAIGHT * (len(angles) - 1) + 1) / STRAIGHT
    resampled = [tuple(np.interp(places, range(len(angles)), column).tolist()) for column in (angles, pressures)]
    return replace(gas, angles=resampled[0], pressures=resampled[1])


def _thinned(gas: CommonGas) -> CommonGas:
    if not isinstance(gas, PressureTrace) or len(gas.angles) < FEWEST:
        return gas
    keeps = [*range(0, len(gas.angles) - 1, 2), len(gas.angles) - 1]
    return replace(gas, angles=tuple(gas.angles[k] for k in keeps), pressures=tuple(gas.pressures[k] for k in keeps))
