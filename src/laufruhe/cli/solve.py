"""What solve, evaluate and check do with what was typed: problem in, result out, files in their place."""

from __future__ import annotations

import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.cli.screen import complain
from laufruhe.errors import Complaint, InputError, SolverError

if TYPE_CHECKING:
    from laufruhe.problem.problem import Problem
    from laufruhe.solvers.result import Result

Answer = Callable[["Problem", Callable[[str], None]], "Result"]


@dataclass(frozen=True)
class Request:
    """What was typed."""

    verb: str
    problem: Path
    json: str | None
    out: Path | None
    pictures: bool
    tolerance: float | None = None

    @property
    def command(self) -> str:
        """The line that makes the same result again."""
        words = ["laufruhe", self.verb, str(self.problem)]
        return shlex.join(words if self.tolerance is None else [*words, "--tolerance", f"{self.tolerance:g}"])


def written(request: Request, answer: Answer, say: Callable[[str], None]) -> tuple[Result, Path]:
    """The result, its files in place, and the folder that they are in."""
    from laufruhe.files.reader import load
    from laufruhe.report import files
    from laufruhe.report.json_result import as_json
    from laufruhe.report.markdown import as_markdown

    say("reading the problem")
    seconds: dict[str, float] = {}
    with _timed(seconds, "load"):
        problem = _with_tolerance(load(request.problem), request.tolerance)
    with ExitStack() as places:
        option, folder = ("--out", request.out) if request.out is not None else ("results", _default_folder(problem))
        stage = places.enter_context(files.staged(folder, option))
        copy = json_file(request.json, request.problem, places)
        open_numbers = len(problem.decisions)
        what = "stars and firing orders" if problem.phasing is not None else f"{open_numbers} open number(s)"
        say(f"deciding {what}" if open_numbers or problem.phasing is not None else "evaluating")
        result = answer(problem, say)
        pictures: tuple[str, ...] = ()
        if request.pictures:
            from laufruhe.plots import draw

            say("drawing")
            with _timed(seconds, "plots"):
                pictures = draw(result, stage)
        result = replace(result, timing={**result.timing, **seconds})
        text = as_json(result)
        files.write(stage / files.RESULT, text)
        files.write(stage / files.REPORT, as_markdown(result, pictures, request.command))
        if copy is not None:
            files.write(copy, text)
    return result, folder


def json_file(json: str | None, problem: Path, places: ExitStack) -> Path | None:
    """Where a copy of the result goes, if one is wanted as a file."""
    from laufruhe.report import files

    if json is None or json == "-":
        return None
    path = Path(json)
    if path.resolve() == problem.resolve():
        raise InputError("laufruhe", (Complaint("--json", str(path), "is the problem file", "name another file"),))
    return places.enter_context(files.staged_file(path, "--json"))


@contextmanager
def _timed(seconds: dict[str, float], what: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    seconds[what] = time.perf_counter() - started


def solved(problem: Problem, say: Callable[[str], None]) -> Result:
    """The solver's result, or a result that says why there is none."""
    from laufruhe.solvers import solve, state
    from laufruhe.solvers.result import Status

    try:
        return solve(problem, say)
    except SolverError as error:
        return replace(state(problem, to_start_from=True), status=Status.FAILED, message=str(error))


def show_result(result: Result, as_text: bool, folder: Path) -> None:
    """Tables on the screen, or JSON there and tables beside it."""
    from laufruhe.report.json_result import as_json
    from laufruhe.report.screen import show

    if as_text:
        sys.stdout.write(as_json(result))
        sys.stdout.flush()
    show(result, sys.stderr if as_text else sys.stdout, folder)
    if result.status in ("infeasible", "failed"):
        complain(f"{result.problem.name}: {result.status}: {result.message}")


def _default_folder(problem: Problem) -> Path:
    # a file called '...toml' would name the folder above
    return Path("results") / (problem.name.strip(".") or "problem")


def _with_tolerance(problem: Problem, tolerance: float | None) -> Problem:
    return problem if tolerance is None else replace(problem, tolerance=checked_tolerance(tolerance))


def checked_tolerance(tolerance: float) -> float:
    """Refuse a tolerance that is no number above zero."""
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        complaint = Complaint("--tolerance", f"{tolerance:g}", "must be a number above zero", "try 1e-3")
        raise InputError("laufruhe", (complaint,))
    return tolerance
