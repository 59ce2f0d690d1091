"""Tables as data, from which screen, Markdown, page, CSV files and workbook are written."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from laufruhe.problem.curves import Fields

_MARKS = re.compile(r"\\(.)|`(.+?)`|\*\*(.+?)\*\*|\*(\S.*?)\*|\[(.+?)\]\(.+?\)")
_NUMBER = re.compile(r"[-+−]?\d[\d.,]*(e[-+]?\d+)?( %)?|–|")


@dataclass(frozen=True)
class Table:
    """Heads and rows: texts where a report shows them, numbers in full precision where a file holds them.

    Attributes
    ----------
    title
        Empty where the table follows a text of its own.
    left
        Number of leading text columns, or the text columns themselves; None finds those that hold more than numbers.
    marked
        True if cells mark code and emphasis as in Markdown.
    file
        Name of the file that holds the table as it is printed; empty if a file has its numbers in full precision.
    omitted
        Number of further rows that only the CSV file has.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    left: int | Sequence[int] | None = 1
    note: str = ""
    marked: bool = False
    file: str = ""
    omitted: int = 0

    @classmethod
    def from_fields(cls, fields: Fields) -> Table:
        """Return the numbers of labelled fields under heads with units."""
        head, rows = fields.table()
        return cls(head, list(rows))

    @property
    def texts(self) -> frozenset[int]:
        """Indices of the text columns."""
        if self.left is None:
            columns = range(len(self.head))
            return frozenset(
                k for k in columns if not all(_NUMBER.fullmatch(strip_markdown(row[k])) for row in self.rows)
            )
        return frozenset(range(self.left) if isinstance(self.left, int) else self.left)

    def plain(self) -> Table:
        """Return the table without the marks of Markdown."""
        if not self.marked:
            return self
        rows = [[strip_markdown(cell) for cell in row] for row in self.rows]
        return replace(self, head=[strip_markdown(cell) for cell in self.head], rows=rows, marked=False)

    def as_markdown(self) -> str:
        """Return title, table and note as Markdown; in a table without marks, special characters are escaped."""
        convert = str if self.marked else escape_markdown
        rows = [[convert(cell) for cell in row] for row in self.rows]
        parts = [f"## {escape_markdown(self.title)}"] if self.title else []
        parts.append(markdown_table([convert(cell) for cell in self.head], rows, self.texts))
        return "\n\n".join([*parts, escape_markdown(self.note)] if self.note else parts)


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]], texts: Collection[int] = (0,)) -> str:
    """Return a table in Markdown, its text columns aligned left."""
    marks = ["---" if k in texts else "---:" for k in range(len(head))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, marks, *rows))


def escape_markdown(text: str) -> str:
    """Return text that Markdown shows as it is."""
    return re.sub(r"([\\`*_\[\]<>|#$])", r"\\\1", " ".join(text.split()))


def strip_markdown(text: str) -> str:
    """Return Markdown text without its code, emphasis, links and escapes."""
    return _MARKS.sub(lambda match: match[1] or match[2] or strip_markdown(match[3] or match[4] or match[5]), text)
