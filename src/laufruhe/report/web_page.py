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

from laufruhe.live import LiveModel, page_assets
from laufruhe.present.tables import Table
from laufruhe.report import files
from laufruhe.report.document import Document

if TYPE_CHECKING:
    from jinja2 import Template

PAGE = "page.html"
HEADING = "Move the decisions"


def as_html(document: Document, pictures: Mapping[str, str], live: LiveModel | None = None) -> str:
    """Return a report as HTML with its pictures, SVG by name, and sliders where there is a live model."""
    inline, sliders = {name: data_address(svg) for name, svg in pictures.items()}, None
    if live is not None and (live.sliders or live.without_slider):
        if why := live.why_not or live.too_large:
            content: dict[str, Any] = {"sentences": (why, *live.notes)}
        else:
            # these texts are safe: the package makes them, and the JSON has no opening bracket
            texts = {"model": live.as_json(), "style": page_assets()["live.css"], "script": page_assets()["live.js"]}
            content = {name: Markup(text) for name, text in texts.items()}
        sliders = {"heading": HEADING, **content}
    return f"{template(PAGE).render(document=document, pictures=inline, live=sliders)}\n"


def write_pages(
    folder: Path, document: Document, pictures: Mapping[str, str], ending: str, live: LiveModel | None = None
) -> None:
    """Write a report as Markdown, whose picture files have the ending `ending`, and as a page."""
    files.write(folder / files.REPORT, document.as_markdown(ending))
    files.write(folder / files.PAGE, as_html(document, pictures, live))


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
