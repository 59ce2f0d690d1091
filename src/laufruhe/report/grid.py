"""A table as text, before it is put on a screen or a page."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

_MARKS = re.compile(r"\\(.)|`(.+?)`|\*\*(.+?)\*\*|\*(\S.*?)\*|\[(.+?)\]\(.+?\)")


@dataclass(frozen=True)
class Grid:
    """A table: the first `left` columns are text, the others numbers, or those of its list are text.

    Attributes
    ----------
    title
        Empty where the table follows words of its own.
    marked
        Whether code and emphasis in the cells are marked as Markdown does.
    sheet
        Name of the file that holds the table as it is printed; empty where a file has its numbers in full precision.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int | Sequence[int] = 1
    note: str = ""
    marked: bool = False
    sheet: str = ""

    @property
    def texts(self) -> frozenset[int]:
        """Columns of text, counted from zero."""
        return frozenset(range(self.left) if isinstance(self.left, int) else self.left)

    def plain(self) -> Grid:
        """The same table without the marks of Markdown."""
        if not self.marked:
            return self
        rows = [[unmarked(cell) for cell in row] for row in self.rows]
        return replace(self, head=[unmarked(cell) for cell in self.head], rows=rows, marked=False)

    def as_markdown(self) -> str:
        """Title, table and note, in which the user's names mean nothing to Markdown."""
        shown = str if self.marked else escaped
        rows = [[shown(cell) for cell in row] for row in self.rows]
        parts = [f"## {escaped(self.title)}"] if self.title else []
        parts.append(piped([shown(cell) for cell in self.head], rows, self.texts))
        return "\n\n".join([*parts, escaped(self.note)] if self.note else parts)


def piped(head: Sequence[str], rows: Iterable[Sequence[str]], texts: Collection[int] = (0,)) -> str:
    """A table in Markdown, with its columns of text."""
    marks = ["---" if k in texts else "---:" for k in range(len(head))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, marks, *rows))


def escaped(text: str) -> str:
    """The user's text, in which Markdown means nothing."""
    return re.sub(r"([\\`*_\[\]<>|#$])", r"\\\1", " ".join(text.split()))


def unmarked(text: str) -> str:
    """What is left of code, emphasis, links and escapes where Markdown is not shown as such."""
    return _MARKS.sub(lambda found: found[1] or found[2] or unmarked(found[3] or found[4] or found[5]), text)
