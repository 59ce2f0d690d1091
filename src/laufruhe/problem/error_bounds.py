"""Errors of cheaper models and of samples, and what the omitted physics costs a decision (F6-F9, F16).

The error of one design is its change to a finer model, plus the doubt about that model. For all designs together the
triangle inequality holds: omitting a part of a signal changes its norm by at most the norm of that part.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
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
FINER = 8
"""Number of angles for each sample of the gas at which a change of measured points is compared."""
ROUNDING = 2e-12
"""Relative rounding error of sums of a few thousand terms (F9)."""


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


def load_sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the sampling error of the loads in the objective [SI] (F7, F8)."""
    terms = (term for term in problem.objective if term.measure.is_load)
    return sum(term.weight * measure_sampling_error(term.measure, evaluation) for term in terms)


def gas_step_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the error of the objective from the steps of the gas torque, for the design of an evaluation [SI] (F9).

    With kinks in closed form the error falls at least in proportion to the step. The largest change to a half and
    to a third of the steps is therefore at least the remaining error.
    """
    steps = evaluation.fidelity.gas_steps
    still = replace(without_time(evaluation.fidelity), samples=evaluation.samples, gas_samples=steps)
    if all(still.gas_of(loads.point) is None for loads in evaluation.loads):
        return 0.0
    fidelities = (replace(still, gas_samples=steps // times) for times in (1, 2, 3))
    value, *coarser = (value_of_loads(problem, _at(problem, evaluation, fidelity)) for fidelity in fidelities)
    return max(abs(other - value) for other in coarser)


def _at(problem: Problem, evaluation: Evaluation, fidelity: Fidelity) -> Evaluation:
    return evaluate(replace(problem, fidelity=fidelity), evaluation.engine)


def sampling_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the relative error of the objective from samples of loads and gas (F7-F9a).

    The physics is that of the fidelity of `evaluation`. The error is infinite if only the objective is zero.
    """
    value = value_of_loads(problem, evaluation)
    step_error = gas_step_bound if evaluation.fidelity.has_uneven_speed else gas_step_error
    error = load_sampling_error(problem, evaluation) + step_error(problem, evaluation)
    return relative(error + trace_error(problem, evaluation) + ROUNDING * value, value)


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
    initial = evaluation if fidelity is evaluation.fidelity else _at(problem, evaluation, fidelity)
    finer = replace(fidelity, samples=2 * fidelity.samples, gas_samples=2 * fidelity.gas_steps)
    return 2.0 * largest_change(problem, initial, _at(problem, evaluation, finer))


def trace_error(problem: Problem, evaluation: Evaluation) -> float:
    """Return the error of the objective from the points of measured traces, the same for all designs (F9a)."""
    fidelity = without_time(evaluation.fidelity)
    gases = [fidelity.gas_of(point) for point in problem.points]
    if not any(model.is_measured for gas in gases if gas is not None for model in gas.models):
        return 0.0
    initial = evaluation if fidelity is evaluation.fidelity else evaluate(problem.at(fidelity), evaluation.engine)
    changes, cycle = [], evaluation.engine.cycle
    for k in range(2):
        changed_gases = [gas and gas.approximations(cycle)[k] for gas in gases]
        points = tuple(replace(p, gas=gas) for p, gas in zip(problem.points, changed_gases, strict=True))
        changed = evaluate(replace(problem, points=points, fidelity=fidelity), evaluation.engine)
        terms = (term for term in problem.objective if term.measure.is_load)
        changes.append(sum(term.weight * _norm_of_difference(term.measure, initial, changed) for term in terms))
    return min(changes)


def _norm_of_difference(measure: Measure, ours: Evaluation, theirs: Evaluation) -> float:
    # norm of the difference at many angles, which also shows spikes
    pairs = zip(ours.loads, theirs.loads, strict=True)
    differences = [measure.load.signal(a) + measure.load.signal(b).mapped(np.negative) for a, b in pairs]
    engine, points = ours.engine, [loads.point for loads in ours.loads]
    signals = with_common_base(engine.cycle.base_order, differences)
    return load_rows(measure, points, signals, engine, FINER * ours.fidelity.gas_steps).value
