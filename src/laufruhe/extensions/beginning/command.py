"""The commands `init`, `examples` and `engines`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli.options import examples as in_help
from laufruhe.cli.screen import exit_statuses


def _completed(kinds: str) -> Callable[[str], list[str]]:
    def names(incomplete: str) -> list[str]:
        from laufruhe.files.catalogue import engines
        from laufruhe.files.ready import ready

        names_by_kind = {"engines": engines, "problems": ready}
        return [name for kind in kinds.split() for name in names_by_kind[kind]() if name.startswith(incomplete)]

    return names


FROM = "Engine of the catalogue, or ready problem, to start from."
COPIED = "Ready problems to copy, with all files that they refer to."
ENGINE = "Engines to show: published figures, source, and assumptions."


def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Problem file to write.")] = Path("problem.toml"),
    name: Annotated[
        str | None, typer.Option("--from", metavar="NAME", help=FROM, autocompletion=_completed("engines problems"))
    ] = None,
) -> None:
    """Write a commented problem file to start from.

    Asks about the engine, unless --from names one. The schema that editors use comes with it.
    """
    with exit_statuses(file):
        from laufruhe.extensions.beginning.files import write_draft

        typer.echo(write_draft(file, name), nl=False)


def examples(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME...]", help=COPIED, show_default=False, autocompletion=_completed("problems")),
    ] = None,
    to: Annotated[Path, typer.Option("--to", metavar="DIR", help="Folder of the copies.")] = Path(),
) -> None:
    """List the ready problems by use, or copy some of them."""
    with exit_statuses(to):
        from laufruhe.extensions.beginning.files import copy_ready, ready_list

        typer.echo(copy_ready(names, to) if names else ready_list(), nl=False)


def engines(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[KEY...]", help=ENGINE, show_default=False, autocompletion=_completed("engines")),
    ] = None,
) -> None:
    """List the engines of the catalogue, or show some."""
    with exit_statuses(Path("laufruhe")):
        from laufruhe.extensions.beginning.files import engine_details, engine_list

        typer.echo(engine_details(names) if names else engine_list(), nl=False)


INIT = CommandInfo(callback=init, epilog=in_help("laufruhe init", "laufruhe init mine.toml --from vw-ea827-2-0"))
EXAMPLES = CommandInfo(
    callback=examples, epilog=in_help("laufruhe examples", "laufruhe examples tractor-single tractor-sweeps --to mine")
)
ENGINES = CommandInfo(callback=engines, epilog=in_help("laufruhe engines", "laufruhe engines bmw-b48"))
