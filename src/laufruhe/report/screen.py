"""Print results and documents on the screen, wrapped to its width."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, TextIO

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from laufruhe.present.tables import Table, strip_markdown
from laufruhe.report.document import Bullets, Document, Heading, Paragraph
from laufruhe.report.files import PAGE, results_line
from laufruhe.report.sections import tables_of
from laufruhe.report.wording import details, explained, fidelity_of, headline
from laufruhe.solvers.result import Result, Status

PIPE_WIDTH = 110
BETWEEN = 3
"""Number of blanks between two columns."""
SHORT_LABEL = 10
"""Largest number of characters of a cell that is not wrapped, such as 5000 rpm."""
_COLOURS = {Status.OPTIMAL: "green", Status.FEASIBLE: "green", Status.INFEASIBLE: "red", Status.FAILED: "red"}


def show(result: Result, stream: TextIO, folder: Path | None = None) -> None:
    """Print a result and the place of its files."""
    console = _console(stream, result.problem.title)
    console.print(Text(headline(result), style=_COLOURS[result.status]))
    if result.certificate is not None:
        console.print(Text(explained(result), style="dim"))
    for sentence in details(result):
        console.print(Text(sentence))
    for grid in tables_of(result):
        _print_grid(console, grid)
    console.print()
    console.print(Text(fidelity_of(result), style="dim"))
    if folder is not None:
        _print_place(console, folder, PAGE)


def show_document(document: Document, stream: TextIO, folder: Path | None, page: str) -> None:
    """Print words and tables of a page, and the place of its files if there are any."""
    console = _console(stream, document.title)
    for block in document.blocks:
        match block:
            case Heading(text):
                console.print()
                console.print(Text(text, style="bold"))
            case Paragraph(text, marked):
                console.print(Text(strip_markdown(text) if marked else text))
            case Bullets(lead, items, marked):
                console.print(Text(lead))
                for text in items:
                    item = RichTable.grid(padding=(0, 1))
                    item.add_row("-", Text(strip_markdown(text) if marked else text))
                    console.print(item)
            case Table():
                _print_grid(console, block)
                console.print()
    if folder is not None:
        _print_place(console, folder, page)


def _console(stream: TextIO, title: str) -> Console:
    console = Console(file=stream, markup=False, emoji=False, highlight=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    console.print(Text(title, style="bold"))
    return console


def _print_place(console: Console, folder: Path, page: str) -> None:
    # a path is copied in one piece, however long it is
    console.print(Text(results_line(folder, page)), soft_wrap=True)


def _print_grid(console: Console, grid: Table) -> None:
    console.print()
    if grid.title:
        console.print(Text(grid.title, style="bold"))
    for k, columns in enumerate(_parts(grid.plain(), console.width)):
        if k:
            console.print()
        console.print(_table(grid.plain(), columns, console.width))
    if grid.note:
        console.print(Text(grid.note, style="dim"))


def _parts(grid: Table, width: int) -> Iterator[Sequence[int]]:
    # columns of tables that fit the screen; each table begins with the leading text columns
    minimum = [minimum for minimum, _ in _widths(grid)]
    lead = next(k for k in range(len(grid.head) + 1) if k not in grid.texts or k == len(grid.head) - 1)
    columns = list(range(lead))
    for k in range(lead, len(grid.head)):
        if len(columns) > lead and sum(minimum[j] + BETWEEN for j in (*columns, k)) > width + BETWEEN:
            yield columns
            columns = list(range(lead))
        columns.append(k)
    yield columns


def _widths(grid: Table) -> list[tuple[int, int]]:
    widths = []
    for k, head in enumerate(grid.head):
        cells = [row[k] for row in grid.rows]
        texts = [text for text in cells if k in grid.texts and len(text) > SHORT_LABEL]
        words = [piece for text in (head, *texts) for piece in text.split()]
        words += [text for text in cells if k not in grid.texts or len(text) <= SHORT_LABEL]
        minimum = max(map(cell_len, words), default=1)
        widths.append((minimum, max(map(cell_len, [head, *cells]))))
    return widths


def _table(grid: Table, columns: Sequence[int], width: int) -> RichTable:
    table = RichTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    widths = [_widths(grid)[k] for k in columns]
    room = width - BETWEEN * (len(columns) - 1)
    # the widest lines are wrapped first
    caps = range(max(maximum for _, maximum in widths), 0, -1)
    shares = ([min(maximum, max(minimum, cap)) for minimum, maximum in widths] for cap in caps)
    fitting: Sequence[int | None] = next((share for share in shares if sum(share) <= room), [None] * len(columns))
    for column, column_width in zip(columns, fitting, strict=True):
        side: Literal["left", "right"] = "left" if column in grid.texts else "right"
        table.add_column(Text(grid.head[column]), justify=side, overflow="fold", width=column_width)
    for row in grid.rows:
        table.add_row(*(Text(row[k], style="red" if row[k] == "broken" else "") for k in columns))
    return table
