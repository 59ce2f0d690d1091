"""Report of a result as a file, with its pictures."""

from __future__ import annotations

from pathlib import Path

from laufruhe import plots
from laufruhe.present.pictures import PICTURES
from laufruhe.report import files
from laufruhe.report.result_report import result_document
from laufruhe.report.section import controls_of
from laufruhe.report.web_page import as_html
from laufruhe.solvers.result import Result


def write_report(result: Result, path: Path) -> None:
    """Write a page if the path ends in .html, or Markdown with pictures beside it."""
    document = result_document(result, list(PICTURES), "laufruhe in Python")
    pictures = {name: plots.as_svg(figure) for name, figure in plots.figures(result)}
    document = document.showing(pictures)
    if path.suffix in (".html", ".htm"):
        files.write(path, as_html(document, pictures, controls_of(result)))
        return
    files.write(path, document.as_markdown(".svg"))
    for name, svg in pictures.items():
        files.write(path.with_name(f"{name}.svg"), svg)
