"""The command line: what is typed, where results go, and what the exit status says.

Heavy imports happen inside the commands, so that `laufruhe --help` answers at once.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn, Optional

import typer

from laufruhe.errors import Complaint, InputError, ModelError, SolverError

if TYPE_CHECKING:
    from laufruhe.problem.model import Problem
    from laufruhe.solvers.result import Result

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

app = typer.Typer(
    name="laufruhe",
    help="Balance designer for piston engines: least mount force, with a proof of how good the design is.",
    epilog="Exit status: 0 done, 1 infeasible or failed, 2 bad input, 130 interrupted.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # plain help needs no rich, and answers twice as fast
    rich_markup_mode=None,
)

ProblemArgument = Annotated[Path, typer.Argument(metavar="PROBLEM", help="Problem file (TOML).", show_default=False)]
JsonOption = Annotated[
    Optional[str],  # noqa: UP045  (typer reads it at run time)
    typer.Option("--json", metavar="FILE", help="Write result.json to FILE too; - prints it, and the table to stderr."),
]
StudyJsonOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--json", metavar="FILE", help="Write all parts as JSON to FILE too; - prints them."),
]
OutOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--out", metavar="DIR", help="Folder of the results.  [default: results/<problem name>]"),
]
NoPlotsOption = Annotated[
    bool, typer.Option("--no-plots", help="Draw no pictures; those of an earlier result are removed.")
]
ToleranceOption = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--tolerance", metavar="X", help="Relative gap that counts as proven, in place of the file's."),
]


@dataclass(frozen=True)
class _Request:
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


@app.command()
def solve(
    problem: ProblemArgument,
    json: JsonOption = None,
    out: OutOption = None,
    no_plots: NoPlotsOption = False,
    tolerance: ToleranceOption = None,
) -> None:
    """Decide what the problem leaves open, and prove how good that is."""
    _run(_Request("solve", problem, json, out, not no_plots, tolerance), _solved)


@app.command()
def evaluate(
    problem: ProblemArgument, json: JsonOption = None, out: OutOption = None, no_plots: NoPlotsOption = False
) -> None:
    """Evaluate the design as given.

    Mount forces and orders of the file's own numbers; nothing is decided.
    """

    def stated(given: Problem) -> Result:
        from laufruhe.solvers import state

        return state(given)

    _run(_Request("evaluate", problem, json, out, not no_plots), stated)


@app.command()
def study(
    problem: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)],
    json: StudyJsonOption = None,
    out: OutOption = None,
    jobs: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option("--jobs", metavar="N", help="Processes that may be used.  [default: one a core]"),
    ] = None,
) -> None:
    """Run the sweeps and comparisons of a study file.

    Finished points are kept; a study that was interrupted goes on where it stopped.
    """
    with _exit_statuses(problem, "interrupted; finished points are kept, the same command goes on"), _progress() as say:
        from laufruhe.cli_study import studied

        text, data = studied(problem, out, jobs, say)
        _hand_out(text, data, json)


@app.command()
def check(problem: ProblemArgument, json: JsonOption = None) -> None:
    """Validate a problem file.

    Says what it leaves open; nothing is solved, and no results folder is made.
    """
    with _exit_statuses(problem), ExitStack() as places:
        from laufruhe.problem.reader import load
        from laufruhe.report import files
        from laufruhe.report.json_result import as_json
        from laufruhe.report.wording import one_line
        from laufruhe.solvers import state

        json_file = _json_file(_Request("check", problem, json, None, False), places)
        given = load(problem)
        # a load that no mount carries, or a gas cycle that cannot be met, shows only here
        stated = state(given)
        if json_file is not None:
            files.write(json_file, as_json(stated))
        if json == "-":
            sys.stdout.write(as_json(stated))
        typer.echo(f"ok: {one_line(given)}", err=json == "-")


FidelityTolerance = Annotated[
    float, typer.Option("--tolerance", metavar="X", help="Relative error of the objective that is allowed.")
]


@app.command()
def explain(problem: ProblemArgument, json: JsonOption = None, tolerance: FidelityTolerance = 1e-3) -> None:
    """Say what of the physics this scene needs, what it does not, and why."""
    with _exit_statuses(problem):
        from laufruhe.cli_fidelity import explained

        _checked_tolerance(tolerance)
        text, data = explained(problem, tolerance)
        _hand_out(text, data, json)


@app.command()
def trade(
    problems: Annotated[list[Path], typer.Argument(metavar="PROBLEM...", help="Problem files.", show_default=False)],
    json: JsonOption = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", metavar="DIR", help="Folder of the pages.  [default: results/trade]"),
    ] = None,
) -> None:
    """Measure speed against accuracy of every fidelity, on these problems."""
    with _exit_statuses(problems[0]), _progress() as say:
        from laufruhe.cli_fidelity import traded

        text, data = traded(problems, out or Path("results") / "trade", say)
        _hand_out(text, data, json)


def _hand_out(text: str, data: str, json: str | None) -> None:
    """Text on the screen, data where they were asked for."""
    typer.echo(text, nl=False, err=json == "-")
    if json == "-":
        typer.echo(data, nl=False)
    elif json is not None:
        from laufruhe.report import files

        with files.staged_file(Path(json), "--json") as place:
            files.write(place, data)


def _checked_tolerance(tolerance: float) -> None:
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        complaint = Complaint("--tolerance", f"{tolerance:g}", "must be a number above zero", "try 1e-3")
        raise InputError("laufruhe", (complaint,))


def _show_version(wanted: bool) -> None:
    if wanted:
        from laufruhe.report.versions import version_of

        typer.echo(f"laufruhe {version_of('laufruhe')}")
        raise typer.Exit(DONE)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point of the `laufruhe` command; ends the process."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # a terminal that knows no Greek gets an escape in place of a traceback
            stream.reconfigure(errors="backslashreplace")
    try:
        app()
    except SystemExit as end:
        _leave(end.code if isinstance(end.code, int) else DONE)


def _leave(status: int) -> NoReturn:
    """End at once: taking the imported solvers apart would cost a fifth of the whole run.

    It also keeps the status. After an interrupted import Python would kill itself by the
    signal in its place.
    """
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        status = status or FAILED
    os._exit(status)


def _run(request: _Request, answer: Callable[[Problem], Result]) -> NoReturn:
    """Read, answer, write and show; leaves with the exit status of the result."""
    with _exit_statuses(request.problem):
        with _progress() as say:
            result, folder = _written(request, answer, say)
        _show(result, request.json == "-", folder)
        raise typer.Exit(DONE if result.status in ("optimal", "feasible") else FAILED)
    raise AssertionError("unreachable")


def _written(request: _Request, answer: Callable[[Problem], Result], say: Callable[[str], None]) -> tuple[Result, Path]:
    """The result, its files in place, and the folder that they are in."""
    from laufruhe.problem.reader import load
    from laufruhe.report import files
    from laufruhe.report.json_result import as_json
    from laufruhe.report.markdown import as_markdown

    say("reading the problem")
    clock = _Clock()
    problem = _with_tolerance(load(request.problem), request.tolerance)
    clock.stop("load")
    with ExitStack() as places:
        option, folder = ("--out", request.out) if request.out is not None else ("results", _default_folder(problem))
        stage = places.enter_context(files.staged(folder, option))
        json_file = _json_file(request, places)
        open_numbers = len(problem.decisions) + len(problem.mount_design.decisions)
        what = "stars and firing orders" if problem.phasing is not None else f"{open_numbers} open number(s)"
        say(f"deciding {what}" if open_numbers or problem.phasing is not None else "evaluating")
        result = answer(problem)
        pictures: tuple[str, ...] = ()
        if request.pictures:
            from laufruhe.plots import draw

            say("drawing")
            clock.start()
            pictures = draw(result, stage)
            clock.stop("plots")
        result = replace(result, timing={**result.timing, **clock.seconds})
        text = as_json(result)
        files.write(stage / files.RESULT, text)
        files.write(stage / files.REPORT, as_markdown(result, pictures, request.command))
        if json_file is not None:
            files.write(json_file, text)
    return result, folder


def _json_file(request: _Request, places: ExitStack) -> Path | None:
    from laufruhe.report import files

    if request.json in (None, "-"):
        return None
    path = Path(str(request.json))
    if path.resolve() == request.problem.resolve():
        raise InputError("laufruhe", (Complaint("--json", str(path), "is the problem file", "name another file"),))
    return places.enter_context(files.staged_file(path, "--json"))


class _Clock:
    """Seconds by what they were spent on."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.start()

    def start(self) -> None:
        """Count from now."""
        self._started = time.perf_counter()

    def stop(self, what: str) -> None:
        """Book the time since the start."""
        self.seconds[what] = time.perf_counter() - self._started


