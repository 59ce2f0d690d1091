"""Tables as files: comma-separated values, and one workbook of several tables."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from laufruhe.present.tables import Table

_FORMULA = re.compile(r"(?!-?$|[+-]?[0-9.]+(?:e[+-]?[0-9]+)?(?: ?%| [\w ./*^°²³]*)?$)[=+\-@\t＝＋－＠]")
"""Start of a text that a spreadsheet may compute: a sign that no plain number with its unit follows."""
_OPTIONS = {"constant_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
MAX_PAGE_ROWS = 10_000
"""Largest number of rows of a page of the workbook of a study; longer tables are in their CSV and netCDF files."""
_CREATED = datetime(2000, 1, 1, tzinfo=UTC)


def write_csv(table: Table, path: Path, comments: Iterable[str] = ()) -> None:
    """Write a table as comma-separated values: numbers in full precision, no text that a spreadsheet computes.

    Comments are lines above the head, each behind a #.
    """
    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.writelines(f"# {comment}\n" for comment in comments)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(map(_csv_cell, table.head))
        writer.writerows(zip(*map(_csv_column, zip(*table.rows, strict=True)), strict=True))


def _csv_column(cells: Sequence[Any]) -> Sequence[Any]:
    # most columns of long tables are plain numbers, and need no conversion
    is_plain = set(map(type, cells)) == {float} and all(map(math.isfinite, cells))
    return cells if is_plain else list(map(_csv_cell, cells))


def _csv_cell(cell: Any) -> Any:
    if isinstance(cell, float) and not math.isfinite(cell):
        return ""
    # names are the user's, and spreadsheets take ' for the mark of a text
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell


def write_book(tables: Mapping[str, Table], path: Path) -> None:
    """Write tables as the pages of a workbook; the same numbers always make the same file."""
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    with TemporaryDirectory() as rows:
        book = Workbook(path, {**_OPTIONS, "tmpdir": rows})
        book.set_properties({"created": _CREATED})
        plain = book.add_format()

        def write_text(page: Any, row: int, column: int, text: str, _: Any) -> int | None:
            # a text that looks like marks of formatting is a text
            if not (text.startswith("<r>") and text.endswith("</r>")):
                return None
            return int(page.write_rich_string(row, column, text[:2], plain, text[2:]))

        for name, table in zip(_page_names(tables), tables.values(), strict=True):
            page = book.add_worksheet(name)
            page.add_write_handler(str, write_text)
            page.freeze_panes(1, 0)
            for k, row in enumerate(chain([table.head], table.rows)):
                # most cells are numbers, and need no conversion
                page.write_row(
                    k, 0, [cell if type(cell) is float and math.isfinite(cell) else _book_cell(cell) for cell in row]
                )
        try:
            book.close()
        except FileCreateError as error:
            # a full disk is reported as for any other file
            raise error.args[0] from None


def _page_names(names: Iterable[str]) -> list[str]:
    pages: list[str] = []
    for name in names:
        allowed = re.sub(r"[\[\]:*?/\\]|^'|'$", "-", name)
        tries = (f"{allowed[: 31 - len(end)]}{end}" for k in count(1) for end in [f" {k}" if k > 1 else ""])
        pages.append(next(text for text in tries if text.lower() not in {page.lower() for page in pages}))
    return pages


def _book_cell(cell: Any) -> Any:
    if isinstance(cell, str):
        return cell.encode("utf-8", "backslashreplace").decode()
    value = cell.item() if isinstance(cell, np.generic) else cell
    return None if isinstance(value, float) and not math.isfinite(value) else value
