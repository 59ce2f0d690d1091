"""What every command says and how it ends: complaints, exit statuses, progress, and data on the screen."""

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
from pathlib import Path
from typing import TextIO, TypeAlias

import typer

from laufruhe.errors import Complaint, InputError, LaufruheWarning, ModelError, SolverError, printed, refused
from laufruhe.numerics.progress import Step

QUIET, PLAIN, VERBOSE = -1, 0, 1
_loudness: ContextVar[int] = ContextVar("loudness", default=PLAIN)

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
LONGEST = 10_000
"""Characters of a command that is shown."""
_FULL = (errno.ENOSPC, errno.EDQUOT)

Shown: TypeAlias = str | Callable[[TextIO], None]
"""What a command shows: a text, or what writes one to a screen."""


@contextmanager
def handing_out(json: str | None, *problems: Path) -> Iterator[Callable[[Shown, Callable[[], str]], None]]:
    """Text on the screen, data made where they were asked for; whether that can be written is found out on entry."""
    from laufruhe.report import files

    with ExitStack() as places:
        place = json_file(json, problems, places)

        def hand_out(shown: Shown, data: Callable[[], str]) -> None:
            if not is_quiet():
                stream = sys.stderr if json == "-" else sys.stdout
                if isinstance(shown, str):
                    stream.write(shown)
                else:
                    shown(stream)
                # what cannot be written is told here
                stream.flush()
            if json == "-":
                typer.echo(data(), nl=False)
            elif place is not None:
                files.write(place, data())

        yield hand_out


def json_file(json: str | None, problems: Iterable[Path], places: ExitStack) -> Path | None:
    """Where a copy of the data goes, if one is wanted as a file."""
    from laufruhe.report import files

    if json is None or json == "-":
        return None
    path = Path(json)
    if path.resolve() in [problem.resolve() for problem in problems]:
        raise refused("--json", str(path), "is the problem file", "name another file")
    return places.enter_context(files.staged_file(path, "--json"))


def above_zero(option: str, value: float, example: str, below: float = math.inf) -> float:
    """Refuse a value that is no number above zero, or none below another."""
    if not 0.0 < value < below:
        most = "" if math.isinf(below) else f" and below {below:g}"
        raise refused(option, f"{value:g}", f"must be a number above zero{most}", f"try {example}")
    return value


def share_below_one(option: str, value: float) -> float:
    """Refuse a tolerance that is no share of the objective: all of it or more would mean nothing."""
    return above_zero(option, value, "1e-3", below=1.0)


@contextmanager
def in_time(seconds: float | None) -> Iterator[None]:
    """What is typed as --time-limit: searches within end then, with the best that they have."""
    from laufruhe.numerics.budget import limited

    with limited(seconds if seconds is None else above_zero("--time-limit", seconds, "60")):
        yield


@contextmanager
def at_work(scheduler: str | None) -> Iterator[None]:
    """What is typed as --scheduler: whoever works there does what can be done side by side."""
    if scheduler is None:
        yield
        return
    from laufruhe.numerics.cluster import cluster
    from laufruhe.numerics.workers import working_on

    with cluster(scheduler) as workers, working_on(workers):
        yield


def typed(*words: str) -> str:
    """Return a command as it is typed, with escapes in place of what no screen should be sent."""
    return printed(shlex.join(words), LONGEST)


def complain(lines: str) -> None:
    """To standard error."""
    typer.echo(lines, err=True)


