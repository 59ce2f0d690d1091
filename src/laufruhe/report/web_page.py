"""`report.html`: a report as one page that needs nothing beside it, for screens, paper and readers aloud."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

from laufruhe.live import LiveModel, page_assets
from laufruhe.report.document import Block, Bullets, Code, Document, Heading, Illustration, Paragraph
from laufruhe.report.grid import Grid

STYLE = "page.css"
TRY = "Move the decisions"
WITHOUT = "Scripts are switched off, so the sliders are not shown; the rest of this report needs none."
MANY = 10
"""Columns of a table beyond which its numbers may wrap."""


def as_html(document: Document, pictures: Mapping[str, str], live: LiveModel | None = None) -> str:
    """A report as HTML.

    Parameters
    ----------
    pictures
        SVG by name; they stand in the page, which loads nothing.
    live
        What lets a reader move decisions.
    """
    moved = None if live is None or not (live.sliders or live.unmoved) else live
    style = (files("laufruhe.report") / STYLE).read_text(encoding="utf-8")
    lines = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">\n<meta name="generator" content="Laufruhe">',
        f"<title>{escape(document.title)}</title>\n<style>\n{style.rstrip()}",
        *([page_assets()["live.css"]] if moved and not _why_still(moved) else []),
        f"</style>\n</head>\n<body>\n<main>\n<h1>{escape(document.title)}</h1>",
        '<nav aria-label="Sections">\n<ul>',
        *_entries(document.blocks, moved is not None, bool(pictures)),
        "</ul>\n</nav>",
        *_Page(pictures, moved).lines(document.blocks),
        "</main>\n</body>\n</html>",
    ]
    return "\n".join(lines) + "\n"


def _why_still(live: LiveModel) -> str:
    """Why decisions cannot be moved on a page; empty where they can."""
    return live.why_not or live.too_large


def _title(block: Block) -> str:
    """Of a section that begins with a block; empty where none does."""
    return block.text if isinstance(block, Heading) else block.title if isinstance(block, Grid) else ""


def _entries(blocks: Sequence[Block], moves: bool, has_pictures: bool) -> Iterator[str]:
    """The list of sections."""
    for k, title in enumerate(filter(None, map(_title, blocks)), 1):
        yield _entry(f"s{k}", title)
        if k == 1 and moves:
            yield _entry("try", TRY)
            yield from [_entry("pictures", "Pictures")] if has_pictures else []


def _entry(place: str, title: str) -> str:
    return f'<li><a href="#{place}">{escape(title)}</a></li>'


@dataclass(frozen=True)
class _Page:
    """What all blocks of a page need: its pictures, and what moves on it."""

    pictures: Mapping[str, str]
    live: LiveModel | None

    def lines(self, blocks: Sequence[Block]) -> Iterator[str]:
        """All blocks; what moves follows the words of the first section."""
        section, waits = 0, self.live is not None
        for number, block in enumerate(blocks, 1):
            if waits and section == 1 and isinstance(block, Heading | Illustration | Grid):
                waits = False
                yield from self._moved()
                yield from ['<h2 id="pictures">Pictures</h2>'] if isinstance(block, Illustration) else []
            if title := _title(block):
                section += 1
                yield f'<h2 id="s{section}">{escape(title)}</h2>'
            yield from self._block(block, number)

    def _moved(self) -> Iterator[str]:
        if self.live is None:
            return
        why = _why_still(self.live)
        yield f'<h2 id="try">{TRY}</h2>'
        yield from (f"<p>{escape(sentence)}</p>" for sentence in ((why, *self.live.told) if why else ()))
        yield f'<section id="live" aria-label="{TRY}"></section>'
        if not why:
            # of our own making, and JSON without an opening bracket
            yield f"<noscript><p>{WITHOUT}</p></noscript>"
            yield f'<script type="application/json" id="live-model">{self.live.as_json()}</script>'
            yield f"<script>\n{page_assets()['live.js']}\n</script>"

    def _block(self, block: Block, number: int) -> Iterator[str]:
        match block:
            case Paragraph():
                yield f"<p>{_marked(block.text, block.marked)}</p>"
            case Bullets():
                yield f"<p>{escape(block.lead)}</p>\n<ul>"
                yield from (f"<li>{escape(item)}</li>" for item in block.items)
                yield "</ul>"
            case Code():
                yield f'<pre tabindex="0"><code>{escape(block.text)}</code></pre>'
            case Illustration() if block.name in self.pictures:
                caption = escape(block.caption)
                yield f'<figure>\n<div class="scroll" role="region" tabindex="0" aria-label="Picture {number}">'
                yield f'<img src="{inlined(self.pictures[block.name])}" alt="{caption}">\n</div>'
                yield from [f'<figcaption aria-hidden="true">{caption}</figcaption>'] if block.is_captioned else []
                yield "</figure>"
            case Grid():
                yield from _table(block, number)


def _table(grid: Grid, number: int) -> Iterator[str]:
    wide = " wide" if len(grid.head) > MANY else ""
    name = escape(grid.title or "Table")
    yield f'<div class="scroll{wide}" role="region" tabindex="0" aria-label="{name} {number}">\n<table>\n<thead>'
    yield _row(grid.head, ('th scope="col"', 'th scope="col"'), grid)
    yield "</thead>\n<tbody>"
    yield from (_row(row, ('th scope="row"', "td"), grid) for row in grid.rows)
    yield "</tbody>\n</table>\n</div>"
    yield from [f'<p class="note">{escape(grid.note)}</p>'] if grid.note else []


def _row(cells: Sequence[str], tags: tuple[str, str], grid: Grid) -> str:
    """Cells of a table; the first has a tag of its own."""
    shown = []
    for k, cell in enumerate(cells):
        tag = tags[k > 0]
        text = ' class="text"' if k < grid.left else ""
        shown.append(f"<{tag}{text}>{_marked(cell, grid.marked)}</{tag[:2]}>")
    return f"<tr>{''.join(shown)}</tr>"


def inlined(svg: str) -> str:
    """A picture as an address that holds it: names within it cannot meet those of another."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode("utf-8")).decode("ascii")


def _marked(text: str, marked: bool) -> str:
    """Text with code and emphasis as they are marked; nothing else in it means anything."""
    if not marked:
        return escape(text)
    safe = escape(re.sub(r"\\(.)", r"\1", text))
    return re.sub(r"`(.+?)`", r"<code>\1</code>", re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", safe))
