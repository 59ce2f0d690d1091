"""Static part of an objective: the reaction to mean loads, which no unbalance can balance (M7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem

NEGLIGIBLE = 1e-3
"""Fraction of an objective below which its static part is not mentioned."""


@dataclass(frozen=True)
class StaticPart:
    """Objective for complete loads, for their means alone, and for the loads without their means.

    Attributes
    ----------
    static
        Objective for the means over the cycle [SI]. With `alternating` it does not sum to `whole`, because norms do
        not add.
    alternating
        Objective for the loads without their means [SI].
    """

    whole: float
    static: float
    alternating: float

    @property
    def is_floor(self) -> bool:
        """True if the objective equals the static part, which is a lower bound of it."""
        return self.whole <= self.static * (1.0 + NEGLIGIBLE)


def static_part(problem: Problem, evaluation: Evaluation) -> StaticPart | None:
    """Return the part of the objective from the constant (mean) loads on block and mounts; None if negligible."""
    with_means = with_loads(problem, alternating=False)
    counted = [term for term in with_means.objective if term.measure.includes_mean and not term.measure.is_inside]
    if evaluation.resonance or not counted:
        return None
    value = objective_value(with_means, evaluation)
    static = sum(term.weight * evaluation.value(replace(term.measure, orders=(0.0,))) for term in counted)
    if not static > NEGLIGIBLE * value:
        return None
    return StaticPart(value, static, objective_value(with_loads(problem, alternating=True), evaluation))


def with_loads(problem: Problem, alternating: bool) -> Problem:
    """Return the problem with an objective of alternating loads if `alternating`, else of loads with their means."""
    terms = []
    for term in problem.objective:
        measure = replace(term.measure, alternating=False)
        is_alternating = measure.includes_mean and "alternating" in measure.channel.keys
        terms.append(replace(term, measure=replace(measure, alternating=alternating and is_alternating)))
    return replace(problem, objective=tuple(terms))