def _solved(problem: Problem) -> Result:
    """The solver's result, or a result that says why there is none."""
    from laufruhe.solvers import solve, state
    from laufruhe.solvers.result import Status

    try:
        return solve(problem)
    except SolverError as error:
        return replace(state(problem), status=Status.FAILED, message=str(error))


def _show(result: Result, as_text: bool, folder: Path) -> None:
    from laufruhe.report.json_result import as_json
    from laufruhe.report.tables import show

    if as_text:
        sys.stdout.write(as_json(result))
        sys.stdout.flush()
    show(result, sys.stderr if as_text else sys.stdout, folder)
    if result.status in ("infeasible", "failed"):
        _complain(f"{result.problem.name}: {result.status}: {result.message}")


def _default_folder(problem: Problem) -> Path:
    # a file called '...toml' would name the folder above
    return Path("results") / (problem.name.strip(".") or "problem")


def _with_tolerance(problem: Problem, tolerance: float | None) -> Problem:
    if tolerance is None:
        return problem
    _checked_tolerance(tolerance)
    return replace(problem, tolerance=tolerance)


def _complain(lines: str) -> None:
    typer.echo(lines, err=True)


@contextmanager
def _exit_statuses(path: Path, interrupted: str = "interrupted, nothing was written") -> Iterator[None]:
    """What went wrong as one line a complaint, and as an exit status."""
    try:
        yield
    except InputError as error:
        _complain(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except ModelError as error:
        _complain(f"{path}: {error}")
        raise typer.Exit(BAD_INPUT) from None
    except KeyboardInterrupt:
        _complain(f"laufruhe: {interrupted}")
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # whoever read the output has gone; click ends quietly
        raise
    except OSError as error:
        _complain(f"laufruhe: results cannot be written ({error.strerror or error})")
        raise typer.Exit(FAILED) from None


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Says on a terminal what is going on; silent in a pipe."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True, markup=False).status("starting") as status:
        yield lambda text: status.update(text)