@contextmanager
def exit_statuses(path: Path, interrupted: str = "interrupted, nothing was written") -> Iterator[None]:
    """What went wrong as one line a complaint, and as an exit status."""
    try:
        yield
    except InputError as error:
        complain(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except ModelError as error:
        complain(str(InputError(str(path), (Complaint.of(error, error.where or "problem"),))))
        raise typer.Exit(BAD_INPUT) from None
    except SolverError as error:
        complain(printed(f"{path}: {error}"))
        raise typer.Exit(FAILED) from None
    except (KeyboardInterrupt, typer.Abort) as end:
        # the latter at a question, which stands on the line before
        complain("\n" * isinstance(end, typer.Abort) + f"laufruhe: {interrupted}")
        raise typer.Exit(INTERRUPTED) from None
    except MemoryError:
        complain(f"{printed(str(path))}: needs more memory than there is; ask for less at once")
        raise typer.Exit(FAILED) from None
    except BrokenPipeError:
        # whoever read the output has gone; click ends quietly
        raise
    except OSError as error:
        # what has no name of its own goes to the screen, or to where that was sent
        what = f"'{printed(str(error.filename))}'" if error.filename else "the output"
        remedy = "make room, or name another place" if error.errno in _FULL else "name another place"
        complain(f"laufruhe: {what} cannot be written ({error.strerror or error}); {remedy}")
        raise typer.Exit(FAILED) from None


@contextmanager
def spoken(quiet: bool, verbose: bool) -> Iterator[None]:
    """What is typed as -q and -v, before a command or behind it: nothing but errors is said within, or every step."""
    if quiet and verbose:
        raise refused("-q", "", "is given beside -v", "give one of them")
    before = _loudness.set(QUIET if quiet else VERBOSE if verbose else _loudness.get())
    try:
        yield
    finally:
        _loudness.reset(before)


def is_quiet() -> bool:
    """Whether nothing but errors is wanted, and data where they are asked for."""
    return _loudness.get() == QUIET


def loudness() -> int:
    """What is typed as -q and -v."""
    return _loudness.get()


def speak(loud: int) -> None:
    """In a process that a command has made: be as loud as it."""
    _loudness.set(loud)
    warn_plainly()


def open_closed_streams() -> None:
    """Give the command the standard streams that its caller closed, so that no file of results takes their numbers.

    Nothing comes from such an input, and what is said to such an error stream is lost. An output refuses what is
    written, as a full device does: the answer was asked for there.
    """
    for name, access in (("stdin", os.O_RDONLY), ("stdout", os.O_RDONLY), ("stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, os.fdopen(os.open(os.devnull, access), mode, encoding="utf-8"))


def warn_plainly() -> None:
    """Warnings of this package as lines of the command; none with -q."""
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
    """Says what is going on: in place on a terminal, line by line with -v; silent in a pipe, and with -q."""
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
    """Seconds between two words of one search: in place more often than as lines."""
    return 2.0 if _loudness.get() == VERBOSE else 0.1


class Watched:
    """Listens to searches: says how far they are, with the best value so far, its bound, and the gap.

    Of searches within each other, the value is that of the outermost one that has one.
    """

    def __init__(self, say: Callable[[str], None], unit: str) -> None:
        self._say, self._unit = say, unit
        self._known: dict[int, Step] = {}
        self._next = 0.0

    def __call__(self, step: Step) -> None:
        """One step; few of many are said."""
        depth = len(step.within)
        self._known = {at: known for at, known in self._known.items() if at < depth} | {depth: step}
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + pace()
            valued = next((known for known in self._known.values() if math.isfinite(known.value)), step)
            self._say(", ".join([*step.within, self._counted(step), *self._standing(valued)]))

    def _counted(self, step: Step) -> str:
        if step.whole:
            return f"{step.what}: {step.done} of {step.whole}"
        return f"{step.what}: {step.done}" if step.done else step.what

    def _standing(self, step: Step) -> Iterator[str]:
        from laufruhe.present.numbers import figure
        from laufruhe.prove.certificate import USELESS

        if math.isfinite(step.value):
            yield f"best {figure(step.value, self._unit)}"
        if math.isfinite(step.bound) and step.bound > 0.0:
            yield f"bound {figure(step.bound, self._unit)}"
        if step.gap < USELESS:
            yield f"gap {100.0 * step.gap:.2g} %"
