"""Commands, their options, and the exit status.

Heavy imports happen inside the commands, so that `laufruhe --help` answers at once.
"""

from __future__ import annotations

import gc
import os
import sys
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup
from typer.main import get_command_from_info, get_command_name
from typer.models import CommandInfo

from laufruhe import __version__
from laufruhe.cli import options as o
from laufruhe.cli.drawing import SELDOM, artist
from laufruhe.cli.screen import (
    DONE,
    FAILED,
    INTERRUPTED,
    Request,
    command_line,
    complain,
    exit_statuses,
    handing_out,
    open_closed_streams,
    progress,
    resources,
    spoken,
    warn_plainly,
)
from laufruhe.cli.supervised import is_interrupted, listen, supervised
from laufruhe.errors import refused
from laufruhe.extension import HOMES, extended, missing_extension
from laufruhe.numerics.cores import ONE_THREAD


class _Commands(TyperGroup):
    """Commands of the core and of extensions; an option of a command is written after the command."""

    @cached_property
    def _further(self) -> dict[str, Any]:
        commands = extended("commands", CommandInfo, app.registered_commands, _name)
        return {
            name: get_command_from_info(command, pretty_exceptions_short=False, rich_markup_mode=None)
            for name, command in commands.items()
            if name not in self.commands
        }

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands, those of extensions last."""
        return [*super().list_commands(ctx), *self._further]

    def get_command(self, ctx: Any, name: str) -> Any:
        """Return the command of this name; commands of extensions are imported only for a name that the core lacks."""
        return super().get_command(ctx, name) or self._further.get(name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that is typed, or name the extension that it needs."""
        if args[0] in HOMES["commands"] and self.get_command(ctx, args[0]) is None:
            raise refused(args[0], "", *missing_extension(HOMES["commands"][args[0]]))
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as typer, but explain an option that belongs after the command."""
        before = [arg.partition("=")[0] for arg in takewhile(lambda arg: arg.startswith("-"), args)]
        common = {option for param in self.get_params(ctx) for option in param.opts}
        for option in (option for option in before if option not in common):
            commands = {**self.commands, **self._further}
            takers = [
                name for name, command in commands.items() if any(option in param.opts for param in command.params)
            ]
            if takers:
                command = next((word for word in args if word in takers), takers[0])
                remedy = f"write it there, as in: laufruhe {command} ... {option}"
                with exit_statuses(Path("laufruhe")):
                    raise refused(option, "", "belongs after the command", remedy)
        return super().parse_args(ctx, args)

    def make_context(self, *args: Any, **kwargs: Any) -> Any:
        """Make a context as typer, but report an interrupt."""
        with exit_statuses(Path("laufruhe")):
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Invoke as typer, but report an interrupt."""
        with exit_statuses(Path("laufruhe")):
            return super().invoke(ctx)


def _name(command: CommandInfo) -> str:
    return command.name or get_command_name(command.callback.__name__)  # type: ignore[union-attr]


app = typer.Typer(
    name="laufruhe",
    cls=_Commands,
    help="Balance designer for piston engines: least mount force, with a proof of how good the design is.",
    epilog="\b\nBegin with:  laufruhe init\nExit status: 0 done, 1 infeasible or failed, 2 bad input, 130 interrupted.",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # plain help needs no rich, and answers twice as fast
    rich_markup_mode=None,
)


