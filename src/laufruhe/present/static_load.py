"""The static part of an objective in a sentence."""

from __future__ import annotations

from laufruhe.present.numbers import figure, share
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import static_part, with_loads


def static_sentence(problem: Problem, evaluation: Evaluation) -> str:
    """Return a sentence about the share of the objective that mean loads alone cause (M7); empty if negligible."""
    part = static_part(problem, evaluation)
    if part is None:
        return ""
    unit = problem.objective_unit or ""
    static, alternating, total = (figure(value, unit) for value in (part.static, part.alternating, part.whole))
    if with_loads(problem, alternating=True).objective == problem.objective:
        return f"The steady reaction to the mean torque, {static} alone, is left out; with it the objective is {total}."
    lead = f"The steady reaction to the mean torque alone makes {static}"
    if part.is_floor:
        return (
            f"{lead}. No rotating part can bring the objective below it. Without that mean it is {alternating}; "
            "alternating = true minimises this."
        )
    return (
        f"{lead} ({share(part.static / part.whole)}), which no rotating part can balance. "
        f"Without that mean the objective is {alternating} (alternating = true)."
    )
