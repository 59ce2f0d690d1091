"""A report as data: headings, paragraphs, tables and pictures in the order in which they are read.

It is assembled once. Every block knows how it is written in Markdown; `web_page` puts all of them on a page.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.present.tables import Table, escaped


@dataclass(frozen=True)
class Heading:
    """Of a section."""

    text: str

    def as_markdown(self) -> str:
        """On a line of its own."""
        return f"## {escaped(self.text)}"


@dataclass(frozen=True)
class Paragraph:
    """Sentences; `marked` where code and emphasis in them are marked as Markdown does."""

    text: str
    marked: bool = False

    def as_markdown(self) -> str:
        """As it is where it is marked."""
        return self.text if self.marked else escaped(self.text)


@dataclass(frozen=True)
class Bullets:
    """A list, and the words that lead it; `marked` as of a paragraph."""

    lead: str
    items: Sequence[str]
    marked: bool = False

    def as_markdown(self) -> str:
        """A line each."""
        shown = str if self.marked else escaped
        return f"{self.lead}\n\n" + "\n".join(f"- {shown(text)}" for text in self.items)


@dataclass(frozen=True)
class Illustration:
    """A picture by its name without an ending, and what it shows."""

    name: str
    caption: str
    is_captioned: bool = True

    def as_markdown(self, ending: str) -> str:
        """With its caption below; the ending is that of the file beside the page."""
        shown = f"![{escaped(self.caption)}]({self.name}{ending})"
        return f"{shown}\n\n*{self.caption}*" if self.is_captioned else shown


@dataclass(frozen=True)
class Code:
    """A line to type."""

    text: str

    def as_markdown(self) -> str:
        """For a shell."""
        return f"```sh\n{self.text}\n```"


Block: TypeAlias = Heading | Paragraph | Bullets | Illustration | Code | Table


@dataclass(frozen=True)
class Document:
    """A whole report."""

    title: str
    blocks: tuple[Block, ...]

    def showing(self, pictures: Collection[str]) -> Document:
        """Without the illustrations that there is no picture of."""
        kept = (block for block in self.blocks if not isinstance(block, Illustration) or block.name in pictures)
        return Document(self.title, tuple(kept))

    def as_markdown(self, ending: str) -> str:
        """The text of `report.md`; the ending is that of the picture files beside it."""
        parts = (
            block.as_markdown(ending) if isinstance(block, Illustration) else block.as_markdown()
            for block in self.blocks
        )  # fmt: skip
        return "\n\n".join([f"# {escaped(self.title)}", *parts]) + "\n"
