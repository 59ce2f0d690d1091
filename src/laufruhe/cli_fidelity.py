"""The two commands on speed and accuracy: what they compute and what they write."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from laufruhe.errors import Complaint, InputError
from laufruhe.problem.model import Problem


def explained(path: Path, tolerance: float) -> tuple[str, str]:
    """Text and JSON of what a scene needs."""
    import numpy as np

    from laufruhe.physics.fidelity import Fidelity
    from laufruhe.problem.automatic import choose
    from laufruhe.report import explain
    from laufruhe.solvers.batch import prepare
    from laufruhe.studies.trade import seconds

    problem = _with_objective(path)
    choice = choose(problem, tolerance)
    whole = Fidelity(samples=problem.fidelity.samples, crank_inertia=problem.fidelity.crank_inertia)
    times = []
    for fidelity, prune in ((choice.fidelity, True), (whole, False)):
        designs = prepare(replace(problem, fidelity=fidelity), prune)
        start = np.zeros((1, 1 + designs.columns))
        times.append(1e3 * seconds(lambda d=designs, x=start: d.of_columns(x)))  # type: ignore[misc]
    both = (times[0], times[1])
    return explain.as_text(problem, choice, tolerance, both), explain.as_json(problem, choice, tolerance, both)


def traded(paths: Sequence[Path], folder: Path, say: Callable[[str], None]) -> tuple[str, str]:
    """Pages and pictures of every problem, an index of them all; returns the index and JSON."""
    from laufruhe.plots.style import save
    from laufruhe.plots.trade import figure
    from laufruhe.report import files
    from laufruhe.report import trade as report
    from laufruhe.studies.trade import trade

    problems = [_with_objective(path) for path in paths]
    found, data = [], []
    for problem, path in zip(problems, paths, strict=True):
        one = trade(problem, lambda text, name=problem.name: say(f"{name}: {text}"))  # type: ignore[misc]
        found.append(one)
        names = (f"{problem.name}.md", f"{problem.name}.png", f"{problem.name}.json")
        with files.staged(folder, "--out", names) as stage:
            save(figure(one), stage / names[1])
            command = shlex.join(["laufruhe", "trade", str(path)])
            files.write(stage / names[0], report.as_page(one, names[1], command))
            files.write(stage / names[2], report.as_json(one))
        data.append(report.as_json(one).strip())
    index = report.index(found)
    if len(found) > 1:
        with files.staged(folder, "--out", ("README.md",)) as stage:
            files.write(stage / "README.md", index)
    return index + f"Results: {folder}\n", "[" + ",\n".join(data) + "]\n"


def _with_objective(path: Path) -> Problem:
    from laufruhe.problem.reader import load

    problem = load(path)
    if not problem.objective:
        rule, remedy = "is missing: accuracy is that of an objective", "add [objective] or mounts"
        raise InputError(str(path), (Complaint("objective", "", rule, remedy),))
    return problem
