"""Commands `explain` and `trade` on speed and accuracy of models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from laufruhe.cli.screen import typed
from laufruhe.errors import SolverError, refused
from laufruhe.fidelity.automatic import Choice, choose
from laufruhe.fidelity.mount_needs import needs
from laufruhe.files.reader import load
from laufruhe.numerics.budget import is_time_over
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report import explain, files
from laufruhe.report import trade as report
from laufruhe.report.document import Document
from laufruhe.report.web_page import as_html
from laufruhe.studies.trade import Trade, timed, trade


def explained(path: Path, tolerance: float) -> tuple[str, Callable[[], str]]:
    """Return a text on the model fidelity that a problem needs, and a function that returns it as JSON."""
    problem = _with_objective(path)
    choice = choose(problem, tolerance) if problem.load_terms else needs(problem)
    answer = (problem, choice, tolerance, _times(problem, choice))
    return explain.as_text(*answer), lambda: explain.as_json(*answer)


def _times(problem: Problem, choice: Choice) -> tuple[float, float]:
    # milliseconds of an evaluation with the physics that the objective needs, and with all of it
    exact = problem.at(problem.fidelity.exact(problem.fidelity.samples))
    needed = problem.at(choice.fidelity) if choice.numbers[0] else replace(problem, points=())
    short, whole = (1e3 * timed(partial(_objective, variant))[1] for variant in (needed, exact))
    return short, whole


def _objective(problem: Problem) -> float:
    return objective_value(problem, evaluate(problem))


def traded(
    paths: Sequence[Path], folder: Path, say: Callable[[str], None]
) -> tuple[list[tuple[Document, str]], Callable[[], str]]:
    """Measure error and time of every model fidelity for each problem, and write its page and picture.

    Return the documents to show with the names of their pages, and a function that makes JSON.
    """
    problems = [_with_objective(path) for path in paths]
    for path, problem in zip(paths, problems, strict=True):
        if Kind.FLYWHEEL in open_kinds(problem):
            rule = "is open, but fidelities are compared for a fixed flywheel only"
            raise refused("flywheel", "", rule, "fix the flywheel", path)
    trades, documents = list[Trade](), list[tuple[Document, str]]()
    for path, problem in zip(paths, problems, strict=True):
        try:
            trades.append(trade(problem, lambda text, name=problem.name: say(f"{name}: {text}")))  # type: ignore[misc]
        except SolverError:
            if not trades or not is_time_over():
                raise
            what = f"{len(trades)} of {len(problems)} problems, whose pages are in {folder}"
            raise SolverError(f"the time limit ended the trade after {what}; raise the time limit") from None
        documents.append((_written(path, trades[-1], folder), f"{problem.name}.html"))
    return documents, lambda: "[" + ",\n".join(report.as_json(measured).strip() for measured in trades) + "]\n"


def _written(path: Path, measured: Trade, folder: Path) -> Document:
    """Write the pages of a trade and the picture if there is one; return the document without it."""
    from laufruhe.plots.style import as_svg, save
    from laufruhe.plots.trade import figure, has_picture

    name, command = measured.problem.name, typed("laufruhe", "trade", str(path))
    names = [f"{name}.{end}" for end in ("md", "png", "html")]
    with files.staged(files.FileSet(folder, "--out", "trade", names, adds=True)) as stage:
        pictures = dict[str, str]()
        if has_picture(measured):
            picture = figure(measured)
            save(picture, stage / f"{name}.png")
            pictures[name] = as_svg(picture)
        document = report.trade_document(measured, next(iter(pictures), None), command)
        files.write(stage / f"{name}.md", document.as_markdown(".png"))
        files.write(stage / f"{name}.html", as_html(document, pictures))
    return document


def _with_objective(path: Path) -> Problem:
    problem = load(path)
    if not problem.objective:
        rule, remedy = (
            "is missing, and the accuracy of a fidelity is that of the objective",
            "add [objective] or mounts",
        )
        raise refused("objective", "", rule, remedy, path)
    return problem
