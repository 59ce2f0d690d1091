"""A table as text, before it is put on a screen or a page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Grid:
    """A table: the first `left` columns are text, the others numbers.

    Attributes
    ----------
    title
        Empty where the table follows words of its own.
    marked
        Whether code and emphasis in the cells are marked as Markdown does.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    note: str = ""
    marked: bool = False

    def as_markdown(self) -> str:
        """Title, table and note, in which the user's names mean nothing to Markdown."""
        shown = str if self.marked else escaped
        rows = [[shown(cell) for cell in row] for row in self.rows]
        parts = [f"## {escaped(self.title)}"] if self.title else []
        parts.append(piped([shown(cell) for cell in self.head], rows, self.left))
        return "\n\n".join([*parts, escaped(self.note)] if self.note else parts)


def piped(head: Sequence[str], rows: Iterable[Sequence[str]], left: Iterable[int] | int = 1) -> str:
    """A table in Markdown; `left` are the columns of text, the first ones where it is a number."""
    texts = range(left) if isinstance(left, int) else set(left)
    marks = ["---" if k in texts else "---:" for k in range(len(head))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, marks, *rows))


def escaped(text: str) -> str:
    """The user's text, in which Markdown means nothing."""
    return re.sub(r"([\\`*_\[\]<>|#$])", r"\\\1", " ".join(text.split()))
