"""The static part of an objective in a sentence."""

from __future__ import annotations

from laufruhe.present.numbers import figure, trimmed
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import static_part


def static_sentence(problem: Problem, evaluation: Evaluation) -> str:
    """Return what of the objective is static, in a sentence; empty where that is negligible."""
    part = static_part(problem, evaluation)
    if part is None:
        return ""
    unit = problem.objective_unit or ""
    alone, rest = figure(part.static, unit), figure(part.alternating, unit)
    if part.is_floor:
        return (
            f"The steady reaction to the mean torque alone makes {alone}: nothing that turns can bring the objective "
            f"below it. Without that mean it is {rest}; alternating = true minimises this."
        )
    share = trimmed(100.0 * part.static / part.value, 2)
    return (
        f"The steady reaction to the mean torque alone makes {alone} ({share} %), which nothing that turns can "
        f"balance. Without that mean the objective is {rest} (alternating = true)."
    )
