"""The static part of an objective in a sentence."""

from __future__ import annotations

from laufruhe.present.numbers import figure
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import static_part, with_loads


def static_sentence(problem: Problem, evaluation: Evaluation) -> str:
    """Return a sentence about the part of the objective from mean loads (M7); empty if negligible."""
    part = static_part(problem, evaluation)
    if part is None:
        return ""
    unit = problem.objective_unit or ""
    static, alternating, total = (figure(value, unit) for value in (part.static, part.alternating, part.whole))
    if with_loads(problem, alternating=True).objective == problem.objective:
        return f"The steady reaction to the mean torque, {static} alone, is left out; with it the objective is {total}."
    if part.is_floor:
        return (
            f"The steady reaction to the mean torque alone makes {static}. No rotating part can bring the objective "
            f"below it. Without that mean it is {alternating}; "
            "alternating = true minimises this."
        )
    return (
        f"No rotating part can balance the steady reaction to the mean torque. Without this mean the objective is "
        f"{alternating} (alternating = true)."
    )
