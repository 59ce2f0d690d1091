"""Static part of an objective: the steady reaction to mean loads, which no unbalance can balance (M7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem

NEGLIGIBLE = 1e-3
"""Fraction of an objective below which its static part is not mentioned."""


@dataclass(frozen=True)
class StaticPart:
    """Objectives of whole loads, of their means alone, and of the loads without their means.

    Attributes
    ----------
    whole
        Objective of the whole loads [SI].
    static
        Objective of the means over the cycle [SI]; no part of a sum, since lengths do not add up.
    alternating
        Objective of the loads without their means [SI].
    """

    whole: float
    static: float
    alternating: float

    @property
    def is_floor(self) -> bool:
        """True if the objective equals its lower bound, the static part: a norm is at least that of the mean."""
        return self.whole <= self.static * (1.0 + NEGLIGIBLE)


def static_part(problem: Problem, evaluation: Evaluation) -> StaticPart | None:
    """Return the static part of loads on the block and its mounts in the objective, or None where it is negligible."""
    whole = with_mean_loads(problem)
    counted = [term for term in whole.objective if term.measure.includes_mean and not term.measure.is_inside]
    if evaluation.resonance or not counted:
        return None
    value = objective_value(whole, evaluation)
    static = sum(term.weight * evaluation.value(replace(term.measure, orders=(0.0,))) for term in counted)
    if not static > NEGLIGIBLE * value:
        return None
    return StaticPart(value, static, objective_value(with_alternating_loads(problem), evaluation))


def with_alternating_loads(problem: Problem) -> Problem:
    """Return the problem with an objective that leaves out the mean of every load."""
    return _with_loads(problem, True)


def with_mean_loads(problem: Problem) -> Problem:
    """Return the problem with an objective that keeps the mean of every load."""
    return _with_loads(problem, False)


def _with_loads(problem: Problem, alternating: bool) -> Problem:
    terms = []
    for term in problem.objective:
        whole = replace(term.measure, alternating=False)
        may = whole.includes_mean and "alternating" in whole.channel.keys
        terms.append(replace(term, measure=replace(whole, alternating=alternating and may)))
    return replace(problem, objective=tuple(terms))
