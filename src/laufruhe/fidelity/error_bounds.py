"""Proven bounds of the difference between a cheaper model and the reference (F6-F9).

A measure of a load is a norm. By the triangle inequality, omitting a part of a signal changes its norm by at most the
norm of that part. The curvature of the signal bounds the sampling error of a mean or maximum.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.machine import Cycle, Engine, GasModel, PressureTrace
from laufruhe.numerics.kinks import SAME_ANGLE
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, evaluate, value_of_loads, with_common_base
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
    fidelity = problem.fidelity
    best = replace(EXACT, samples=samples, crank_inertia=fidelity.crank_inertia, crankshaft=fidelity.crankshaft)
    return evaluate(replace(problem, fidelity=best), engine)


def signals(measure: Measure, evaluation: Evaluation) -> list[Spectrum]:
    """Return the spectrum of a measured load at each operating point, shape (n, places, d), with one base order."""
    spectra = [measure.signal(loads, evaluation.engine) for loads in evaluation.loads]
    return with_common_base(evaluation.engine.cycle.base_order, spectra)


def relative(bound: float, value: float) -> float:
    """Return bound / value; it is infinite if only the value is zero, and zero if both are."""
    return bound / value if value > 0.0 else (math.inf if bound > 0.0 else 0.0)


def measure_sampling_error(measure: Measure, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
    """Return an upper bound of the sampling error of a measure, in its unit; zero without samples (F7, F8).

    The samples of the evaluation are compared with at least the number `finest`.
    """
    if measure.channel.simulation:
        return measure.channel.peak_error(evaluation.engine) * evaluation.value(measure)
    if measure.channel.depends_on_torque:
        # the remaining error is assumed to be at most the change to the finest steps
        fidelity = evaluation.fidelity
        samples, gas_samples = (max(2 * steps, finest) for steps in (fidelity.samples, fidelity.gas_steps))
        finer = replace(evaluation, fidelity=replace(fidelity, samples=samples, gas_samples=gas_samples))
        value, finer_value = evaluation.value(measure), finer.value(measure)
        return 2.0 * abs(finer_value - value) if math.isfinite(value) and math.isfinite(finer_value) else 0.0
    if not measure.is_load:
        return 0.0
    shares = measure.shares([loads.point for loads in evaluation.loads])
    return measure.norm.sampling_bound(signals(measure, evaluation), shares, evaluation.samples, finest)


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
        self._losses: dict[Fidelity, float] = {}
        self._sampling_errors: dict[Fidelity, float] = {}

    @classmethod
    def of(cls, problem: Problem, engine: Engine | None = None) -> ErrorReference:
        """Return the reference of a design; by default that of the problem as given."""
        return cls(problem, reference(problem, engine))

    def evaluation(self, fidelity: Fidelity) -> Evaluation:
        """Return the evaluation of the same design at another fidelity."""
        return evaluate(replace(self.problem, fidelity=fidelity), self.best.engine)

    def largest_change(self, ours: Evaluation, theirs: Evaluation) -> float:
        """Return an upper bound of the difference of the objective between two evaluations of one design (F6)."""
        total = 0.0
        for term in self.terms:
            pairs = zip(signals(term.measure, ours), signals(term.measure, theirs), strict=True)
            left_out = [x + y.mapped(np.negative) for x, y in pairs]
            # weight of each operating point, zero for points that do not count
            shares = term.measure.shares([loads.point for loads in self.best.loads])
            total += term.weight * term.measure.norm.upper_bound(left_out, shares)
        return total

    def sampling_error(self, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
        """Return an upper bound of the sampling error of the objective of an evaluation (F7, F8)."""
        return sum(term.weight * measure_sampling_error(term.measure, evaluation, finest) for term in self.terms)

    @cached_property
    def gas_step_error(self) -> float:
        """Upper bound of the error of the reference from the steps of the gas torque, in units of the objective (F9).

        With kinks in closed form the error falls at least in proportion to the step. The change to half as many steps
        is therefore at least the remaining error.
        """
        fidelity = self.best.fidelity
        if all(fidelity.gas_of(loads.point) is None for loads in self.best.loads):
            return 0.0
        return self.largest_change(self.evaluation(replace(fidelity, gas_samples=fidelity.gas_steps // 2)), self.best)

    @property
    def relative_reference_error(self) -> float:
        """Upper bound of the error of the reference itself, relative to its objective (F9)."""
        return relative(self.gas_step_error, self.value) + ROUNDING

    def relative_loss(self, fidelity: Fidelity, than: Evaluation | None = None) -> float:
        """Return an upper bound of the relative change of the objective by a fidelity (F6).

        The change is against the reference, or against the evaluation `than`.
        """
        if than is not None:
            return relative(self.largest_change(self.evaluation(fidelity), than), self.value)
        key = replace(fidelity, tolerance=None)
        if key not in self._losses:
            self._losses[key] = relative(self.largest_change(self.evaluation(key), self.best), self.value)
        return self._losses[key]

    def relative_sampling_error(self, fidelity: Fidelity) -> float:
        """Return an upper bound of the relative sampling error of a fidelity (F7, F8)."""
        key = replace(fidelity, tolerance=None)
        if key not in self._sampling_errors:
            self._sampling_errors[key] = relative(self.sampling_error(self.evaluation(key)), self.value)
        return self._sampling_errors[key]

    def error_of(self, evaluation: Evaluation) -> float:
        """Return an upper bound of the error of the objective of an evaluation of the same design (F6-F9).

        The error is relative to the objective of this evaluation, and infinite if only that objective is zero.
        """
        value = value_of_loads(self.problem, evaluation)
        sampling_error = self.sampling_error(evaluation, self.best.samples)
        bound = self.largest_change(evaluation, self.best) + sampling_error + self.gas_step_error
        return relative(bound + ROUNDING * value, value)

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
        return [*(loads.wrench for loads in self.best.loads), *self.open_wrenches, *inside]

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
    def open_wrenches(self) -> list[Spectrum]:
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
        return {mode + 1 for load in self.open_wrenches for mode in self.mounting.excited(load)}

    @cached_property
    def excited_modes(self) -> tuple[int, ...]:
        """Numbers of the natural modes that the loads or open rotors excite, 1 the lowest (E12)."""
        if self.mounting is None:
            return ()
        modes = {mode + 1 for loads in self.best.loads for mode in self.mounting.excited(loads.wrench)}
        return tuple(sorted(modes | self.open_rotor_modes))

    @cached_property
    def mode_contributions(self) -> dict[int, float]:
        """Upper bound of the relative contribution of each excited mode to the objective (F6)."""
        other_modes = {mode: tuple(m for m in self.excited_modes if m != mode) for mode in self.excited_modes}
        return {
            mode: self.relative_loss(replace(self.best.fidelity, modes=modes)) for mode, modes in other_modes.items()
        }


def sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return an upper bound of the relative error of the objective from samples of loads and gas (F7-F9).

    The physics is that of the fidelity of `evaluation`. The bound is infinite if only the objective is zero.
    """
    scale = ErrorReference(problem, evaluation)
    bound = scale.sampling_error(evaluation) + ROUNDING * scale.value
    return relative(bound + sum(gas_sampling_errors(problem, evaluation)), scale.value)


