"""The tables on the screen."""

from __future__ import annotations

from pathlib import Path
from typing import TextIO

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from laufruhe.report.grid import Grid
from laufruhe.report.sections import tables_of
from laufruhe.report.wording import explained, fidelity_of, headline, told
from laufruhe.solvers.result import Result, Status

PIPE_WIDTH = 110
_COLOURS = {Status.OPTIMAL: "green", Status.FEASIBLE: "green", Status.INFEASIBLE: "red", Status.FAILED: "red"}


def show(result: Result, stream: TextIO, folder: Path | None = None) -> None:
    """Print a result, and where its files are."""
    # titles and names are the user's: what looks like markup in them is text
    console = Console(file=stream, markup=False, emoji=False, highlight=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    console.print(Text(result.problem.title, style="bold"))
    console.print(Text(headline(result), style=_COLOURS[result.status]))
    if result.certificate is not None:
        console.print(Text(explained(result), style="dim"))
    for sentence in told(result):
        console.print(Text(sentence))
    for grid in tables_of(result):
        console.print()
        console.print(Text(grid.title, style="bold"))
        console.print(_table(grid))
        if grid.note:
            console.print(Text(grid.note, style="dim"))
    console.print()
    console.print(Text(fidelity_of(result), style="dim"))
    if folder is not None:
        console.print(Text(f"Results: {folder}", overflow="fold"))


def _table(grid: Grid) -> Table:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for k, name in enumerate(grid.head):
        table.add_column(Text(name), justify="left" if k < grid.left else "right", overflow="fold")
    for row in grid.rows:
        table.add_row(*(Text(cell, style="red" if cell == "broken" else "") for cell in row))
    return table
