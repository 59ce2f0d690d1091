"""The cheapest fidelity that keeps the objective within a tolerance, and what it leaves out (F10)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, Scale, signals
from laufruhe.fidelity.knob import LeftOut
from laufruhe.fidelity.knobs import KNOBS
from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

DEFAULT_TOLERANCE = 1e-3
TRIED = (1e-2, 1e-3, 1e-4)
"""Tolerances of the automatic choices that a trade tries."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A fidelity, how wrong it can be, and why it is enough.

    Attributes
    ----------
    error_estimate
        Relative error of the objective that is not exceeded for the design chosen for.
    kept, left_out
        What is computed, in words, and what is not.
    numbers
        Mount force components that one evaluation samples, and those of the exact model
        at as many steps as the problem file asks.
    """

    fidelity: Fidelity
    error_estimate: float
    description: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    numbers: tuple[int, int]


def choose(problem: Problem, tolerance: float = DEFAULT_TOLERANCE, engine: Engine | None = None) -> Choice:
    """The cheapest fidelity for an objective (F10).

    Parameters
    ----------
    problem
        Objective and operating points. An uneven crank speed that it has is kept.
    tolerance
        Relative error of the objective allowed.
    engine
        The design chosen for; that of the problem as given when left out.

    Returns
    -------
    Choice whose estimate is under the tolerance wherever the reference itself is; of
    an objective that is zero, everything that is not zero is kept.
    """
    return chosen_by(Scale.of(problem, engine), tolerance)


def chosen_by(scale: Scale, tolerance: float) -> Choice:
    """Choose a fidelity like `choose`, from a known reference."""
    room = max(tolerance - scale.doubt, 0.0)
    chosen = replace(scale.best.fidelity, tolerance=tolerance, gas_samples=REFERENCE_SAMPLES)
    for knob in KNOBS:
        chosen = knob.chosen(scale, chosen, room)
    estimate = scale.loses(chosen) + scale.misses(chosen) + scale.doubt
    left = [part for knob in KNOBS for part in knob.left_out(scale, chosen)]
    return Choice(
        chosen,
        # the bounds are relative to the reference, a reader's error to what was computed
        estimate / max(1.0 - estimate, 0.5),
        tuple(text for knob in KNOBS for text in knob.describe(scale, chosen)),
        # what is exactly zero first
        tuple(sorted(left, key=lambda part: part.restored is not None)),
        _numbers(scale.problem, scale, chosen),
    )


def automatic(problem: Problem, tolerance: float, scale: Scale | None = None) -> Problem:
    """The problem at the fidelity chosen for it, beside a reference where one is known."""
    if not problem.load_terms or any(measure.channel.simulation for measure in problem.measures):
        # no bound says what a simulation loses with an order
        return problem.at(replace(problem.fidelity, tolerance=tolerance))
    return problem.at(chosen_by(scale or Scale.of(problem), tolerance).fidelity)


def ladder(scale: Scale) -> list[tuple[str, Problem]]:
    """Return the fidelities that a trade compares, where they differ on this problem (F13)."""
    problem = scale.problem
    rungs = [(name, problem.at(fidelity)) for knob in KNOBS for name, fidelity in knob.rungs(scale)]
    if not problem.load_terms and not any(term.measure.channel.simulation for term in problem.objective):
        return [("mounts alone, no loads", replace(problem, points=())), *rungs]
    return rungs + [(f"auto {tolerance:g}", automatic(problem, tolerance, scale)) for tolerance in TRIED]


def _numbers(problem: Problem, scale: Scale, chosen: Fidelity) -> tuple[int, int]:
    pruned = whole = 0
    for term in scale.terms:
        found = signals(term.measure, scale.best)
        directions = sum(int(np.any(np.abs(s.coefficients) > 0.0, axis=(0, 1)).sum()) for s in found)
        mounts, width = found[0].coefficients.shape[1:]
        pruned += max(chosen.samples // scale.repeats, 24) * mounts * directions
        whole += problem.fidelity.samples * mounts * width * len(found)
    return pruned, whole