def gas_sampling_errors(problem: Problem, evaluation: Evaluation) -> tuple[float, float]:
    """Return upper bounds of the objective's errors from samples of the gas torque, and from trace points (F9, F9a).

    Both are in the unit of the objective, and the same for all designs, because unbalances do not change the gas.
    """
    fidelity = evaluation.fidelity
    if not (fidelity.has_uneven_speed or any(fidelity.gas_of(loads.point) for loads in evaluation.loads)):
        return 0.0, 0.0
    scale = ErrorReference(problem, evaluation)
    # mounts in the frequency domain, because integration in time takes long
    still = replace(fidelity, mounts="frequency") if fidelity.mounts == "time" else fidelity
    initial = evaluation if still is fidelity else scale.evaluation(still)
    finer = replace(still, samples=2 * fidelity.samples, gas_samples=2 * fidelity.gas_steps)
    # the error at twice the steps is at most the change to twice the steps
    steps = 2.0 * scale.largest_change(initial, scale.evaluation(finer))
    if not any(isinstance(fidelity.gas_of(loads.point), PressureTrace) for loads in evaluation.loads):
        return steps, 0.0
    changes, cycle = [], evaluation.engine.cycle
    for change in (lambda gas: _straight(gas, cycle), _thinned):
        points = tuple(replace(point, gas=change(fidelity.gas_of(point))) for point in problem.points)
        changed = evaluate(replace(problem, points=points, fidelity=still), evaluation.engine)
        changes.append(sum(term.weight * _norm_of_difference(term.measure, initial, changed) for term in scale.terms))
    return steps, min(changes)


def _norm_of_difference(measure: Measure, ours: Evaluation, theirs: Evaluation) -> float:
    # norm of the difference at many angles, which also shows spikes
    pairs = zip(ours.loads, theirs.loads, strict=True)
    differences = [measure.load.signal(a) + measure.load.signal(b).mapped(np.negative) for a, b in pairs]
    engine, points = ours.engine, [loads.point for loads in ours.loads]
    signals = with_common_base(engine.cycle.base_order, differences)
    return load_rows(measure, points, signals, engine, STRAIGHT * ours.fidelity.gas_steps).value


def _straight(gas: GasModel | None, cycle: Cycle) -> GasModel | None:
    if not isinstance(gas, PressureTrace):
        return gas
    angles, pressures = list(gas.angles), list(gas.pressures)
    if angles[-1] < angles[0] + cycle.angle - SAME_ANGLE:
        angles, pressures = [*angles, angles[0] + cycle.angle], [*pressures, pressures[0]]
    places = np.arange(STRAIGHT * (len(angles) - 1) + 1) / STRAIGHT
    resampled = [tuple(np.interp(places, range(len(angles)), column).tolist()) for column in (angles, pressures)]
    return replace(gas, angles=resampled[0], pressures=resampled[1])


def _thinned(gas: GasModel | None) -> GasModel | None:
    if not isinstance(gas, PressureTrace) or len(gas.angles) < FEWEST:
        return gas
    keeps = [*range(0, len(gas.angles) - 1, 2), len(gas.angles) - 1]
    return replace(gas, angles=tuple(gas.angles[k] for k in keeps), pressures=tuple(gas.pressures[k] for k in keeps))
