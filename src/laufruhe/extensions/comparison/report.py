"""Page, picture and table of a comparison."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from laufruhe.cli.screen import Ask
from laufruhe.extensions.comparison.designs import Design, designs_of
from laufruhe.extensions.comparison.rows import (
    assumptions_of,
    common_places,
    number_table,
    of_place,
    order_columns,
    rows_of,
    shared_names,
    tables_of,
)
from laufruhe.present import picture as p
from laufruhe.report import files
from laufruhe.report.document import Block, Bullets, Document, Illustration, reproduction
from laufruhe.report.screen import show_document
from laufruhe.report.table_files import write_csv
from laufruhe.report.web_page import write_pages
from laufruhe.units import readable

NAME, TABLE = "comparison", "comparison.csv"
GROUP, BETWEEN = 0.8, 0.65


def compared(
    paths: Sequence[Path], out: Path | None, say: Callable[[str], None], ask: Ask, kinds: Sequence[str], command: str
) -> tuple[Callable[[], None], list[str]]:
    """Compare designs and write the files of the comparison into a folder, if one is named.

    Return a function that shows the tables, and a line for each problem without a design.
    """
    designs = designs_of(paths, say)
    rows = rows_of(designs)
    names = " and ".join(filter(None, (", ".join(d.name for d in designs[:-1]), designs[-1].name)))
    heads = [Bullets("Problems:", [f"{design.name}: {design.record['title']}" for design in designs])]
    if assumptions := assumptions_of(designs):
        heads.append(Bullets("Assumptions:", assumptions))
    tables = tables_of(rows, designs)
    blocks: list[Block] = [*tables, *reproduction(command)]
    title = f"Comparison of {names}"
    if out is not None:
        names_of_files = (files.REPORT, files.PAGE, TABLE, *(f"{NAME}.{kind}" for kind in files.KINDS))
        with files.staged(files.FileSet(out, "--out", "compare", names_of_files)) as stage:
            svg = ask("laufruhe.plots.picture:save_picture", picture_of(designs, title), stage / NAME, kinds)
            whole = Document(title, (*heads, blocks[0], Illustration(NAME, CAPTION), *blocks[1:]))
            write_csv(number_table(rows, designs), stage / TABLE)
            write_pages(stage, whole, {NAME: svg()}, f".{kinds[0]}")
    failures = [
        f"{design.name}: {design.record['status']}: {design.record['message']}"
        for design in designs
        if not design.has_design
    ]
    screen = Document(title, (*heads, *tables))
    return partial(show_document, screen, sys.stdout, out, files.PAGE), failures


CAPTION = "Loads of the designs side by side: by place, and by order of crank speed."


def picture_of(designs: Sequence[Design], title: str) -> p.Picture:
    """Return bars of the loads at places that all designs have, and of their largest orders."""
    panels = [
        _panel(
            f"{load.display.title}, mean", load.unit, shared_names(columns),
            [[of_place(column, name, "mean") for name in shared_names(columns)] for column in columns],
        )
        for load, columns in common_places(designs)
        if shared_names(columns)
    ]  # fmt: skip
    panels += [
        _panel(f"{name[:1].upper()}{name[1:]} by order", unit, [f"{order:g}" for order in by_order],
               list(zip(*by_order.values(), strict=True)))
        for name, unit, by_order in order_columns(designs)
    ]  # fmt: skip
    legend = [p.Bars(colour=p.colour(k, len(designs)), label=design.name) for k, design in enumerate(designs)]
    size = (p.WIDEST / 2.0, 0.6 * p.HIGH)
    words = "Designs as decided; of a problem without open numbers, as in its file."
    return p.Picture(title, words, panels, "Computed with Laufruhe.", size=size, columns=2, gap=BETWEEN, legend=legend)


def _panel(title: str, unit: str, names: Sequence[str], columns: Sequence[Sequence[float | None]]) -> p.Panel:
    unit_name, factor = readable(unit)
    width = GROUP / len(columns)
    marks = [
        p.Bars(
            [place + (k - 0.5 * (len(columns) - 1)) * width for place, value in enumerate(column) if value is not None],
            [factor * value for value in column if value is not None], width, p.colour(k, len(columns)),
        )
        for k, column in enumerate(columns)
    ]  # fmt: skip
    ticks = [(float(k), name) for k, name in enumerate(names)]
    across = p.Axis(ends=(-0.6, len(names) - 0.4), ticks=ticks, grid=False)
    return p.Panel(marks, across, p.Axis(f"[{unit_name}]"), title)
