"""Every table and curve of a result as numbers: a CSV file each, and a workbook of them all."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, fields
from functools import partial
from pathlib import Path
from typing import Any

from laufruhe.numerics.processes import meanwhile
from laufruhe.present.measures import has_loads, has_ranking, limits_of, loaded, places_of, ranking_of
from laufruhe.present.mounting import facts_of, is_elastic
from laufruhe.present.numbers import RPM
from laufruhe.present.speed_curves import speeds_of, transmissibility_of
from laufruhe.problem.curves import STEPS, forces_of, modes_of, orders_of
from laufruhe.problem.evaluation import measured
from laufruhe.report import files
from laufruhe.report.curves import CURVES
from laufruhe.report.grid import Grid
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.sections import tables_of as printed_tables
from laufruhe.report.sheet import Sheet, Sheets
from laufruhe.report.workbook import write_book
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import DecisionValue, LimitValue

MOST_ROWS = 20 * STEPS
_FORMULA = re.compile(r"(?!-?$|[+-]?[0-9.]+(?:e[+-]?[0-9]+)?(?: ?%| [\w ./*^°²³]*)?$)[=+\-@\t＝＋－＠]")
"""Begins what a spreadsheet may compute: a sign that no plain number with its unit follows."""
MANY = 5_000
"""Cells that take longer to write than a process to begin."""


def sheets_of(result: Result) -> dict[str, Sheet]:
    """All sheets that a result fills, by name: SI, but for degrees and rpm where their heads say so."""
    sheets = [_SHEETS, *(section.sheets for section in EXTENSION_SECTIONS.values())]
    made = {name: of(result) for each in sheets for name, (applies, of) in each.items() if applies(result)}
    return {name: sheet for name, sheet in made.items() if sheet.rows} | _printed(result)


def _printed(result: Result) -> dict[str, Sheet]:
    """Tables of the report that have no sheet of their own, as they are printed."""
    return {grid.sheet: _as_printed(grid) for grid in printed_tables(result) if grid.sheet}


def _as_printed(grid: Grid) -> Sheet:
    head = [grid.head[0] or grid.title, *grid.head[1:]]
    return Sheet(head, [[_number(cell) for cell in row] for row in grid.rows])


def _number(cell: str) -> str | float:
    try:
        return float(cell)
    except ValueError:
        return cell


def _values(found: Sequence[DecisionValue | LimitValue]) -> Sheet:
    return Sheet([field.name for one in found[:1] for field in fields(one)], [list(astuple(one)) for one in found])


def _measures(result: Result) -> Sheet:
    """Mean, maximum and RMS of every place, before and after."""
    rows = [
        [places.title, point.name, design, name, each.mean, each.max, each.rms, places.channel.unit]
        for places in places_of(result)
        for k, point in enumerate(result.problem.points)
        for design, found in loaded(result).items()
        for name, each in zip(
            places.channel.places(found.engine), measured(found, k, places.channel), strict=True
        )
    ]  # fmt: skip
    return Sheet(["quantity", "point", "design", "place", "mean", "maximum", "rms", "unit"], rows)


def _forces(result: Result) -> Sheet:
    steps = max(min(STEPS, MOST_ROWS // len(result.problem.points)), 36)
    return Sheet.of(forces_of(loaded(result), steps))


def _transmissibility(result: Result) -> Sheet:
    speeds, orders = speeds_of(result), facts_of(result.final).orders
    columns = [
        (f"{design}, {point.name}: order {orders[k]:g}", curve.tolist())
        for design, found in loaded(result).items()
        for point in result.problem.points
        for k, curve in transmissibility_of(found, point, speeds, orders)
    ]
    rows = zip((RPM * speeds).tolist(), *(values for _, values in columns), strict=True)
    return Sheet(["speed [rpm]", *(head for head, _ in columns)], [list(row) for row in rows] if columns else [])


def _rankings(result: Result) -> Sheet:
    rows = [
        [rank, star.value, star.lower_bound, star.proven, _degrees(star.throws), ", ".join(star.shafts),
         "-".join(map(str, order.order)), _degrees(order.intervals), order.neighbours, order.roll_content,
         *(free for pair in zip(star.forces, star.couples, strict=True) for free in pair)]
        for rank, star in enumerate(ranking_of(result).ranking, 1)
        for order in star.firing_orders
    ]  # fmt: skip
    unit = result.objective.unit if result.objective else ""
    head = ["rank", f"objective [{unit or '-'}]", f"not under [{unit or '-'}]", "proven", "throws [deg]", "shafts",
            "firing order", "intervals [deg]", "neighbours", "roll content"]  # fmt: skip
    for order in ranking_of(result).ranking[0].orders:
        # in forces of one throw, and that times their spacing
        head += [f"free force of order {order} [-]", f"free couple of order {order} [-]"]
    return Sheet(head, rows)


def _degrees(angles: Iterable[float]) -> str:
    return " ".join(f"{math.degrees(angle):.6g}" for angle in angles)


_SHEETS: Sheets = {
    "decisions": (lambda result: result.decisions, lambda result: _values(result.decisions)),
    "limits": (limits_of, lambda result: _values(limits_of(result))),
    "measures": (places_of, _measures),
    "forces": (has_loads, _forces),
    "orders": (has_loads, lambda result: Sheet.of(orders_of(loaded(result)))),
    "modes": (is_elastic, lambda result: Sheet.of(modes_of(result.designs))),
    "transmissibility": (is_elastic, _transmissibility),
    "rankings": (has_ranking, _rankings),
    **CURVES,
}


@contextmanager
def writing_tables(result: Result, folder: Path) -> Iterator[Callable[[], None]]:
    """A CSV file for every sheet, and all of them as one workbook, into a folder that exists.

    Gives what waits for the workbook: a process of its own writes one of many cells.
    """
    sheets = sheets_of(result)
    cells = sum(len(sheet.head) * len(sheet.rows) for sheet in sheets.values())
    book = partial(write_book, sheets, folder / files.BOOK) if sheets else lambda: None
    with meanwhile(book, cells > MANY) as written:
        for name, sheet in sheets.items():
            write_csv(sheet, folder / f"{name}.csv")
        yield written


def write_csv(sheet: Sheet, path: Path) -> None:
    """Write one sheet as comma-separated values: numbers in full precision, no text that a spreadsheet computes."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(map(_cell, sheet.head))
        writer.writerows(map(_cell, row) for row in sheet.rows)


def _cell(cell: Any) -> Any:
    if isinstance(cell, float) and not math.isfinite(cell):
        return ""
    # names are the user's, and spreadsheets take ' for the mark of a text
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell
