"""Output and end of every command: complaints, exit statuses, progress, and data on the screen."""

from __future__ import annotations

import errno
import math
import os
import shlex
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO, TypeAlias

import typer

from laufruhe.errors import (
    Complaint,
    InputError,
    LaufruheWarning,
    ModelError,
    SolverError,
    optional_libraries,
    printed,
    refused,
)
from laufruhe.numerics.progress import SearchState, Step

QUIET, PLAIN, VERBOSE = -1, 0, 1
_loudness: ContextVar[int] = ContextVar("loudness", default=PLAIN)

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
LONGEST = 10_000
"""Largest number of characters of a printed command."""
_FULL = (errno.ENOSPC, errno.EDQUOT)

Output: TypeAlias = str | Callable[[TextIO], None]
"""Output of a command: a text, or a function that writes one to a stream."""


Ask: TypeAlias = Callable[..., Callable[[], Any]]
"""Function that requests a call by name, and returns a function that waits for the result."""


@dataclass(frozen=True)
class Request:
    """Arguments of `solve` and `evaluate`, and the command line that makes the same result again."""

    verb: str
    problem: Path
    json: str | None
    out: Path | None
    kinds: tuple[str, ...]
    ask: Ask
    command: str
    tolerance: float | None = None
    series: bool = False
    solver: str | None = None


def command_line(context: typer.Context) -> str:
    """Return the command with its arguments and all options that the user gave."""
    words = ["laufruhe", str(context.info_name)]
    for parameter in context.command.params:
        name, value = str(parameter.name), context.params[str(parameter.name)]
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            words += parameter.opts[:1] if parameter.param_type_name == "option" else []
            values = [] if isinstance(value, bool) else value if isinstance(value, list) else [value]
            words += [f"{one:g}" if isinstance(one, float) else str(one) for one in values]
    return typed(*words)


@contextmanager
def timed(seconds: dict[str, float], what: str) -> Iterator[None]:
    """Add the seconds that the block takes to `seconds[what]`."""
    started = time.perf_counter()
    yield
    seconds[what] = seconds.get(what, 0.0) + time.perf_counter() - started


@contextmanager
def handing_out(json: str | None, *problems: Path) -> Iterator[Callable[[Output, Callable[[], str]], None]]:
    """Yield a function that prints text and writes JSON; a file that cannot be written is refused on entry."""
    from laufruhe.report import files

    with ExitStack() as places:
        place = json_file(json, problems, places)

        def hand_out(text: Output, data: Callable[[], str]) -> None:
            if not is_quiet():
                stream = sys.stderr if json == "-" else sys.stdout
                if isinstance(text, str):
                    stream.write(text)
                else:
                    text(stream)
                # errors of writing are raised here
                stream.flush()
            if json == "-":
                typer.echo(data(), nl=False)
            elif place is not None:
                files.write(place, data())

        yield hand_out


def json_file(json: str | None, problems: Iterable[Path], places: ExitStack) -> Path | None:
    """Return the staged path of the JSON file, if one is requested."""
    from laufruhe.report import files

    if json is None or json == "-":
        return None
    path = Path(json)
    if path.resolve() in [problem.resolve() for problem in problems]:
        raise refused("--json", str(path), "is the problem file", "name another file")
    return places.enter_context(files.staged_file(path, "--json"))


def above_zero(option: str, value: float, example: str, below: float = math.inf) -> float:
    """Return an option's value, refused unless it is above zero and below another number."""
    if not 0.0 < value < below:
        maximum = "" if math.isinf(below) else f" and below {below:g}"
        raise refused(option, f"{value:g}", f"must be a number above zero{maximum}", f"try {example}")
    return value


def share_below_one(option: str, value: float) -> float:
    """Return a relative tolerance, refused unless it is between zero and one."""
    return above_zero(option, value, "1e-3", below=1.0)


@contextmanager
def resources(seconds: float | None, scheduler: str | None) -> Iterator[None]:
    """Apply the options --time-limit to searches, and --scheduler to parallel work, within the block."""
    from laufruhe.numerics.budget import limit_time

    with ExitStack() as stack:
        stack.enter_context(limit_time(seconds if seconds is None else above_zero("--time-limit", seconds, "60")))
        if scheduler is not None:
            from laufruhe.numerics.cluster import cluster
            from laufruhe.numerics.workers import working_on

            stack.enter_context(working_on(stack.enter_context(cluster(scheduler))))
        yield


def typed(*words: str) -> str:
    """Return a command as it is typed, with escapes for characters that are not printed."""
    return printed(shlex.join(words), LONGEST)


def complain(lines: str) -> None:
    """Print lines on standard error."""
    typer.echo(lines, err=True)


@contextmanager
def exit_statuses(path: Path, interrupted: str = "interrupted, nothing was written") -> Iterator[None]:
    """Turn errors into one line each and an exit status."""
    try:
        with optional_libraries():
            yield
    except InputError as error:
        complain(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except ModelError as error:
        complain(str(InputError(str(path), (Complaint.from_error(error, error.where or "problem"),))))
        raise typer.Exit(BAD_INPUT) from None
    except SolverError as error:
        complain(printed(f"{path}: {error}"))
        raise typer.Exit(FAILED) from None
    except (KeyboardInterrupt, typer.Abort) as end:
        # an abort at a question leaves the cursor behind it
        complain("\n" * isinstance(end, typer.Abort) + f"laufruhe: {interrupted}")
        raise typer.Exit(INTERRUPTED) from None
    except MemoryError:
        complain(
            f"{printed(str(path))}: needs more memory than this machine has; use fewer samples, draws or processes"
        )
        raise typer.Exit(FAILED) from None
    except BrokenPipeError:
        # the reader of the output has gone; click ends quietly
        raise
    except OSError as error:
        # output without a file name goes to the screen, or where that is redirected
        what = f"'{printed(str(error.filename))}'" if error.filename else "the output"
        remedy = "free disk space, or name another folder" if error.errno in _FULL else "name another place"
        complain(f"laufruhe: {what} cannot be written ({error.strerror or error}); {remedy}")
        raise typer.Exit(FAILED) from None


@contextmanager
def spoken(quiet: bool, verbose: bool) -> Iterator[None]:
    """Apply -q and -v, before a command or behind it."""
    if quiet and verbose:
        raise refused("-q", "", "is given beside -v", "give one of them")
    before = _loudness.set(QUIET if quiet else VERBOSE if verbose else _loudness.get())
    try:
        yield
    finally:
        _loudness.reset(before)


def is_quiet() -> bool:
    """Return True if -q is given: errors and requested data only."""
    return _loudness.get() == QUIET


def loudness() -> int:
    """Return the level of -q and -v."""
    return _loudness.get()


def speak(loud: int) -> None:
    """Set the level of -q and -v in a worker process."""
    _loudness.set(loud)
    warn_plainly()


def open_closed_streams() -> None:
    """Open standard streams that the caller closed, so that no file of results gets their numbers.

    Standard input is then empty, and standard error is lost. Writing to standard output fails, as on a full device.
    """
    for name, access in (("stdin", os.O_RDONLY), ("stdout", os.O_RDONLY), ("stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, os.fdopen(os.open(os.devnull, access), mode, encoding="utf-8"))


def warn_plainly() -> None:
    """Print warnings of this package as single lines; none with -q."""
    usual = warnings.formatwarning

    def format_of(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
    ) -> str:
        if not issubclass(category, LaufruheWarning):
            return usual(message, category, filename, lineno, line)
        return "" if is_quiet() else f"laufruhe: {printed(str(message))}\n"

    warnings.formatwarning = format_of


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Yield a function that reports progress: in place on a terminal, in lines with -v, not in a pipe or with -q."""
    if _loudness.get() == VERBOSE:
        begun = time.monotonic()
        yield lambda text: typer.echo(f"{time.monotonic() - begun:7.1f} s  {text}", err=True)
    elif is_quiet() or not sys.stderr.isatty():
        yield lambda _: None
    else:
        from rich.console import Console

        with Console(stderr=True, markup=False).status("starting") as status:
            yield lambda text: status.update(text)


def pace() -> float:
    """Return the seconds between two reports of a search; reports in lines are less frequent than in place."""
    return 2.0 if _loudness.get() == VERBOSE else 0.1


class Watched:
    """Listener that reports progress of searches at a pace."""

    def __init__(self, say: Callable[[str], None], unit: str) -> None:
        self._say, self._unit = say, unit
        self._state = SearchState()
        self._next = 0.0

    def __call__(self, step: Step) -> None:
        """Report a step, unless the last report was a moment ago."""
        self._state.add(step)
        if step.design is None and time.monotonic() >= self._next:
            self._next = time.monotonic() + pace()
            # imported while a search runs, because commands should answer at once
            from laufruhe.present.progress_text import progress_text

            self._say(progress_text(step, self._state.valued, self._unit))