@app.command(
    epilog=o.examples("laufruhe solve problem.toml", "laufruhe solve problem.toml --time-limit 60 --json result.json")
)
def solve(
    context: typer.Context,
    problem: o.ProblemArgument,
    json: o.JsonOption = None,
    out: o.OutOption = None,
    no_plots: o.NoPlotsOption = False,
    kind: o.FormatOption = o.Format.SVG,
    tolerance: o.ToleranceOption = None,
    time_limit: o.LimitOption = None,
    solver: o.SolverOption = None,
    scheduler: o.SchedulerOption = None,
    series: o.SeriesOption = False,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Find the best design, and prove how good it is.

    What the problem leaves open is decided; results, pictures and proof go into a folder.
    """
    kinds = () if no_plots else kind.kinds
    with exit_statuses(problem), spoken(quiet, verbose), resources(time_limit, scheduler), artist(kinds) as ask:
        from laufruhe.cli.solve import run, solve

        command = command_line(context)
        run(Request("solve", problem, json, out, kinds, ask, command, tolerance, series, solver), solve)


@app.command(epilog=o.examples("laufruhe evaluate problem.toml --series --json -"))
def evaluate(
    context: typer.Context,
    problem: o.ProblemArgument,
    json: o.JsonOption = None,
    out: o.InitialOutOption = None,
    no_plots: o.NoPlotsOption = False,
    kind: o.FormatOption = o.Format.SVG,
    series: o.SeriesOption = False,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Evaluate the initial design.

    Mount forces and orders of the file's own numbers; nothing is decided.
    """
    kinds = () if no_plots else kind.kinds
    with exit_statuses(problem), spoken(quiet, verbose), artist(kinds) as ask:
        from laufruhe.cli.solve import evaluate, run

        command = command_line(context)
        run(Request("evaluate", problem, json, out, kinds, ask, command, series=series), evaluate)


@app.command(epilog=o.examples("laufruhe study tractor-sweeps.toml --jobs 4"))
def study(
    context: typer.Context,
    problem: o.StudyArgument,
    json: o.StudyJsonOption = None,
    out: o.OutOption = None,
    kind: o.FormatOption = o.Format.SVG,
    jobs: o.JobsOption = None,
    scheduler: o.SchedulerOption = None,
    time_limit: o.StopOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Run the sweeps and comparisons of a study file.

    Finished points are kept; a study that was interrupted goes on where it stopped.
    """
    interrupted = "interrupted; finished points are kept, the same command goes on"
    with (
        exit_statuses(problem, interrupted), spoken(quiet, verbose), handing_out(json, problem) as hand_out,
        resources(time_limit, scheduler), artist(kind.kinds) as ask,
    ):  # fmt: skip
        from laufruhe.cli.study import run_study

        with progress() as say:
            text, data = run_study(problem, out, jobs, say, ask, kind.kinds, command_line(context))
        hand_out(text, data)


@app.command(epilog=o.examples("laufruhe check problem.toml"))
def check(
    problem: o.EitherArgument,
    json: o.JsonOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Validate a problem or study file.

    Says what it leaves open, or how many points it has; nothing is solved, and no results folder is made.
    """
    with exit_statuses(problem), spoken(quiet, verbose), handing_out(json, problem) as hand_out:
        from laufruhe.files.reader import is_study

        if is_study(problem):
            from laufruhe.cli.study import check_study

            hand_out(*check_study(problem))
        else:
            from laufruhe.cli.check import check_problem

            hand_out(*check_problem(problem))


def _show_version(is_requested: bool) -> None:
    if is_requested:
        typer.echo(f"laufruhe {__version__}")
        raise typer.Exit(DONE)


@app.callback()
def _options(
    ctx: typer.Context,
    version: Annotated[  # noqa: ARG001
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    with exit_statuses(Path("laufruhe")):
        ctx.with_resource(spoken(quiet, verbose))


def main() -> None:
    """Entry point of the `laufruhe` command; ends the process."""
    # classes of models and marks of pictures are many, and little of them is garbage
    gc.set_threshold(SELDOM)
    if not ONE_THREAD.keys() & os.environ.keys():
        os.environ.update(ONE_THREAD)
    # an unknown backend would end the import of matplotlib
    os.environ.pop("MPLBACKEND", None)
    open_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # a terminal without Greek gets an escape in place of a traceback
            stream.reconfigure(errors="backslashreplace")
    warn_plainly()
    supervised(_run)


def _run() -> NoReturn:
    try:
        listen()
        app()
    except SystemExit as end:
        _leave(end.code if isinstance(end.code, int) else DONE)
    except BaseException:
        # a library may turn an interrupt into another error
        if not is_interrupted():
            raise
        complain("laufruhe: interrupted, nothing was written")
        _leave(INTERRUPTED)
    _leave(DONE)


def _leave(status: int) -> NoReturn:
    # the process ends at once: unloading imported solvers would cost a fifth of the whole run;
    # after an interrupted import Python would end by the signal, and lose the status
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        status = status or FAILED
    os._exit(status)
