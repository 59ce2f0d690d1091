"""Choice of the cheapest fidelity that keeps the objective within a tolerance (F10)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, Scale, signals
from laufruhe.fidelity.knobs import KNOBS, OmittedPart
from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

DEFAULT_TOLERANCE = 1e-3
TRIED = (1e-2, 1e-3, 1e-4)
"""Tolerances at which a trade tries the automatic choice."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Chosen fidelity with its error bound and explanation.

    Attributes
    ----------
    error_estimate
        Upper bound of the relative error of the objective, for the design of the choice.
    description
        Descriptions of the physics that is computed.
    left_out
        Parts of the physics that are omitted.
    numbers
        Number of force components that one evaluation samples at this fidelity, and by the exact model with the samples
        of the problem file.
    """

    fidelity: Fidelity
    error_estimate: float
    description: tuple[str, ...]
    left_out: tuple[OmittedPart, ...]
    numbers: tuple[int, int]


def choose(problem: Problem, tolerance: float = DEFAULT_TOLERANCE, engine: Engine | None = None) -> Choice:
    """Return the cheapest sufficient fidelity for an objective, by default at the design of the problem (F10).

    Its error bound is below the tolerance, if the reference is that exact. If the objective is zero, all parts that are
    not zero are computed. An uneven crank speed stays uneven.
    """
    return choose_from_scale(Scale.of(problem, engine), tolerance)


def choose_from_scale(scale: Scale, tolerance: float) -> Choice:
    """Choose the cheapest fidelity as `choose` does, from error bounds relative to a known reference."""
    allowed_error = max(tolerance - scale.relative_doubt, 0.0)
    fidelity = replace(scale.best.fidelity, tolerance=tolerance, gas_samples=REFERENCE_SAMPLES)
    for knob in KNOBS:
        fidelity = knob.chosen(scale, fidelity, allowed_error)
    estimate = scale.relative_loss(fidelity) + scale.relative_sampling_error(fidelity) + scale.relative_doubt
    left = [part for knob in KNOBS for part in knob.left_out(scale, fidelity)]
    pruned = full = 0
    for term in scale.terms:
        spectra = signals(term.measure, scale.best)
        directions = sum(int(np.any(np.abs(s.coefficients) > 0.0, axis=(0, 1)).sum()) for s in spectra)
        mounts, width = spectra[0].coefficients.shape[1:]
        pruned += max(fidelity.samples // scale.repeats, 24) * mounts * directions
        full += scale.problem.fidelity.samples * mounts * width * len(spectra)
    return Choice(
        fidelity,
        # convert from an error relative to the reference to one relative to the computed value
        estimate / max(1.0 - estimate, 0.5),
        tuple(text for knob in KNOBS for text in knob.describe(scale, fidelity)),
        # parts that are exactly zero come first
        tuple(sorted(left, key=lambda part: part.restored is not None)),
        (pruned, full),
    )


def automatic(problem: Problem, tolerance: float, scale: Scale | None = None) -> Problem:
    """Return the problem at its automatic fidelity; `scale` is the reference if it is known."""
    if not problem.load_terms or any(measure.channel.simulation for measure in problem.measures):
        # simulations have no error bound for omitted orders
        return problem.at(replace(problem.fidelity, tolerance=tolerance))
    return problem.at(choose_from_scale(scale or Scale.of(problem), tolerance).fidelity)


def ladder(scale: Scale) -> list[tuple[str, Problem]]:
    """Return the fidelities that a trade compares: (name, problem at this fidelity) (F13)."""
    problem = scale.problem
    rungs = [(name, problem.at(fidelity)) for knob in KNOBS for name, fidelity in knob.rungs(scale)]
    if not problem.load_terms and not any(term.measure.channel.simulation for term in problem.objective):
        return [("mounts alone, no loads", replace(problem, points=())), *rungs]
    return rungs + [(f"auto {tolerance:g}", automatic(problem, tolerance, scale)) for tolerance in TRIED]
