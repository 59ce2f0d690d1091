"""Physics that a problem needs, as text and as JSON."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from laufruhe.extensions.fidelity.choice import Choice, choose
from laufruhe.extensions.fidelity.mount_needs import needs
from laufruhe.extensions.fidelity.trade import problem_with_objective, timed
from laufruhe.present.numbers import trimmed
from laufruhe.present.static_load import static_sentence
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import static_part
from laufruhe.report.strict_json import strict


def explained(path: Path, tolerance: float) -> tuple[str, Callable[[], str]]:
    """Return a text on the physics that a problem needs, and a function that returns it as JSON."""
    problem = problem_with_objective(path)
    choice = choose(problem, tolerance) if problem.load_terms else needs(problem)
    answer = (problem, choice, tolerance, _milliseconds(problem, choice))
    return _as_text(*answer), lambda: _as_json(*answer)


def _milliseconds(problem: Problem, choice: Choice) -> tuple[float, float]:
    # of an evaluation with the physics that the objective needs, and with all of it
    exact = problem.at(problem.fidelity.exact(problem.fidelity.samples))
    needed = problem.at(choice.fidelity) if choice.numbers[0] else replace(problem, points=())
    short, whole = (1e3 * timed(partial(_objective, variant))[1] for variant in (needed, exact))
    return short, whole


def _objective(problem: Problem) -> float:
    return objective_value(problem, evaluate(problem))


def _as_text(problem: Problem, choice: Choice, tolerance: float, milliseconds: tuple[float, float]) -> str:
    """Return the computed and neglected physics with reasons and cost, as text.

    One evaluation takes `milliseconds` with the chosen and with the exact physics.
    """
    pruned, exact = choice.numbers
    ratio = f", one in {trimmed(exact / pruned, 2)}" if 0 < pruned < exact else ""
    remark = "" if choice.error_estimate <= tolerance else "; the reference is no better: use a smoother gas trace"
    static = static_sentence(problem, evaluate_start(problem)) if problem.load_terms else ""
    lines = [
        f"{problem.title}",
        f"Error of the objective: at most {choice.error_estimate:.1e} (tolerance {tolerance:g}{remark})",
        "",
        "Computed:",
        *(f"  {text}" for text in choice.description),
        "Neglected:",
    ]
    for part in choice.left_out:
        size = (
            f"changes the objective by at most {part.share:.1e}"
            if part.share > 0.0
            else "does not change the objective"
        )
        lines.append(f"  {part.what}: {part.why}; {size}")
    lines += ["Static:", f"  {static}"] if static else []
    lines += [
        "Cost:",
        f"  {pruned} of {exact} samples of force components{ratio}",
        f"  one evaluation: {trimmed(milliseconds[0], 3)} ms; with exact physics: {trimmed(milliseconds[1], 3)} ms",
    ]
    return "\n".join(lines) + "\n"


def _as_json(problem: Problem, choice: Choice, tolerance: float, milliseconds: tuple[float, float]) -> str:
    """Return the content of the text as JSON."""
    part = static_part(problem, evaluate_start(problem)) if problem.load_terms else None
    return strict({
        "problem": problem.name,
        "tolerance": tolerance,
        "error_estimate": choice.error_estimate,
        "fidelity": asdict(choice.fidelity),
        "kept": list(choice.description),
        "left_out": [{"what": part.what, "why": part.why, "share": part.share} for part in choice.left_out],
        "static": None if part is None else asdict(part),
        "numbers": {"kept": choice.numbers[0], "exact": choice.numbers[1]},
        "milliseconds": {"kept": milliseconds[0], "exact": milliseconds[1]},
    })  # fmt: skip
