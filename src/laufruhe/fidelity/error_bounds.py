"""How far a cheaper model can be from the reference, without a guess (F6-F9).

Every quantity is a norm, so the value of a signal and that of the same signal with
something left out differ by no more than the norm of what was left out. Of a sampled
mean or maximum the curvature of the signal bounds what the samples miss.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import Evaluation, evaluate, over
from laufruhe.problem.measure import Measure, selected
from laufruhe.problem.problem import Problem

Array = NDArray[np.float64]

REFERENCE_SAMPLES = 5760
"""Steps a cycle of the reference: what cheaper choices are compared with."""
ROUNDING = 2e-13
"""Relative error that sums of a few thousand rounded terms may have (F9)."""


def reference(problem: Problem, engine: Engine | None = None, samples: int = REFERENCE_SAMPLES) -> Evaluation:
    """The highest fidelity: every order, rigid rod, gas at many steps, every mode; uneven speed where it was asked."""
    f = problem.fidelity
    best = replace(f, kinematics="exact", samples=samples, orders=None, rod="rigid", gas=True,
                   gas_samples=None, mounts="frequency", modes=None, tolerance=None)  # fmt: skip
    return evaluate(replace(problem, fidelity=best), engine)


def signals(quantity: Measure, evaluation: Evaluation) -> list[Spectrum]:
    """What a quantity measures at every operating point, (n, mounts or 1, d), on a common lowest order."""
    base = evaluation.engine.cycle.base_order
    found = over(base, evaluation.signals(quantity.channel)) if isinstance(quantity.channel, LoadChannel) else []
    return [selected(quantity, signal, evaluation.mount_names) for signal in found]


def shares(quantity: Measure, evaluation: Evaluation) -> Array:
    """Weight of every operating point in a quantity, zero where it does not count."""
    return quantity.shares([loads.point for loads in evaluation.loads])


def difference(a: Sequence[Spectrum], b: Sequence[Spectrum]) -> list[Spectrum]:
    """a - b at every operating point."""
    return [x + Spectrum(y.base, -y.coefficients) for x, y in zip(a, b, strict=True)]


def sampling_bound(quantity: Measure, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
    """Largest error of a quantity that its samples can make (F7, F8), in its own unit.

    Compared with many more samples, at every place that the coarse ones could have
    stood, plus what the curvature of the signal lets the many miss.
    """
    if quantity.is_mass:
        return 0.0
    found, share = signals(quantity, evaluation), shares(quantity, evaluation)
    return quantity.norm.sampling_bound(found, share, evaluation.samples, finest)


def error_bound(problem: Problem, evaluation: Evaluation, best: Evaluation) -> float:
    """Relative error of the objective that is not exceeded (F6-F9).

    Parameters
    ----------
    problem
        Its objective.
    evaluation
        Of a design, at any fidelity and samples.
    best
        Of the same design at the reference.

    Returns
    -------
    Over the objective of `evaluation`; infinite where that is zero and the bound is not.
    """
    bound = value = 0.0
    half = half_gas(problem, best)
    for term in problem.objective:
        value += term.weight * evaluation.value(term.measure)
        if not term.measure.is_mass:
            bound += term.weight * (
                left_out(term.measure, evaluation, best)
                + sampling_bound(term.measure, evaluation, best.samples)
                + gas_doubt(term.measure, best, half)
            )
    return relative(bound + ROUNDING * value, value)


def relative(bound: float, value: float) -> float:
    """A bound over a value; infinite where that is zero and the bound is not."""
    return bound / value if value > 0.0 else (math.inf if bound > 0.0 else 0.0)


def left_out(quantity: Measure, evaluation: Evaluation, best: Evaluation) -> float:
    """What a quantity can at most change by when the reference's signals take the place of these (F6)."""
    ours, theirs = signals(quantity, evaluation), signals(quantity, best)
    return quantity.norm.above(difference(ours, theirs), shares(quantity, best))


def half_gas(problem: Problem, best: Evaluation) -> Evaluation | None:
    """The reference with gas torque at half as many steps; None without gas."""
    if not best.fidelity.gas or all(loads.point.gas is None for loads in best.loads):
        return None
    less = replace(best.fidelity, gas_samples=best.fidelity.gas_steps // 2)
    return evaluate(replace(problem, fidelity=less), best.engine)


def gas_doubt(quantity: Measure, best: Evaluation, half: Evaluation | None) -> float:
    """What the reference itself may miss of gas torque between its steps (F9).

    Torque bends where valves and heat act, so its orders converge with the square of
    the step: the change from half the steps is three times what is left.
    """
    return 0.0 if half is None else left_out(quantity, half, best)
