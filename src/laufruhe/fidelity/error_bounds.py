"""How far a cheaper model can be from the reference, without a guess (F6-F9).

Every measure of a load is a norm, so the value of a signal and that of the same signal with
something left out differ by no more than the norm of what was left out. Of a sampled
mean or maximum the curvature of the signal bounds what the samples miss.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
"""Steps a cycle of the reference: what cheaper choices are compared with."""
STRAIGHT, FEWEST = 8, 16
"""Parts of a straight line from one point of a trace to the next, and points of which every other may go."""
ROUNDING = 2e-12
"""Relative error that sums of a few thousand rounded terms may have (F9)."""


def reference(problem: Problem, engine: Engine | None = None, samples: int = REFERENCE_SAMPLES) -> Evaluation:
    """The highest fidelity: every order, rigid rod, gas at many steps, every mode; uneven speed where it was asked."""
    own = problem.fidelity
    best = replace(EXACT, samples=samples, crank_inertia=own.crank_inertia, crankshaft=own.crankshaft)
    return evaluate(replace(problem, fidelity=best), engine)


def signals(measure: Measure, evaluation: Evaluation) -> list[Spectrum]:
    """Return the counted spectra of a load per operating point, (n, places, d), on a common lowest order."""
    found = [measure.signal(loads, evaluation.engine) for loads in evaluation.loads]
    return with_common_base(evaluation.engine.cycle.base_order, found)


def relative(bound: float, value: float) -> float:
    """A bound over a value; infinite where that is zero and the bound is not."""
    return bound / value if value > 0.0 else (math.inf if bound > 0.0 else 0.0)


def missed(measure: Measure, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
    """Return the most that the samples of an evaluation miss of a measure [its unit]; zero without samples (F7, F8)."""
    if measure.channel.simulation:
        return measure.channel.missed(evaluation.engine) * evaluation.value(measure)
    if measure.channel.depends_on_torque:
        return _missed_of_torque(measure, evaluation, finest)
    if not measure.is_load:
        return 0.0
    shares = measure.shares([loads.point for loads in evaluation.loads])
    return measure.norm.sampling_bound(signals(measure, evaluation), shares, evaluation.samples, finest)


def _missed_of_torque(measure: Measure, evaluation: Evaluation, finest: int) -> float:
    # the remaining error is no more than the change by the finest steps
    own = evaluation.fidelity
    finer = replace(own, samples=max(2 * own.samples, finest), gas_samples=max(2 * own.gas_steps, finest))
    value, other = evaluation.value(measure), replace(evaluation, fidelity=finer).value(measure)
    return 2.0 * abs(other - value) if math.isfinite(value) and math.isfinite(other) else 0.0


class Scale:
    """Objective of a design at the reference, and bounds beside it.

    Attributes
    ----------
    terms
        Those of the objective that a fidelity can change.
    """

    def __init__(self, problem: Problem, best: Evaluation) -> None:
        self.problem, self.best = problem, best
        self.terms = [term for term in problem.objective if term.measure.is_load]
        self.value = value_of_loads(problem, best)
        self._known: dict[tuple[str, Fidelity], float] = {}

    @classmethod
    def of(cls, problem: Problem, engine: Engine | None = None) -> Scale:
        """Build the scale of the design as given, or of another."""
        return cls(problem, reference(problem, engine))

    def evaluation(self, fidelity: Fidelity) -> Evaluation:
        """The same design at another fidelity."""
        return evaluate(replace(self.problem, fidelity=fidelity), self.best.engine)

    def lost(self, ours: Evaluation, theirs: Evaluation) -> float:
        """Return the largest change of the objective when their signals replace ours (F6)."""
        total = 0.0
        for term in self.terms:
            pairs = zip(signals(term.measure, ours), signals(term.measure, theirs), strict=True)
            left_out = [x + y.mapped(np.negative) for x, y in pairs]
            # the weight of every operating point, zero where it does not count
            shares = term.measure.shares([loads.point for loads in self.best.loads])
            total += term.weight * term.measure.norm.upper_bound(left_out, shares)
        return total

    def missed(self, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
        """Return the most that the samples of an evaluation miss of the objective (F7, F8)."""
        return sum(term.weight * missed(term.measure, evaluation, finest) for term in self.terms)

    @cached_property
    def doubted(self) -> float:
        """Most that the reference misses of gas torque between its steps (F9).

        What corners in closed form leave falls off at least with the step: half the steps change no less than
        what is left.
        """
        whole = self.best.fidelity
        if all(whole.gas_of(loads.point) is None for loads in self.best.loads):
            return 0.0
        return self.lost(self.evaluation(replace(whole, gas_samples=whole.gas_steps // 2)), self.best)

    @property
    def doubt(self) -> float:
        """Relative error bound of the reference (F9)."""
        return relative(self.doubted, self.value) + ROUNDING

    def loses(self, fidelity: Fidelity, than: Evaluation | None = None) -> float:
        """Return the largest relative loss of a fidelity against the reference or another evaluation (F6)."""
        if than is not None:
            return relative(self.lost(self.evaluation(fidelity), than), self.value)
        return self._once("loses", fidelity, lambda own: self.lost(own, self.best))

    def misses(self, fidelity: Fidelity) -> float:
        """Return the largest relative sampling error of a fidelity (F7, F8)."""
        return self._once("misses", fidelity, self.missed)

    def _once(self, what: str, fidelity: Fidelity, found: Callable[[Evaluation], float]) -> float:
        key = what, replace(fidelity, tolerance=None)
        if key not in self._known:
            self._known[key] = relative(found(self.evaluation(fidelity)), self.value)
        return self._known[key]

    def error_of(self, evaluation: Evaluation) -> float:
        """Return the relative error bound of an evaluation of the same design, as `error_bound` does."""
        value = value_of_loads(self.problem, evaluation)
        bound = self.lost(evaluation, self.best) + self.missed(evaluation, self.best.samples) + self.doubted
        return relative(bound + ROUNDING * value, value)

    @cached_property
    def repeats(self) -> int:
        """Times that all measured signals repeat within the cycle, whatever is decided."""
        ratios = tuple(
            as_order(abs(rotor.shaft.ratio))
            for rotor in self.problem.engine.rotors
            if rotor.unbalance != 0 or rotor.name in self.open_rotors
        )
        bases = [signal.repeat_order(ratios) for signal in self.driving]
        return int(min(bases) / self.problem.engine.cycle.base_order) if bases else 1

    @property
    def driving(self) -> list[Spectrum]:
        """Loads on the block, fixed or open, and the measured loads inside the crankcase, per operating point."""
        inside = [s for term in self.terms if term.measure.is_inside for s in signals(term.measure, self.best)]
        return [*(loads.wrench for loads in self.best.loads), *self.decided, *inside]

    @property
    def open_rotors(self) -> set[str]:
        """Rotors whose unbalance or place is decided."""
        sized = {drive.rotor for decision in self.problem.decisions for drive in decision.rotor_drives}
        return sized | {drive.rotor for decision in self.problem.decisions for drive in decision.place_drives}

    @cached_property
    def mounting(self) -> ElasticMounting | None:
        """Block and mounts; None where the mounts are rigid."""
        return None if self.best.engine.block is None else mounting_in(self.best.engine)

    @cached_property
    def decided(self) -> list[Spectrum]:
        """Wrenches that open rotors may make: what is none now may not stay so."""
        rotors = [replace(r, unbalance=1.0) for r in self.problem.engine.rotors if r.name in self.open_rotors]
        by_name = {rotor.name: rotor for rotor in rotors}
        for drive in (drive for decision in self.problem.decisions for drive in decision.place_drives):
            rotor = by_name[drive.rotor]
            rotors.append(rotor.placed(*(at + (k == drive.axis) for k, at in enumerate(rotor.place))))
        return [rotor_loads([rotor], 1.0, self.problem.engine.cycle) for rotor in rotors]

    @cached_property
    def decided_modes(self) -> set[int]:
        """Modes that an open rotor drives, 1 the lowest: what is small now may not stay so."""
        return {mode + 1 for load in self.decided for mode in self.mounting.excited(load)} if self.mounting else set()

    @cached_property
    def excited_modes(self) -> tuple[int, ...]:
        """Modes that the loads or an open rotor drive, 1 the lowest (E12)."""
        if self.mounting is None:
            return ()
        found = {mode + 1 for loads in self.best.loads for mode in self.mounting.excited(loads.wrench)}
        return tuple(sorted(found | self.decided_modes))

    @cached_property
    def strengths(self) -> dict[int, float]:
        """Largest relative contribution of each excited mode to the objective (F6)."""
        others = {mode: tuple(m for m in self.excited_modes if m != mode) for mode in self.excited_modes}
        return {mode: self.loses(replace(self.best.fidelity, modes=rest)) for mode, rest in others.items()}


def error_bound(problem: Problem, evaluation: Evaluation, best: Evaluation) -> float:
    """Relative error of the objective of an evaluation that is not exceeded (F6-F9).

    Parameters
    ----------
    evaluation
        Of a design, at any fidelity and samples.
    best
        Of the same design at the reference.

    Returns
    -------
    Over the objective of `evaluation`; infinite where that is zero and the bound is not.
    """
    return Scale(problem, best).error_of(evaluation)


def sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    """Relative error of the objective from its samples and those of the gas, which is not exceeded (F7-F9).

    Over the objective of `evaluation`, of the physics that its fidelity asks for; infinite where that is zero and the
    bound is not.
    """
    scale = Scale(problem, evaluation)
    bound = scale.missed(evaluation) + ROUNDING * scale.value
    return relative(bound + sum(missed_of_gas(problem, evaluation)), scale.value)


def missed_of_gas(problem: Problem, evaluation: Evaluation) -> tuple[float, float]:
    """Return what the steps of the gas, and what the points of a trace miss of the loads minimised at most (F9, F9a).

    Both are the same for every design: what the gas does no unbalance changes.
    """
    own = evaluation.fidelity
    if not (own.is_uneven or any(own.gas_of(loads.point) for loads in evaluation.loads)):
        return 0.0, 0.0
    scale = Scale(problem, evaluation)
    # integration in time is taken as wanted, and would take long
    still = replace(own, mounts="frequency") if own.mounts == "time" else own
    given = evaluation if still is own else scale.evaluation(still)
    finer = replace(still, samples=2 * own.samples, gas_samples=2 * own.gas_steps)
    # what is left of twice the steps is no more than what they change
    steps = 2.0 * scale.lost(given, scale.evaluation(finer))
    if not any(isinstance(own.gas_of(loads.point), PressureTrace) for loads in evaluation.loads):
        return steps, 0.0
    others, cycle = [], evaluation.engine.cycle
    for told in (lambda gas: _straight(gas, cycle), _thinned):
        points = tuple(replace(at, gas=told(own.gas_of(at))) for at in problem.points)
        other = evaluate(replace(problem, points=points, fidelity=still), evaluation.engine)
        others.append(sum(term.weight * _apart(term.measure, given, other) for term in scale.terms))
    return steps, min(others)


def _apart(measure: Measure, ours: Evaluation, theirs: Evaluation) -> float:
    # many angles: a root mean square would hide a spike
    pairs = zip(ours.loads, theirs.loads, strict=True)
    found = [measure.load.signal(a) + measure.load.signal(b).mapped(np.negative) for a, b in pairs]
    engine, points = ours.engine, [loads.point for loads in ours.loads]
    signals = with_common_base(engine.cycle.base_order, found)
    return load_rows(measure, points, signals, engine, STRAIGHT * ours.fidelity.gas_steps).value


def _straight(gas: GasModel | None, cycle: Cycle) -> GasModel | None:
    if not isinstance(gas, PressureTrace):
        return gas
    angles, pressures = list(gas.angles), list(gas.pressures)
    if angles[-1] < angles[0] + cycle.angle - SAME_ANGLE:
        angles, pressures = [*angles, angles[0] + cycle.angle], [*pressures, pressures[0]]
    places = np.arange(STRAIGHT * (len(angles) - 1) + 1) / STRAIGHT
    told = [tuple(np.interp(places, range(len(angles)), own).tolist()) for own in (angles, pressures)]
    return replace(gas, angles=told[0], pressures=told[1])


def _thinned(gas: GasModel | None) -> GasModel | None:
    if not isinstance(gas, PressureTrace) or len(gas.angles) < FEWEST:
        return gas
    keeps = [*range(0, len(gas.angles) - 1, 2), len(gas.angles) - 1]
    return replace(gas, angles=tuple(gas.angles[k] for k in keeps), pressures=tuple(gas.pressures[k] for k in keeps))
