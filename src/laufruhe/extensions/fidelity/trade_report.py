"""Pages on time and error of every fidelity, with a recommendation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

from laufruhe.cli.screen import typed
from laufruhe.errors import SolverError, refused
from laufruhe.extensions.fidelity.trade import (
    KEEPS,
    REFERENCE_NAME,
    Trade,
    TradeRow,
    is_open,
    problem_with_objective,
    trade,
)
from laufruhe.extensions.fidelity.trade_picture import figure as picture_of
from laufruhe.extensions.fidelity.trade_picture import has_picture
from laufruhe.numerics.budget import is_time_over
from laufruhe.plots.style import as_svg, save
from laufruhe.present.numbers import DASH, figure, fixed, number
from laufruhe.present.static_load import static_sentence
from laufruhe.present.tables import Table
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.report import files
from laufruhe.report.document import Block, Code, Document, Illustration, Paragraph
from laufruhe.report.screen import show_document
from laufruhe.report.strict_json import strict
from laufruhe.report.web_page import as_html

ALIKE, WITHIN, SMALLEST = 1.3, 1e-3, 1e-4
"""Factor between times that count as equal, error of a good choice, and smallest share that is stated."""
HEAD = (
    "fidelity", "error", "error estimate", "evaluate", "solve", "scene of a sweep", "10,000 designs",
    "their largest error", "memory", "regret", "regret bound",
)  # fmt: skip
COLUMNS = (
    "**Evaluate, solve**: processor time of these calls of Python, of a problem that is loaded, after a first call. "
    "**Scene of a sweep**: mean solve of a study at other speeds. **10,000 designs**: `evaluate_many` of random "
    "designs between their bounds; only if all open numbers are unbalances. **Memory**: largest memory of the solve, "
    "or of the evaluation if nothing is open, in Python and NumPy (tracemalloc); a solve of 2 s or more is not "
    "repeated for it. "
    "**Regret**: exact objective of this fidelity's design over that of the best design known, minus one. "
    "**Regret bound**: what `solve` states of it. A design that breaks a limit by more than 0.1 % in the exact "
    "model shows that excess instead. `auto` computes all physics in a solve, and takes fewer samples for many designs."
)


def traded(
    paths: Sequence[Path], folder: Path, say: Callable[[str], None]
) -> tuple[Callable[[TextIO], None], Callable[[], str]]:
    """Measure time and error of every fidelity for each problem, and write its pages and picture.

    Return a function that prints the pages, and one that returns the measurements as JSON.
    """
    problems = [problem_with_objective(path) for path in paths]
    for path, problem in zip(paths, problems, strict=True):
        if "flywheel" in {kind.name for kind in open_kinds(problem)}:
            rule = "is open, but fidelities are compared for a fixed flywheel only"
            raise refused("flywheel", "", rule, "fix the flywheel", path)
    trades, documents = list[Trade](), list[Document]()
    for path, problem in zip(paths, problems, strict=True):
        try:
            trades.append(trade(problem, lambda text, name=problem.name: say(f"{name}: {text}")))  # type: ignore[misc]
        except SolverError:
            if not trades or not is_time_over():
                raise
            what = f"{len(trades)} of {len(problems)} problems, whose pages are in {folder}"
            raise SolverError(f"the time limit ended the trade after {what}; raise the time limit") from None
        documents.append(_written(path, trades[-1], folder))

    def show(stream: TextIO) -> None:
        for document, measured in zip(documents, trades, strict=True):
            show_document(document, stream, folder, f"{measured.problem.name}.html")

    return show, lambda: "[" + ",\n".join(as_json(measured).strip() for measured in trades) + "]\n"


def _written(path: Path, measured: Trade, folder: Path) -> Document:
    """Write the pages of a trade and the picture if there is one; return the document without it."""
    name, command = measured.problem.name, typed("laufruhe", "trade", str(path))
    names = [f"{name}.{end}" for end in ("md", "png", "html")]
    with files.staged(files.FileSet(folder, "--out", "trade", names, adds=True)) as stage:
        pictures = dict[str, str]()
        if has_picture(measured):
            picture = picture_of(measured)
            save(picture, stage / f"{name}.png")
            pictures[name] = as_svg(picture)
        document = trade_document(measured, next(iter(pictures), None), command)
        files.write(stage / f"{name}.md", document.as_markdown(".png"))
        files.write(stage / f"{name}.html", as_html(document, pictures))
    return document


def trade_document(trade: Trade, picture: str | None, command: str) -> Document:
    """Return the report on the fidelities of one problem: table, picture (if `picture` names one) and advice."""
    problem = trade.problem
    initial, minimum = (figure(value, problem.objective_unit or "", 6) for value in (trade.value, trade.optimum))
    optimum = "" if math.isnan(trade.optimum) else f", of the optimum {minimum}"
    blocks: list[Block] = [
        Paragraph(
            f"Reference: {REFERENCE_NAME} over the cycle; {problem.objective_name} of the initial design {initial}"
            f"{optimum}."
        ),
        Paragraph(f"**Take** {advice(trade)}", marked=True),
    ]
    if picture:
        blocks.append(Illustration(picture, "Time of every fidelity against its regret and its error", False))
    elif not problem.load_terms:
        blocks.append(Paragraph("The objective depends on no load, so every fidelity gives the same number."))
    rows = [
        [row.name, _share(row.error), _share(row.estimate),
         *map(_time, (row.evaluation, row.solve, row.scene, row.batch)), _share(row.batch_error),
         DASH if math.isnan(row.memory) else f"{number(1e-6 * row.memory, 3)} MB", _regret(row),
         _share(row.regret_bound)]
        for row in trade.rows
    ]  # fmt: skip
    blocks.append(Table(HEAD, rows))
    if not trade.is_complete:
        blocks.append(Paragraph("Stopped at the time limit: fidelities beyond the last row were not measured."))
    blocks.append(Paragraph(COLUMNS, marked=True))
    sentences = [static_sentence(problem, evaluate_start(problem)) if problem.load_terms else "", *trade.left_out]
    if trade.flywheel is not None:
        inertia, change = trade.flywheel
        sentences.append(
            f"Constant crank speed: with a flywheel of {inertia:.3g} kg m2 for all that turns, at which the speed "
            f"varies by some 2 %, the objective changes by {fixed(100.0 * change, 2, '+')} %. "
            "No fidelity at constant speed includes this."
        )
    blocks.extend(Paragraph(sentence) for sentence in sentences if sentence)
    return Document(f"Speed against accuracy: {problem.title}", (*blocks, Code(command)))


def advice(trade: Trade) -> str:
    """Return the recommended fidelities in words."""
    one, many = choices(trade)
    texts = []
    if one is not None:
        call, seconds = ("solve", one.solve) if is_open(trade.problem) else ("evaluation", one.evaluation)
        texts.append(f"`{one.name}` for one {call} ({_time(seconds)})")
    if many is not None:
        texts.append(f"`{many.name}` for ten thousand designs ({_time(many.batch)})")
    return ("; ".join(texts) or "the exact model: no other fidelity is within 0.1 %") + "."


def choices(trade: Trade) -> tuple[TradeRow | None, TradeRow | None]:
    """Return the fastest fidelities within 0.1 % for one solve, or one evaluation if nothing is open, and for a batch.

    A solve counts by its regret, and everything else by its error.
    """
    many = [row for row in trade.rows if row.batch_error <= WITHIN]
    if is_open(trade.problem):
        deciding = [row for row in trade.rows if row.decides and (row.regret <= WITHIN or trade.optimum == 0.0)]
        one = _fastest(deciding, lambda row: row.solve)
    else:
        one = _fastest([row for row in trade.rows if row.error <= WITHIN], lambda row: row.evaluation)
    return one, _fastest(many, lambda row: row.batch)


def _fastest(rows: Sequence[TradeRow], time: Callable[[TradeRow], float]) -> TradeRow | None:
    fastest = min(map(time, rows), default=math.nan)
    return min((row for row in rows if time(row) <= ALIKE * fastest), key=lambda row: row.estimate, default=None)


def as_json(trade: Trade) -> str:
    """Return the measurements as JSON."""
    return strict({
        "problem": trade.problem.name,
        "reference": {"objective": trade.value, "optimum": trade.optimum},
        "uneven_speed": trade.flywheel and dict(zip(("crank_inertia", "change"), trade.flywheel, strict=True)),
        "rows": [
            {"excess" if key == "violation" else key: value for key, value in asdict(row).items()}
            for row in trade.rows
        ],
    })  # fmt: skip


def _percent(share: float) -> str:
    if share < SMALLEST:
        return "less than 0.01 %"
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def _time(seconds: float) -> str:
    if math.isnan(seconds):
        return DASH
    if seconds < 1e-3:
        return f"{1e6 * seconds:.0f} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def _share(error: float) -> str:
    if math.isnan(error):
        return DASH
    return f"{error:.1e}" if error else "0"


def _regret(row: TradeRow) -> str:
    if row.violation > KEEPS:
        return f"{_percent(row.violation)} beyond a limit"
    if math.isnan(row.regret):
        return DASH
    # the cone solver is no more accurate
    return "0" if abs(row.regret) < 1e-8 else f"{row.regret:.1e}"
