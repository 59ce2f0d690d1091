"""The two commands on speed and accuracy: what they compute and what they write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe.cli.screen import typed
from laufruhe.errors import SolverError, refused
from laufruhe.fidelity.automatic import Choice, choose
from laufruhe.fidelity.mount_needs import needs
from laufruhe.files.reader import load, load_tables, tables_of
from laufruhe.load_models.batch import prepare
from laufruhe.numerics.budget import passed
from laufruhe.numerics.workers import count_of, each, executor_for, given
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import kinds_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report import explain, files
from laufruhe.report import trade as report
from laufruhe.report.document import Document
from laufruhe.report.web_page import as_html
from laufruhe.studies.trade import Trade, effort, seconds, trade, traded_part

Pages = dict[str, bytes]
"""What is written, by the names of the files."""


def explained(path: Path, tolerance: float) -> tuple[str, Callable[[], str]]:
    """Text of what a scene needs, and what makes JSON of it."""
    problem = _with_objective(path)
    if problem.load_terms:
        choice, times = choose(problem, tolerance), _load_times
    else:
        choice, times = needs(problem), _mount_times
    both = times(problem, choice)
    return explain.as_text(problem, choice, tolerance, both), lambda: explain.as_json(problem, choice, tolerance, both)


def _load_times(problem: Problem, choice: Choice) -> tuple[float, float]:
    """Milliseconds of another design, as chosen and exact over the whole cycle."""
    whole = Fidelity(samples=problem.fidelity.samples, crank_inertia=problem.fidelity.crank_inertia)
    times = []
    for fidelity, prune in ((choice.fidelity, True), (whole, False)):
        # the rest as given: what it costs to evaluate does not change with it
        fixed = replace(problem, fidelity=fidelity, decisions=problem.unbalances, phasing=None)
        designs = prepare(fixed, prune)
        start = np.zeros((1, 1 + designs.columns))
        times.append(1e3 * seconds(lambda d=designs, x=start: d.of_columns(x)))  # type: ignore[misc]
    return times[0], times[1]


def _mount_times(problem: Problem, choice: Choice) -> tuple[float, float]:
    """Milliseconds of what is asked of mounts, with the loads that it needs and with all."""
    needed = problem if choice.numbers[0] else replace(problem, points=())
    times = [1e3 * seconds(lambda p=p: objective_value(p, evaluate(p))) for p in (needed, problem)]  # type: ignore[misc]
    return times[0], times[1]


def traded(paths: Sequence[Path], folder: Path, say: Callable[[str], None]) -> tuple[Document, str, Callable[[], str]]:
    """Pages and pictures of every problem, an index of several; what is to be shown, the page of it, and JSON."""
    read = [(path, _with_objective(path)) for path in paths]
    of_wheels = [(path, problem.name) for path, problem in read if Kind.FLYWHEEL in kinds_of(problem)]
    if len(of_wheels) == len(read):
        rule = "is open, and no cheap model is traded for a flywheel that keeps its limits"
        raise refused("flywheel", "", rule, "fix it", of_wheels[0][0])
    paths, problems = zip(
        *((path, problem) for path, problem in read if Kind.FLYWHEEL not in kinds_of(problem)), strict=True
    )
    found: dict[int, Trade] = {}
    for k, one, pages in _measured(paths, problems, say):
        found[k] = one
        names = [f"{problems[k].name}.{end}" for end in ("md", "png", "html")]
        with files.staged(files.Set(folder, "--out", "trade", names, adds=True)) as stage:
            for name, page in pages.items():
                (stage / name).write_bytes(page)
    if len(found) < len(problems):
        what = f"{len(found)} of {len(problems)} problems are measured, with pages in {folder}"
        raise SolverError(f"the time limit is over: {what}; raise it")
    trades = [found[k] for k in range(len(problems))]
    if len(read) == 1:
        return _page(paths[0], trades[0]), f"{problems[0].name}.html", lambda: _together(trades)
    index = report.index(trades, [name for _, name in of_wheels])
    with files.staged(files.Set(folder, "--out", "trade", ["README.md"], adds=True)) as stage:
        files.write(stage / "README.md", index.as_markdown(""))
    return index, "README.md", lambda: _together(trades)


def _together(trades: Sequence[Trade]) -> str:
    """JSON of them all."""
    return "[" + ",\n".join(report.as_json(one).strip() for one in trades) + "]\n"


def _measured(
    paths: Sequence[Path], problems: Sequence[Problem], say: Callable[[str], None]
) -> Iterator[tuple[int, Trade, Pages]]:
    """One problem measured here, several side by side, as they come; with its pages."""
    if len(problems) == 1 and given() is None:
        one = trade(problems[0], lambda text: say(f"{problems[0].name}: {text}"))
        yield 0, one, _pages(paths[0], one)
        return
    # what takes long comes first, so that the last to end are short
    order = sorted(range(len(problems)), key=lambda k: effort(problems[k]), reverse=True)
    pieces = [(paths[k], tables_of(paths[k])) for k in order]
    with (
        executor_for(min(len(pieces), count_of())) as executor,
        closing(each(_measured_there, pieces, executor, patient=True)) as answers,
    ):
        for place, answer in answers:
            if answer is not None:
                k, (one, pages) = order[place], answer
                say(f"{problems[k].name} is measured")
                yield k, replace(one, problem=traded_part(problems[k])), pages


def _measured_there(piece: tuple[Path, dict[str, Any]]) -> tuple[Trade, Pages] | None:
    """By a worker, which has no use for the file; what of the problem is no number stays there. None out of time."""
    path, tables = piece
    try:
        one = trade(load_tables(tables, path))
    except SolverError:
        if passed():
            return None
        raise
    return replace(one, problem=replace(one.problem, phasing=None)), _pages(path, one)


def _pages(path: Path, one: Trade) -> Pages:
    """What is written of a problem: its page, in two forms, and the picture where there is one."""
    from laufruhe.plots.style import as_png, as_svg
    from laufruhe.plots.trade import figure, has_picture

    name, pages, pictures = one.problem.name, Pages(), dict[str, str]()
    if has_picture(one):
        drawn = figure(one)
        pages[f"{name}.png"], pictures[name] = as_png(drawn), as_svg(drawn)
    document = _page(path, one, next(iter(pictures), None))
    texts = {"md": document.as_markdown(".png"), "html": as_html(document, pictures)}
    return pages | {f"{name}.{end}": text.encode() for end, text in texts.items()}


def _page(path: Path, one: Trade, picture: str | None = None) -> Document:
    """The page of a problem; a picture by its name."""
    return report.trade_document(one, picture, typed("laufruhe", "trade", str(path)))


def _with_objective(path: Path) -> Problem:
    problem = load(path)
    if not problem.objective:
        rule, remedy = "is missing: accuracy is that of an objective", "add [objective] or mounts"
        raise refused("objective", "", rule, remedy, path)
    return problem
