"""The command `identify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli import options as o
from laufruhe.cli.screen import exit_statuses, handing_out, progress, resources, spoken

FILE = "Problem file (TOML) with [[measurements]] and open numbers."
OUT = "Folder of the results.  [default: results/<name of the file>-identify]"


def identify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=FILE, show_default=False, readable=False)],
    json: o.JsonOption = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT)] = None,
    time_limit: o.LimitOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Estimate numbers of a built engine from measured orders.

    Least squares within the bounds, with confidence intervals and what the measurement does not determine.
    """
    with (
        exit_statuses(file), spoken(quiet, verbose), handing_out(json, file) as hand_out, resources(time_limit, None),
    ):  # fmt: skip
        from laufruhe.extensions.identification.report import identified

        with progress() as say:
            text, data = identified(file, out, say)
        hand_out(text, data)


IDENTIFY = CommandInfo(
    callback=identify, epilog=o.examples("laufruhe identify engine.toml", "laufruhe identify engine.toml --json -")
)
