"""The command `balance`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli import options as o
from laufruhe.cli.screen import FAILED, exit_statuses, handing_out, progress, resources, spoken

FILE = "File (TOML) with [correction] or [bob_weights]; - reads standard input."
OUT = "Folder of the results.  [default: results/<name of the file>-balance]"


def balance(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=FILE, show_default=False, readable=False)],
    json: o.JsonOption = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT)] = None,
    kind: o.FormatOption = o.Format.SVG,
    time_limit: o.LimitOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Find the holes that correct an unbalance, and the bob weights.

    Fewest holes or least residual in two planes, with a proof.
    """
    with (
        exit_statuses(file), spoken(quiet, verbose), handing_out(json, file) as hand_out, resources(time_limit, None),
    ):  # fmt: skip
        from laufruhe.extensions.balancing.report import balanced

        with progress() as say:
            text, data, is_met = balanced(file, out, kind.kinds, say)
        hand_out(text, data)
        if not is_met:
            raise typer.Exit(FAILED)


BALANCE = CommandInfo(
    callback=balance, epilog=o.examples("laufruhe balance crank.toml", "laufruhe balance crank.toml --json -")
)
