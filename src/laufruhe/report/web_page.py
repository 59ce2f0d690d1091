"""Write `report.html`: a report as one self-contained page for screens, paper and screen readers."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from laufruhe.present.tables import Table
from laufruhe.report import files
from laufruhe.report.document import Document

if TYPE_CHECKING:
    from jinja2 import Template

PAGE = "page.html"


def as_html(document: Document, pictures: Mapping[str, str], controls: Mapping[str, Any] | None = None) -> str:
    """Return a report as HTML with its pictures, SVG by name, and controls of an extension."""
    inline = {name: data_address(svg) for name, svg in pictures.items()}
    return f"{template(PAGE).render(document=document, pictures=inline, live=controls)}\n"


def write_pages(
    folder: Path,
    document: Document,
    pictures: Mapping[str, str],
    ending: str,
    controls: Mapping[str, Any] | None = None,
) -> None:
    """Write a report as Markdown, whose picture files have the ending `ending`, and as a page."""
    files.write(folder / files.REPORT, document.as_markdown(ending))
    files.write(folder / files.PAGE, as_html(document, pictures, controls))


def table_html(table: Table) -> str:
    """Return heads and rows of a table as HTML."""
    module: Any = template("table.html").module
    return str(module.table(table))


@cache
def template(name: str = PAGE) -> Template:
    """Return a compiled Jinja template of the HTML report."""
    import jinja2

    loader = jinja2.FunctionLoader(lambda file: (resources.files("laufruhe.report") / file).read_text(encoding="utf-8"))
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, loader=loader)
    environment.filters["marked"] = _marked
    return environment.get_template(name)


def data_address(svg: str) -> str:
    """Return a picture as a data address; names within it cannot clash with names of another picture."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode("utf-8")).decode("ascii")


def _marked(text: str, marked: bool) -> Markup:
    safe = str(escape(re.sub(r"\\(.)", r"\1", text) if marked else text))
    if marked:
        safe = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", safe)
        safe = re.sub(r"`(.+?)`", r"<code>\1</code>", safe)
    return Markup(safe)
