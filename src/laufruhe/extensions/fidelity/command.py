"""The commands `explain` and `trade`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli import options as o
from laufruhe.cli.screen import exit_statuses, handing_out, progress, resources, share_below_one, spoken

ERROR = "Relative error of the objective that is allowed."
OUT = "Folder of the pages.  [default: results/trade]"


def explain(
    problem: o.ProblemArgument,
    json: o.JsonOption = None,
    tolerance: Annotated[float, typer.Option("--tolerance", metavar="X", help=ERROR)] = 1e-3,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Say which parts of the physics this problem needs, and why."""
    with exit_statuses(problem), spoken(quiet, verbose), handing_out(json, problem) as hand_out:
        from laufruhe.extensions.fidelity.explanation import explained

        hand_out(*explained(problem, share_below_one("--tolerance", tolerance)))


def trade(
    problems: Annotated[
        list[Path], typer.Argument(metavar="PROBLEM...", help="Problem files.", show_default=False, readable=False)
    ],
    json: o.JsonOption = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT)] = None,
    time_limit: o.StopOption = None,
    quiet: o.QuietOption = False,
    verbose: o.VerboseOption = False,
) -> None:
    """Measure time and error of every simplification.

    Each fidelity, that is each choice of how exactly the physics is computed, is tried on these problems.
    """
    with exit_statuses(problems[0]), spoken(quiet, verbose), resources(time_limit, None):
        from laufruhe.extensions.fidelity.trade_report import traded

        with handing_out(json, *problems) as hand_out:
            with progress() as say:
                show, data = traded(problems, out or Path("results") / "trade", say)
            hand_out(show, data)


EXPLAIN = CommandInfo(callback=explain, epilog=o.examples("laufruhe explain problem.toml --tolerance 1e-2"))
TRADE = CommandInfo(callback=trade, epilog=o.examples("laufruhe trade problem.toml"))
