"""The command `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli import options as o
from laufruhe.cli.drawing import artist
from laufruhe.cli.screen import FAILED, command_line, complain, exit_statuses, is_quiet, progress, resources, spoken

DESIGNS = "Two or more problem files, which are solved, or results: folders of solve or evaluate, or their result.json."
OUT = "Folder of the page, the picture and the table; without it nothing is written."


def compare(
    context: typer.Context,
    designs: Annotated[
        list[Path], typer.Argument(metavar="DESIGN...", help=DESIGNS, show_default=False, readable=False)
    ],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT, show_default=False)] = None,
    kind: o.FormatOption = o.Format.SVG,
    limit: o.LimitOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Show designs side by side.

    Inputs that differ, decisions, every objective for every design, forces, orders, bounds and proofs.
    """
    kinds = kind.kinds if out is not None else ()
    with exit_statuses(designs[0]), spoken(quiet, verbose), resources(limit, None), artist(kinds) as ask:
        from laufruhe.extensions.comparison.report import compared

        with progress() as say:
            show, failures = compared(designs, out, say, ask, kinds, command_line(context))
        if not is_quiet():
            show()
        for line in failures:
            complain(line)
        if failures:
            raise typer.Exit(FAILED)


COMMAND = CommandInfo(
    callback=compare,
    epilog=o.examples(
        "laufruhe compare three.toml four.toml", "laufruhe compare results/mine mine-lighter.toml --out results/both"
    ),
)
