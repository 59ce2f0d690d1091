"""Check of a problem file: evaluate the initial design, and list what is open.

An editor may call this on every save, so libraries of reports and solvers are loaded for JSON only.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from laufruhe.cli.screen import complain, is_quiet
from laufruhe.errors import printed
from laufruhe.files.reader import load
from laufruhe.present.gas_figures import gas_lines
from laufruhe.present.measures import displayed_loads
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.methods import refuse
from laufruhe.units import shown_in


def check_problem(path: Path) -> tuple[str, Callable[[], str]]:
    """Return the summary of a problem, and a function that returns the initial design as JSON."""
    problem = load(path)
    warn(problem, path)
    drawing = problem.drawing
    # the evaluation finds loads that no mount carries, and gas cycles that cannot be met
    initial = evaluate_start(drawing)
    objective_value(drawing, initial)
    if not initial.resonance:
        initial.violation(drawing.limits)
    # a problem that no method solves is not ok
    refuse(problem)

    machine = drawing.engine.load_torque
    loads = [f"load: {sentence}" for sentence in machine.recording] if machine else []
    notes = {load.display.note(drawing): load for load in reversed(displayed_loads(drawing))}
    loads += [f"{load}: {note}" for note, load in notes.items() if note]

    def initial_as_json() -> str:
        from laufruhe.report.json_result import as_json
        from laufruhe.solvers import evaluate_only

        return as_json(evaluate_only(problem, allow_resonance=True))

    with shown_in(dict(problem.shown_units)):
        lines = (f"ok: {problem.summary}", *gas_lines(drawing), *loads)
    return "".join(f"{line}\n" for line in lines), initial_as_json


def warn(problem: Problem, path: Path) -> None:
    """Print plausibility warnings."""
    for warning in () if is_quiet() else problem.plausibility_warnings:
        complain(printed(f"{path}: warning: {warning}"))
