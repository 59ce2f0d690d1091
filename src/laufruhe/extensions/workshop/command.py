"""The command `drawing`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli.options import ProblemArgument, QuietOption, VerboseOption, examples
from laufruhe.cli.screen import exit_statuses, is_quiet, progress, spoken

OUT = "Folder of the drawings.  [default: results/<name of the file>-drawings]"
INITIAL = "Draw the file's own numbers; nothing is decided."


def drawing(
    problem: ProblemArgument,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT)] = None,
    initial: Annotated[bool, typer.Option("--initial", help=INITIAL)] = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Draw every weight that has a body, as SVG, PNG and DXF.

    What the problem leaves open is decided first. Drawings have dimensions, a title block and a scale.
    """
    with exit_statuses(problem), spoken(quiet, verbose), progress() as say:
        from laufruhe.cli.check import warn
        from laufruhe.cli.solve import designed
        from laufruhe.errors import counted, printed
        from laufruhe.extensions.workshop.drawings import problem_with_bodies, write_drawings
        from laufruhe.report import files

        loaded = problem_with_bodies(problem)
        name = loaded.name.strip(".") or "problem"
        folder = out or Path("results") / f"{name}-drawings"
        say("evaluating" if initial else "deciding sizes")
        result = designed(loaded, problem, initial, say)
        option = "results" if out is None else "--out"
        with files.staged(files.FileSet(folder, option, "drawing", ())) as stage:
            say("drawing")
            names = write_drawings(result, stage)
        warn(loaded, problem)
        if not is_quiet():
            sizes = "as in the file" if initial else "of the best design"
            typer.echo(f"{counted(len(names), 'drawing')} {sizes} in {printed(str(folder))}:")
            for name in names:
                typer.echo(f"  {name}.svg, {name}.png, {name}.dxf")


COMMAND = CommandInfo(
    callback=drawing,
    epilog=examples("laufruhe drawing problem.toml", "laufruhe drawing problem.toml --initial --out drawings"),
)
