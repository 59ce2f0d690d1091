"""The command line: what is typed, where results go, and what the exit status says.

Heavy imports happen inside the commands, so that `laufruhe --help` answers at once.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from laufruhe.cli.screen import (
    DONE,
    FAILED,
    INTERRUPTED,
    above_zero,
    at_work,
    exit_statuses,
    handing_out,
    in_time,
    progress,
)
from laufruhe.cli.supervised import supervised

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
JSON = "Write the result as JSON to FILE; - prints it, and the text goes to stderr."
JsonOption = Annotated[str | None, typer.Option("--json", metavar="FILE", help=JSON)]
PARTS = "Write all parts as JSON to FILE; - prints them."
StudyJsonOption = Annotated[str | None, typer.Option("--json", metavar="FILE", help=PARTS)]
OUT = "Folder of the results.  [default: results/<name of the file>, of evaluate <name>-as-given]"
OutOption = Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT)]
PAGES = "Folder of the pages.  [default: results/trade]"
PagesOption = Annotated[Path | None, typer.Option("--out", metavar="DIR", help=PAGES)]
NO_PLOTS = "Draw no pictures; those of an earlier result are removed."
NoPlotsOption = Annotated[bool, typer.Option("--no-plots", help=NO_PLOTS)]
SERIES = "Put the loads over the cycle into the JSON as well."
SeriesOption = Annotated[bool, typer.Option("--series", help=SERIES)]
GAP = "Relative gap that counts as proven, in place of the file's."
ToleranceOption = Annotated[float | None, typer.Option("--tolerance", metavar="X", help=GAP)]
ERROR = "Relative error of the objective that is allowed."
FidelityTolerance = Annotated[float, typer.Option("--tolerance", metavar="X", help=ERROR)]
LIMIT = "Stop after so many seconds with the best design so far and its bound."
LimitOption = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help=LIMIT)]
STOP = "Stop after so many seconds; what is finished is kept."
StopOption = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help=STOP)]
JOBS = "Processes that may be used.  [default: one a core]"
JobsOption = Annotated[int | None, typer.Option("--jobs", metavar="N", help=JOBS)]
SCHEDULER = "Let the Dask workers of the scheduler at ADDRESS do the work."
SchedulerOption = Annotated[str | None, typer.Option("--scheduler", metavar="ADDRESS", help=SCHEDULER)]
StudyArgument = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)]
FROM = "An engine of the catalogue, or a ready problem, to begin with."
COPIED = "Ready problems to copy, with all files that they refer to."
SHOWN = "Engines to show: published figures, source, and what is assumed."
Problems = Annotated[list[Path], typer.Argument(metavar="PROBLEM...", help="Problem files.", show_default=False)]


@app.command()
def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Problem file to write.")] = Path("problem.toml"),
    name: Annotated[str | None, typer.Option("--from", metavar="NAME", help=FROM)] = None,
) -> None:
    """Write a problem file to begin with, commented, and the schema that editors check it by.

    Asks what it is about, unless --from says so.
    """
    with exit_statuses(file):
        from laufruhe.cli.begin import begun

        typer.echo(begun(file, name), nl=False)


@app.command()
def examples(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME...]", help=COPIED, show_default=False)] = None,
    to: Annotated[Path, typer.Option("--to", metavar="DIR", help="Folder of the copies.")] = Path(),
) -> None:
    """List the ready problems by what they are for, or copy some of them."""
    with exit_statuses(to):
        from laufruhe.cli.begin import copied, listed

        typer.echo(copied(names, to) if names else listed(), nl=False)


@app.command()
def engines(
    names: Annotated[list[str] | None, typer.Argument(metavar="[KEY...]", help=SHOWN, show_default=False)] = None,
) -> None:
    """List the engines of the catalogue, or show what is published of some of them."""
    with exit_statuses(Path("laufruhe")):
        from laufruhe.cli.begin import catalogue, described

        typer.echo(described(names) if names else catalogue(), nl=False)


@app.command()
def solve(
    problem: ProblemArgument,
    json: JsonOption = None,
    out: OutOption = None,
    no_plots: NoPlotsOption = False,
    tolerance: ToleranceOption = None,
    time_limit: LimitOption = None,
    series: SeriesOption = False,
) -> None:
    """Decide what the problem leaves open, and prove how good that is."""
    with exit_statuses(problem), in_time(time_limit):
        from laufruhe.cli.solve import Request, run, solved

        run(Request("solve", problem, json, out, not no_plots, tolerance, series), solved)


@app.command()
def evaluate(
    problem: ProblemArgument,
    json: JsonOption = None,
    out: OutOption = None,
    no_plots: NoPlotsOption = False,
    series: SeriesOption = False,
) -> None:
    """Evaluate the design as given.

    Mount forces and orders of the file's own numbers; nothing is decided.
    """
    with exit_statuses(problem):
        from laufruhe.cli.solve import Request, run, stated

        run(Request("evaluate", problem, json, out, not no_plots, series=series), stated)


@app.command()
def study(
    problem: StudyArgument,
    json: StudyJsonOption = None,
    out: OutOption = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    time_limit: StopOption = None,
) -> None:
    """Run the sweeps and comparisons of a study file.

    Finished points are kept; a study that was interrupted goes on where it stopped.
    """
    kept = "interrupted; finished points are kept, the same command goes on"
    with (
        exit_statuses(problem, kept), in_time(time_limit), handing_out(json, problem) as hand_out, at_work(scheduler),
    ):  # fmt: skip
        from laufruhe.cli.study import studied

        with progress() as say:
            found = studied(problem, out, jobs, say)
        hand_out(*found)


@app.command()
def check(problem: ProblemArgument, json: JsonOption = None) -> None:
    """Validate a problem or study file.

    Says what it leaves open, or how many points it has; nothing is solved, and no results folder is made.
    """
    with exit_statuses(problem), handing_out(json, problem) as hand_out:
        from laufruhe.files.reader import is_study

        if is_study(problem):
            from laufruhe.cli.study import checked
        else:
            from laufruhe.cli.solve import checked
        hand_out(*checked(problem))


@app.command()
def explain(problem: ProblemArgument, json: JsonOption = None, tolerance: FidelityTolerance = 1e-3) -> None:
    """Say what of the physics this scene needs, what it does not, and why."""
    with exit_statuses(problem), handing_out(json, problem) as hand_out:
        from laufruhe.cli.fidelity import explained

        hand_out(*explained(problem, above_zero("--tolerance", tolerance, "1e-3")))


@app.command()
def trade(problems: Problems, json: JsonOption = None, out: PagesOption = None, time_limit: StopOption = None) -> None:
    """Measure speed against accuracy of every fidelity, on these problems."""
    with exit_statuses(problems[0]), in_time(time_limit), handing_out(json, *problems) as hand_out, progress() as say:
        from laufruhe.cli.fidelity import traded

        hand_out(*traded(problems, out or Path("results") / "trade", say))


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
    supervised(_run)


def _run() -> NoReturn:
    try:
        app()
    except SystemExit as end:
        _leave(end.code if isinstance(end.code, int) else DONE)
    except KeyboardInterrupt:
        _leave(INTERRUPTED)
    _leave(DONE)


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
