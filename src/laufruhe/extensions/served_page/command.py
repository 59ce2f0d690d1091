"""The command `page`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from laufruhe.cli.options import examples
from laufruhe.cli.screen import above_zero, exit_statuses
from laufruhe.errors import check_integer, printed, refused

LARGEST_PORT = 65535
ON_DISK = "Problem file (TOML)."
PORT = "Port to serve at.  [default: 8537, or one that is free]"
NO_BROWSER = "Open no browser; print the address only."
SEARCH = "Seconds that a whole solve may take, once sliders rest."
FOR = "End by itself after SECONDS."


def page(
    problem: Annotated[Path, typer.Argument(metavar="PROBLEM", help=ON_DISK, show_default=False, readable=False)],
    port: Annotated[int | None, typer.Option("--port", metavar="N", help=PORT)] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help=NO_BROWSER)] = False,
    time_limit: Annotated[float, typer.Option("--time-limit", metavar="SECONDS", help=SEARCH)] = 20.0,
    ends_after: Annotated[float | None, typer.Option("--for", metavar="SECONDS", help=FOR)] = None,
) -> None:
    """Serve a page of the problem on this machine.

    Sliders for what is open, for limits, speed and load, crank and mounts; the optimum follows.
    """
    with exit_statuses(problem, "the page is no longer served"):
        import webbrowser

        from laufruhe.extensions.served_page.serving import Page

        if str(problem) == "-":
            rule, remedy = "is standard input, and a page watches its file", "save it, and name the file"
            raise refused("PROBLEM", "-", rule, remedy)
        if port is not None:
            check_integer("--port", port, 1, LARGEST_PORT)
        seconds = above_zero("--time-limit", time_limit, "60")
        ends = None if ends_after is None else above_zero("--for", ends_after, "60")
        served = Page(problem, port, seconds)

        def ready() -> None:
            typer.echo(
                f"{printed(str(problem))}: {served.address}\nCtrl-C ends it; who has this address can use the page."
            )
            if not no_browser and not webbrowser.open(served.server.guard.ticket_address):
                typer.echo("No browser could be started; open the address above in one.", err=True)

        served.serve(ends, ready)


PAGE = CommandInfo(
    callback=page,
    epilog=examples("laufruhe page problem.toml", "laufruhe page problem.toml --no-browser --port 8600"),
)
