"""What page does with what was typed: a problem's page is served until it is ended."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import typer

from laufruhe.cli.screen import above_zero
from laufruhe.errors import check_whole, printed, refused
from laufruhe.server.serving import Page

LARGEST_PORT = 65535


def served(problem: Path, port: int | None, time_limit: float, ends_after: float | None, opens_browser: bool) -> None:
    """Serve, say where, and open a browser there."""
    if str(problem) == "-":
        rule, remedy = "is standard input, and a page watches its file", "save it, and name the file"
        raise refused("PROBLEM", "-", rule, remedy)
    if port is not None:
        check_whole("--port", port, 1, LARGEST_PORT)
    seconds = above_zero("--time-limit", time_limit, "60")
    ends = None if ends_after is None else above_zero("--for", ends_after, "60")
    page = Page(problem, port, seconds)

    def ready() -> None:
        typer.echo(f"{printed(str(problem))}: {page.address}\nCtrl-C ends it; who has this address can use the page.")
        if opens_browser and not webbrowser.open(page.server.guard.ticket_address):
            typer.echo("No browser could be started; open the address above in one.", err=True)

    page.serve(ends, ready)
