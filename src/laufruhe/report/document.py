"""A report as data: headings, paragraphs, tables and pictures in the order in which they are read.

A document is assembled once. Every block writes itself as Markdown; `web_page` puts all blocks on a page.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.present.tables import Table, escape_markdown
from laufruhe.report.strict_json import made_with


@dataclass(frozen=True)
class Heading:
    """Heading of a section."""

    text: str

    def as_markdown(self) -> str:
        """Return the heading as Markdown."""
        return f"## {escape_markdown(self.text)}"


@dataclass(frozen=True)
class Paragraph:
    """Sentences; `marked` if code and emphasis in them are marked as in Markdown."""

    text: str
    marked: bool = False

    def as_markdown(self) -> str:
        """Return the paragraph as Markdown."""
        return self.text if self.marked else escape_markdown(self.text)


@dataclass(frozen=True)
class Bullets:
    """A list with its introduction; `marked` as for a paragraph."""

    lead: str
    items: Sequence[str]
    marked: bool = False

    def as_markdown(self) -> str:
        """Return the list as Markdown."""
        convert = str if self.marked else escape_markdown
        return f"{self.lead}\n\n" + "\n".join(f"- {convert(text)}" for text in self.items)


@dataclass(frozen=True)
class Illustration:
    """A picture by its name without ending, and its caption."""

    name: str
    caption: str
    is_captioned: bool = True

    def as_markdown(self, ending: str) -> str:
        """Return the picture with its caption as Markdown; `ending` is that of the picture file."""
        image = f"![{escape_markdown(self.caption)}]({self.name}{ending})"
        return f"{image}\n\n*{self.caption}*" if self.is_captioned else image


@dataclass(frozen=True)
class Code:
    """Lines to type, or the text of a file."""

    text: str
    language: str = "sh"

    def as_markdown(self) -> str:
        """Return a block of code."""
        return f"```{self.language}\n{self.text}\n```"


Block: TypeAlias = Heading | Paragraph | Bullets | Illustration | Code | Table


def sources(source: str, assumptions: Sequence[str]) -> Iterator[Block]:
    """Yield the blocks about the source of a file and about its assumptions, if it has them."""
    if source:
        yield Paragraph(f"Source: {source}.")
    if assumptions:
        yield Bullets("Assumptions:", assumptions)


def reproduction(command: str) -> tuple[Block, ...]:
    """Return the last blocks of a report: the command that makes it again, and the versions that made it."""
    return Heading("Reproduce"), Code(command), Paragraph(made_with())


@dataclass(frozen=True)
class Document:
    """A report."""

    title: str
    blocks: tuple[Block, ...]

    def showing(self, pictures: Collection[str]) -> Document:
        """Return the document with only these illustrations."""
        blocks = (block for block in self.blocks if not isinstance(block, Illustration) or block.name in pictures)
        return Document(self.title, tuple(blocks))

    def as_markdown(self, ending: str) -> str:
        """Return the document as the Markdown text of `report.md`; picture files have the ending `ending`."""
        parts = (
            block.as_markdown(ending) if isinstance(block, Illustration) else block.as_markdown()
            for block in self.blocks
        )  # fmt: skip
        return "\n\n".join([f"# {escape_markdown(self.title)}", *parts]) + "\n"
