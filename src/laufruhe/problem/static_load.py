"""The static part of an objective: the steady reaction to mean loads, which no unbalance can balance (M7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem

NEGLIGIBLE = 1e-3
"""Share of an objective under which its static part is not worth a sentence."""


@dataclass(frozen=True)
class StaticPart:
    """An objective as it is, of its mean loads alone, and without them.

    Attributes
    ----------
    value
        The objective [SI].
    static
        The objective if only the means over the cycle acted; no sum of parts, since lengths do not add up.
    alternating
        The objective if all but the means acted.
    """

    value: float
    static: float
    alternating: float

    @property
    def is_floor(self) -> bool:
        """Whether the objective is as small as its static part lets it be: a norm is never under that of the mean."""
        return self.value <= self.static * (1.0 + NEGLIGIBLE)


def static_part(problem: Problem, evaluation: Evaluation) -> StaticPart | None:
    """Return the static part of the objective of a design, or None where it is negligible."""
    counted = [term for term in problem.objective if term.measure.counts_mean and not term.measure.is_inside]
    if evaluation.resonance or not counted:
        return None

    value = objective_value(problem, evaluation)
    static = sum(term.weight * evaluation.value(replace(term.measure, orders=(0.0,))) for term in counted)
    if not static > NEGLIGIBLE * value:
        return None
    return StaticPart(value, static, objective_value(with_alternating_loads(problem), evaluation))


def with_alternating_loads(problem: Problem) -> Problem:
    """Return the problem with an objective that leaves out the mean of every load."""
    terms = (
        replace(term, measure=replace(term.measure, alternating=True)) if term.measure.counts_mean else term
        for term in problem.objective
    )
    return replace(problem, objective=tuple(terms))


def with_whole_loads(problem: Problem) -> Problem:
    """Return the problem with an objective that keeps the mean of every load."""
    terms = (replace(term, measure=replace(term.measure, alternating=False)) for term in problem.objective)
    return replace(problem, objective=tuple(terms))
