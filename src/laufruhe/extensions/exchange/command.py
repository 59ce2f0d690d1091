"""The command `export`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli.options import LimitOption, ProblemArgument, QuietOption, VerboseOption, examples
from laufruhe.cli.screen import exit_statuses, is_quiet, progress, resources, spoken

Target = StrEnum("Target", ["csv", "json", "netcdf", "uff", "nastran", "exudyn", "opentorsion"])
ENDINGS = {"netcdf": "loads.nc", "nastran": "loads.bdf", "exudyn": "exudyn.py", "opentorsion": "opentorsion.py"}
TO = "Format: tables, test data (uff), bulk data (nastran), or a script that computes the loads again."
OUT = "File to write.  [default: results/<name of the problem>-loads.<ending>]"
GRIDS = 'Grid or node numbers of mounts and "block", such as "front=101, rear=102".'
MILLIMETRES = "Displacements in mm and moments in N mm; in csv, json and nastran."
HIGHEST = "Highest order of crank speed in the file."
INITIAL = "Export the file's own numbers; nothing is decided."


def export(
    problem: ProblemArgument,
    to: Annotated[Target, typer.Option("--to", help=TO, show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", "--output", metavar="FILE", help=OUT)] = None,
    grids: Annotated[str, typer.Option("--grids", metavar="NAME=N,...", help=GRIDS, show_default=False)] = "",
    millimetres: Annotated[bool, typer.Option("--mm", help=MILLIMETRES)] = False,
    highest: Annotated[float, typer.Option("--highest-order", metavar="H", help=HIGHEST)] = 30.0,
    initial: Annotated[bool, typer.Option("--initial", help=INITIAL)] = False,
    limit: LimitOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Write the loads for other programs, or a script to check them.

    What the problem leaves open is decided first. Files that Laufruhe did not make are not replaced.
    """
    with exit_statuses(problem), spoken(quiet, verbose), progress() as say, resources(limit, None):
        from laufruhe.cli.solve import designed
        from laufruhe.errors import printed
        from laufruhe.extensions.exchange.writers import checked_nodes, write
        from laufruhe.files.reader import load
        from laufruhe.report import files

        loaded = load(problem)
        nodes = checked_nodes(loaded, str(to), grids, highest, millimetres)
        name = loaded.name.strip(".") or "problem"
        path = out or Path("results") / f"{name}-{ENDINGS.get(to, f'loads.{to}')}"
        with files.staged_file(path, "--out") as stage:
            say("evaluating" if initial else "deciding")
            result = designed(loaded, problem, initial, say)
            say("writing")
            content = write(result, str(to), nodes, highest, millimetres, stage)
        if not is_quiet():
            typer.echo(f"{'Initial' if initial else 'Best'} design: {content}, in {printed(str(path))}")


COMMAND = CommandInfo(
    callback=export,
    epilog=examples(
        "laufruhe export problem.toml --to uff --out loads.uff",
        'laufruhe export problem.toml --to nastran --grids "front=101, rear=102" --mm',
    ),
)
