"""Say of a problem whether the design as given can be evaluated, and what is open.

Nothing that reports, and no library that solves, is loaded unless its JSON is asked for: an editor may call this on
every save. What no method decides is said as `solve` says it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from laufruhe.cli.screen import complain, is_quiet
from laufruhe.errors import printed
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.methods import refuse


def checked(path: Path) -> tuple[str, Callable[[], str]]:
    """What a problem leaves open, and what makes JSON of the design as given."""
    problem = load(path)
    doubt(problem, path)
    drawing = problem.drawing
    # a load that no mount carries, or a gas cycle that cannot be met, shows only here
    given = evaluate_start(drawing)
    objective_value(drawing, given)
    if not given.resonance:
        given.excess(drawing.limits)
    # what solve refuses is not ok
    refuse(problem)
    return f"ok: {problem.summary}\n", lambda: _as_given(problem)


def doubt(problem: Problem, path: Path) -> None:
    """Ask of numbers that no usual engine has; nothing stops for them."""
    for one in () if is_quiet() else problem.doubts:
        complain(printed(f"{path}: warning: {one}"))


def _as_given(problem: Problem) -> str:
    from laufruhe.report.json_result import as_json
    from laufruhe.solvers import state

    return as_json(state(problem, to_start_from=True))
