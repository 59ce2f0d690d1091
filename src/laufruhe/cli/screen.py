"""What every command says and how it ends: complaints, exit statuses, progress, and data on the screen."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from laufruhe.errors import InputError, ModelError, SolverError

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def hand_out(text: str, data: str, json: str | None) -> None:
    """Text on the screen, data where they were asked for."""
    typer.echo(text, nl=False, err=json == "-")
    if json == "-":
        typer.echo(data, nl=False)
    elif json is not None:
        from laufruhe.report import files

        with files.staged_file(Path(json), "--json") as place:
            files.write(place, data)


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
        complain(f"{path}: {error}")
        raise typer.Exit(BAD_INPUT) from None
    except SolverError as error:
        complain(f"{path}: {error}")
        raise typer.Exit(FAILED) from None
    except KeyboardInterrupt:
        complain(f"laufruhe: {interrupted}")
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # whoever read the output has gone; click ends quietly
        raise
    except OSError as error:
        complain(f"laufruhe: results cannot be written ({error.strerror or error})")
        raise typer.Exit(FAILED) from None


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Says on a terminal what is going on; silent in a pipe."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True, markup=False).status("starting") as status:
        yield lambda text: status.update(text)
