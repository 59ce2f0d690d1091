"""A report as data: headings, paragraphs, tables and pictures in the order in which they are read.

It is assembled once; `markdown` and `web_page` put it on pages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.report.grid import Grid


@dataclass(frozen=True)
class Heading:
    """Of a section."""

    text: str


@dataclass(frozen=True)
class Paragraph:
    """Sentences; `marked` where code and emphasis in them are marked as Markdown does."""

    text: str
    marked: bool = False


@dataclass(frozen=True)
class Bullets:
    """A list, and the words that lead it."""

    lead: str
    items: Sequence[str]


@dataclass(frozen=True)
class Illustration:
    """A picture by its name without an ending, and what it shows."""

    name: str
    caption: str
    is_captioned: bool = True


@dataclass(frozen=True)
class Code:
    """A line to type."""

    text: str


Block: TypeAlias = Heading | Paragraph | Bullets | Illustration | Code | Grid


@dataclass(frozen=True)
class Document:
    """A whole report."""

    title: str
    blocks: tuple[Block, ...]
