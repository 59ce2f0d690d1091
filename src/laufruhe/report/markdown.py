"""`report.md`: a report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from pathlib import PurePath

from laufruhe.report.document import Block, Bullets, Code, Document, Heading, Illustration, Paragraph
from laufruhe.report.grid import Grid, escaped
from laufruhe.report.result_report import result_document
from laufruhe.solvers.result import Result


def as_markdown(result: Result, pictures: Sequence[str], command: str) -> str:
    """The report of a result, with the names of picture files beside it; `command` makes the same result again."""
    ending = PurePath(pictures[0]).suffix if pictures else ""
    return rendered(result_document(result, [PurePath(name).stem for name in pictures], command), ending)


def rendered(document: Document, ending: str) -> str:
    """A report as Markdown; `ending` is that of the picture files beside it."""
    parts = (_with_ending(block, ending) for block in document.blocks)
    return "\n\n".join([f"# {escaped(document.title)}", *parts]) + "\n"


def _with_ending(block: Block, ending: str) -> str:
    return _picture(block, ending) if isinstance(block, Illustration) else _markdown(block)


def _picture(picture: Illustration, ending: str) -> str:
    shown = f"![{escaped(picture.caption)}]({picture.name}{ending})"
    return f"{shown}\n\n*{picture.caption}*" if picture.is_captioned else shown


@singledispatch
def _markdown(block: Block) -> str:
    raise TypeError(f"no page has a {type(block).__name__}")


@_markdown.register
def _(heading: Heading) -> str:
    return f"## {escaped(heading.text)}"


@_markdown.register
def _(paragraph: Paragraph) -> str:
    return paragraph.text if paragraph.marked else escaped(paragraph.text)


@_markdown.register
def _(bullets: Bullets) -> str:
    return f"{bullets.lead}\n\n" + "\n".join(f"- {escaped(text)}" for text in bullets.items)


@_markdown.register
def _(code: Code) -> str:
    return f"```sh\n{code.text}\n```"


@_markdown.register
def _(grid: Grid) -> str:
    return grid.as_markdown()
