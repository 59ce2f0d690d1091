"""Sheets as one workbook, heads held in view."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from functools import partial
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from laufruhe.report.sheet import Sheet

_PLAINLY = {"constant_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
_WHENEVER = datetime(2000, 1, 1, tzinfo=UTC)


def write_book(sheets: Mapping[str, Sheet], path: Path) -> None:
    """All sheets as one workbook; the same numbers make the same file, whenever they are written."""
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    with TemporaryDirectory() as rows:
        book = Workbook(path, {**_PLAINLY, "tmpdir": rows})
        book.set_properties({"created": _WHENEVER})
        plain = book.add_format()
        for name, sheet in zip(_page_names(sheets), sheets.values(), strict=True):
            page = book.add_worksheet(name)
            page.add_write_handler(str, partial(_as_text, plain=plain))
            page.freeze_panes(1, 0)
            for k, row in enumerate(chain([sheet.head], sheet.rows)):
                # numbers first: most cells are
                page.write_row(
                    k, 0, [cell if type(cell) is float and math.isfinite(cell) else _plain(cell) for cell in row]
                )
        try:
            book.close()
        except FileCreateError as error:
            # a full disk is told as that of any other file
            raise error.args[0] from None


def _as_text(page: Any, row: int, column: int, text: str, _: Any, plain: Any) -> int | None:
    """A text that XlsxWriter would take for its own marks of formatting, in two pieces of one format; else None."""
    if not (text.startswith("<r>") and text.endswith("</r>")):
        return None
    return int(page.write_rich_string(row, column, text[:2], plain, text[2:]))


def _page_names(names: Iterable[str]) -> list[str]:
    """Names of pages: at most 31 letters, none that a workbook forbids, no two that differ in capitals alone."""
    found: list[str] = []
    for name in names:
        whole = re.sub(r"[\[\]:*?/\\]|^'|'$", "-", name)
        tries = (f"{whole[: 31 - len(end)]}{end}" for k in count(1) for end in [f" {k}" if k > 1 else ""])
        found.append(next(each for each in tries if each.lower() not in {one.lower() for one in found}))
    return found


def _plain(cell: Any) -> Any:
    """A cell as XlsxWriter takes it: plain numbers and truths, texts of Unicode, nothing that is not finite."""
    if isinstance(cell, str):
        return cell.encode("utf-8", "backslashreplace").decode()
    value = cell.item() if isinstance(cell, np.generic) else cell
    return None if isinstance(value, float) and not math.isfinite(value) else value
