"""Files of a result, and its tables on the screen; imported while its pictures are drawn."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from laufruhe.cli.screen import Request, complain, is_quiet, timed
from laufruhe.present.pictures import PICTURES
from laufruhe.report import files
from laufruhe.report.json_result import as_json
from laufruhe.report.result_report import result_document
from laufruhe.report.section import controls_of
from laufruhe.report.tables import write_tables
from laufruhe.report.web_page import template, write_pages
from laufruhe.solvers.result import Result, Status
from laufruhe.units import shown_in


def write_results(
    request: Request, result: Result, stage: Path, copy: Path | None, wait_for_pictures: Callable[[], dict[str, str]],
    say: Callable[[str], None],
) -> None:  # fmt: skip
    """Write all files of a result into a folder, and a copy of its JSON.

    `wait_for_pictures` returns the pictures as SVG, by name.
    """
    say("writing tables")
    with timed(result.timing, "tables"):
        write_tables(result, stage)
    controls = controls_of(result)
    with shown_in(dict(result.problem.shown_units)):
        document = result_document(result, list(PICTURES), request.command)
    if request.kinds:
        say("drawing")
    with timed(result.timing, "plots"):
        # imports of the page and the screen run while pictures are drawn
        template()
        if not is_quiet():
            import_module("laufruhe.report.screen")
        pictures = wait_for_pictures()
    document = document.showing(pictures)
    write_pages(stage, document, pictures, f".{request.kinds[0]}" if request.kinds else "", controls)
    text = as_json(result, request.series)
    for place in filter(None, (stage / files.RESULT, copy)):
        files.write(place, text)


def show(request: Request, result: Result, folder: Path) -> None:
    """Print tables, or JSON with the tables on standard error."""
    text = as_json(result, request.series) if request.json == "-" else None
    if text is not None:
        sys.stdout.write(text)
        sys.stdout.flush()
    if not is_quiet():
        from laufruhe.report import screen

        with shown_in(dict(result.problem.shown_units)):
            screen.show(result, sys.stdout if text is None else sys.stderr, folder)
    if result.status in (Status.INFEASIBLE, Status.FAILED):
        complain(f"{result.problem.name}: {result.status}: {result.message}")
