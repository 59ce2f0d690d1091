"""Commands `explain` and `trade` on speed and accuracy of models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from laufruhe.cli.screen import typed
from laufruhe.errors import SolverError, refused
from laufruhe.fidelity.automatic import Choice, choose
from laufruhe.fidelity.mount_needs import needs
from laufruhe.files.reader import load, load_tables, tables_of
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import current_executor, executor_for, unordered_map, worker_count
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report import explain, files
from laufruhe.report import trade as report
from laufruhe.report.document import Document
from laufruhe.report.web_page import as_html
from laufruhe.studies.trade import Trade, effort, timed, trade, traded_part

Pages = dict[str, bytes]
"""Contents of files by their names."""


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


def traded(paths: Sequence[Path], folder: Path, say: Callable[[str], None]) -> tuple[Document, str, Callable[[], str]]:
    """Measure error and time of every model fidelity for each problem, and write pages and pictures.

    Several problems get an index. Problems with an open flywheel are left out. Return the document to show, the name
    of its page, and a function that makes JSON.
    """
    read = [(path, _with_objective(path)) for path in paths]
    of_wheels = [(path, problem.name) for path, problem in read if Kind.FLYWHEEL in open_kinds(problem)]
    if len(of_wheels) == len(read):
        rule = "is open, but fidelities are compared for a fixed flywheel only"
        raise refused("flywheel", "", rule, "fix the flywheel", of_wheels[0][0])
    paths, problems = zip(
        *((path, problem) for path, problem in read if Kind.FLYWHEEL not in open_kinds(problem)), strict=True
    )
    trades: dict[int, Trade] = {}
    for k, trade_result, pages in _measured(paths, problems, say):
        trades[k] = trade_result
        names = [f"{problems[k].name}.{end}" for end in ("md", "png", "html")]
        with files.staged(files.FileSet(folder, "--out", "trade", names, adds=True)) as stage:
            for name, page in pages.items():
                (stage / name).write_bytes(page)
    if len(trades) < len(problems):
        what = f"{len(trades)} of {len(problems)} problems, whose pages are in {folder}"
        raise SolverError(f"the time limit ended the trade after {what}; raise the time limit")
    ordered = [trades[k] for k in range(len(problems))]

    def as_json() -> str:
        return "[" + ",\n".join(report.as_json(trade_result).strip() for trade_result in ordered) + "]\n"

    if len(read) == 1:
        return _page(paths[0], ordered[0]), f"{problems[0].name}.html", as_json
    index = report.index(ordered, [name for _, name in of_wheels])
    with files.staged(files.FileSet(folder, "--out", "trade", ["README.md"], adds=True)) as stage:
        files.write(stage / "README.md", index.as_markdown(""))
    return index, "README.md", as_json


def _measured(
    paths: Sequence[Path], problems: Sequence[Problem], say: Callable[[str], None]
) -> Iterator[tuple[int, Trade, Pages]]:
    """Yield index, measurements and pages of every problem; several are measured in parallel."""
    if len(problems) == 1 and current_executor() is None:
        trade_result = trade(problems[0], lambda text: say(f"{problems[0].name}: {text}"))
        yield 0, trade_result, _pages(paths[0], trade_result)
        return
    # the longest comes first, so that all end at about the same time
    order = sorted(range(len(problems)), key=lambda k: effort(problems[k]), reverse=True)
    pieces = [(paths[k], tables_of(paths[k])) for k in order]
    with (
        executor_for(min(len(pieces), worker_count())) as executor,
        closing(unordered_map(_measured_by_worker, pieces, executor, patient=True)) as answers,
    ):
        for place, answer in answers:
            if answer is not None:
                k, (trade_result, pages) = order[place], answer
                say(f"{problems[k].name} is measured")
                yield k, replace(trade_result, problem=traded_part(problems[k])), pages


def _measured_by_worker(piece: tuple[Path, dict[str, Any]]) -> tuple[Trade, Pages] | None:
    # functions have no pickle; a worker without time has no answer
    path, tables = piece
    try:
        trade_result = trade(load_tables(tables, path))
    except SolverError:
        if is_time_over():
            return None
        raise
    return replace(trade_result, problem=replace(trade_result.problem, phasing=None)), _pages(path, trade_result)


def _pages(path: Path, trade_result: Trade) -> Pages:
    # the pages are Markdown, HTML, and the picture if there is one
    from laufruhe.plots.style import as_png, as_svg
    from laufruhe.plots.trade import figure, has_picture

    name, pages, pictures = trade_result.problem.name, Pages(), dict[str, str]()
    if has_picture(trade_result):
        picture = figure(trade_result)
        pages[f"{name}.png"], pictures[name] = as_png(picture), as_svg(picture)
    document = _page(path, trade_result, next(iter(pictures), None))
    texts = {"md": document.as_markdown(".png"), "html": as_html(document, pictures)}
    return pages | {f"{name}.{end}": text.encode() for end, text in texts.items()}


def _page(path: Path, trade_result: Trade, picture: str | None = None) -> Document:
    return report.trade_document(trade_result, picture, typed("laufruhe", "trade", str(path)))


def _with_objective(path: Path) -> Problem:
    problem = load(path)
    if not problem.objective:
        rule, remedy = (
            "is missing, and the accuracy of a fidelity is that of the objective",
            "add [objective] or mounts",
        )
        raise refused("objective", "", rule, remedy, path)
    return problem
