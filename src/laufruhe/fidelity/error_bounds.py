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
from laufruhe.numerics.mixed_norms import Norm, lengths
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.metrics import order_amplitude
from laufruhe.problem.evaluation import PEAK_REFINEMENT, Evaluation, evaluate, over
from laufruhe.problem.measure import MASSES, Quantity, selected
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


def signals(quantity: Quantity, evaluation: Evaluation) -> list[Spectrum]:
    """What a quantity measures at every operating point, (n, mounts or 1, d), on a common lowest order."""
    base = evaluation.engine.cycle.base_order
    found = over(base, [loads.signal(quantity.subject) for loads in evaluation.loads])
    return [selected(quantity, signal, evaluation.mount_names) for signal in found]


def shares(quantity: Quantity, evaluation: Evaluation) -> Array:
    """Weight of every operating point in a quantity, zero where it does not count."""
    return quantity.shares([loads.point for loads in evaluation.loads])


def norm_above(quantity: Quantity, found: Sequence[Spectrum], share: Array) -> float:
    """A value that the quantity of these signals does not exceed (F6).

    A mean is not above the root mean square of the same mount, a maximum not above the
    sum of the orders' amplitudes. Neither needs a sample.
    """
    if quantity.norm is Norm.MAXIMUM:
        used = [signal for signal, weight in zip(found, share, strict=True) if weight > 0.0]
        return max((float(order_amplitude(s.coefficients).sum(axis=0).max(initial=0.0)) for s in used), default=0.0)
    squares = np.array([_mean_square(signal) for signal in found])
    if quantity.norm is Norm.RMS:
        return math.sqrt(float(share @ squares.mean(axis=1)))
    return float(share @ np.sqrt(squares).mean(axis=1))


def difference(a: Sequence[Spectrum], b: Sequence[Spectrum]) -> list[Spectrum]:
    """a - b at every operating point."""
    return [x + Spectrum(y.base, -y.coefficients) for x, y in zip(a, b, strict=True)]


def sampling_bound(quantity: Quantity, evaluation: Evaluation, finest: int = REFERENCE_SAMPLES) -> float:
    """Largest error of a quantity that its samples can make (F7, F8), in its own unit.

    Compared with many more samples, at every place that the coarse ones could have
    stood, plus what the curvature of the signal lets the many miss.
    """
    if quantity.subject in MASSES:
        return 0.0
    found, share = signals(quantity, evaluation), shares(quantity, evaluation)
    refinement = PEAK_REFINEMENT if quantity.norm is Norm.MAXIMUM else 1
    coarse = evaluation.samples * refinement
    if quantity.norm is Norm.RMS:
        exact = norm_above(quantity, found, share)
        return abs(evaluation.value(quantity) - exact)
    times = max(2, math.ceil(finest / coarse))
    errors, curvature = [], []
    for signal, weight in zip(found, share, strict=True):
        if weight == 0.0:
            continue
        step = 2.0 * math.pi / float(signal.base) / (coarse * times)
        size = lengths(signal.sample(coarse * times)).reshape(coarse, times, -1)
        bent = Spectrum(signal.base, signal.coefficients * (signal.orders**2)[:, None, None])
        if quantity.norm is Norm.MAXIMUM:
            curvature.append(step**2 / 8.0 * float(order_amplitude(bent.coefficients).sum(axis=0).max(initial=0.0)))
            errors.append(float((size.max(axis=(0, 1)) - size.max(axis=0).min(axis=0)).max(initial=0.0)))
        else:
            curvature.append(weight * step**2 / 8.0 * float(np.sqrt(_mean_square(bent)).mean()))
            shifted = size.mean(axis=(0, 2))
            errors.append(weight * float(np.abs(shifted - shifted.mean()).max()))
    return max(errors) + max(curvature) if quantity.norm is Norm.MAXIMUM else sum(errors) + sum(curvature)


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
        value += term.weight * evaluation.value(term.quantity)
        if term.quantity.subject not in MASSES:
            bound += term.weight * (
                left_out(term.quantity, evaluation, best)
                + sampling_bound(term.quantity, evaluation, best.samples)
                + gas_doubt(term.quantity, best, half)
            )
    return relative(bound + ROUNDING * value, value)


def relative(bound: float, value: float) -> float:
    """A bound over a value; infinite where that is zero and the bound is not."""
    return bound / value if value > 0.0 else (math.inf if bound > 0.0 else 0.0)


def left_out(quantity: Quantity, evaluation: Evaluation, best: Evaluation) -> float:
    """What a quantity can at most change by when the reference's signals take the place of these (F6)."""
    ours, theirs = signals(quantity, evaluation), signals(quantity, best)
    return norm_above(quantity, difference(ours, theirs), shares(quantity, best))


def half_gas(problem: Problem, best: Evaluation) -> Evaluation | None:
    """The reference with gas torque at half as many steps; None without gas."""
    if not best.fidelity.gas or all(loads.point.gas is None for loads in best.loads):
        return None
    less = replace(best.fidelity, gas_samples=best.fidelity.gas_steps // 2)
    return evaluate(replace(problem, fidelity=less), best.engine)


def gas_doubt(quantity: Quantity, best: Evaluation, half: Evaluation | None) -> float:
    """What the reference itself may miss of gas torque between its steps (F9).

    Torque bends where valves and heat act, so its orders converge with the square of
    the step: the change from half the steps is three times what is left.
    """
    return 0.0 if half is None else left_out(quantity, half, best)


def _mean_square(signal: Spectrum) -> Array:
    """Mean square over the cycle at every mount, shape (mounts,); Parseval's sum."""
    c = signal.coefficients
    power = 0.5 * np.sum(np.abs(c) ** 2, axis=(0, 2))
    # the steady part does not alternate
    return np.asarray(power - 0.5 * np.sum(np.abs(c[0]) ** 2, axis=-1) + np.sum(c[0].real ** 2, axis=-1))
