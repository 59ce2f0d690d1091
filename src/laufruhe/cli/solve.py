"""What solve, evaluate and check do with what was typed: problem in, result out, files in their place."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import typer

from laufruhe.cli.check import doubt
from laufruhe.cli.drawing import Ask, drawing
from laufruhe.cli.screen import DONE, FAILED, Watched, above_zero, complain, is_quiet, json_file, progress
from laufruhe.errors import SolverError
from laufruhe.files.reader import load
from laufruhe.live import live_model
from laufruhe.numerics.progress import Listener
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.problem import Problem
from laufruhe.report import files
from laufruhe.report.json_result import as_json
from laufruhe.report.result_report import result_document
from laufruhe.report.tables import write_tables
from laufruhe.report.web_page import as_html, template
from laufruhe.solvers.result import Result, Status

# each has a folder of its own
_SUFFIX = {"solve": "", "evaluate": "-as-given"}

Answer = Callable[[Problem, Listener], Result]


@dataclass(frozen=True)
class Request:
    """What was typed."""

    verb: str
    problem: Path
    json: str | None
    out: Path | None
    kinds: tuple[str, ...]
    ask: Ask
    animated: bool = False
    tolerance: float | None = None
    series: bool = False

    @property
    def command(self) -> str:
        """The line that makes the same result again."""
        words = ["laufruhe", self.verb, str(self.problem), *(("--series",) if self.series else ())]
        return shlex.join(words if self.tolerance is None else [*words, "--tolerance", f"{self.tolerance:g}"])


def run(request: Request, answer: Answer) -> None:
    """Read, answer, write and show; leaves with the exit status of the result."""
    with progress() as say:
        result, folder = _written(request, answer, say)
    _show(result, as_json(result, request.series) if request.json == "-" else None, folder)
    raise typer.Exit(DONE if result.status.has_design else FAILED)


def stated(problem: Problem, _: Listener) -> Result:
    """The design as given."""
    from laufruhe.solvers import state

    return state(problem)


def solved(problem: Problem, listener: Listener) -> Result:
    """The solver's result, or a result that says why there is none."""
    from laufruhe.solvers import solve, state

    try:
        return solve(replace(problem, sharply=True), listener, further=True)
    except SolverError as error:
        return replace(state(problem, to_start_from=True), status=Status.FAILED, message=str(error))


def _written(request: Request, answer: Answer, say: Callable[[str], None]) -> tuple[Result, Path]:
    """The result, its files in place, and the folder that they are in."""
    say("reading the problem")
    seconds: dict[str, float] = {}
    with _timed(seconds, "load"):
        problem = load(request.problem)
        if request.tolerance is not None:
            problem = replace(problem, tolerance=above_zero("--tolerance", request.tolerance, "1e-3"))
    doubt(problem, request.problem)
    with ExitStack() as places:
        # a file called '...toml' would name the folder above
        name = (problem.name.strip(".") or "problem") + _SUFFIX[request.verb]
        option, folder = ("results", Path("results") / name) if request.out is None else ("--out", request.out)
        stage = places.enter_context(files.staged(files.Set(folder, option, request.verb)))
        copy = json_file(request.json, [request.problem], places)
        open_numbers = len(problem.decisions)
        what = "stars and firing orders" if problem.phasing is not None else f"{open_numbers} open number(s)"
        what = "which parts go where" if problem.assembly else what
        say(f"deciding {what}" if open_numbers or problem.phasing is not None or problem.assembly else "evaluating")
        result = answer(problem, Watched(say, problem.objective_unit or ""))
        drawn = drawing(request.ask, result, stage, request.kinds)
        if request.animated:
            from laufruhe.plots.motion import animate

            say("animating")
            with _timed(seconds, "animation"):
                animate(result, stage / files.MOTION)
        say("writing tables")
        with _timed(seconds, "tables"):
            write_tables(result, stage)
        seconds = {**result.timing, **seconds}
        result = replace(result, timing=seconds)
        live, document = live_model(problem, result), result_document(result, list(PICTURES), request.command)
        if request.kinds:
            say("drawing")
        with _timed(seconds, "plots"):
            _get_ready()
            pictures = drawn()
        document = document.showing(pictures)
        files.write(stage / files.REPORT, document.as_markdown(f".{request.kinds[0]}" if request.kinds else ""))
        files.write(stage / files.PAGE, as_html(document, pictures, live))
        for place in filter(None, (stage / files.RESULT, copy)):
            files.write(place, as_json(result, request.series))
    return result, folder


def _get_ready() -> None:
    """Load what makes the page and the tables on the screen, while pictures are drawn."""
    template()
    if not is_quiet():
        import_module("laufruhe.report.screen")


@contextmanager
def _timed(seconds: dict[str, float], what: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    seconds[what] = time.perf_counter() - started


def _show(result: Result, text: str | None, folder: Path) -> None:
    """Tables on the screen, or JSON there and tables beside it."""
    from laufruhe.report.screen import show

    if text is not None:
        sys.stdout.write(text)
        sys.stdout.flush()
    if not is_quiet():
        show(result, sys.stdout if text is None else sys.stderr, folder)
    if result.status in (Status.INFEASIBLE, Status.FAILED):
        complain(f"{result.problem.name}: {result.status}: {result.message}")
