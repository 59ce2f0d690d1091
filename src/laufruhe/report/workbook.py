"""Sheets as one workbook of numbers and texts (Office Open XML, ECMA-376), heads held in view.

Cells are written as they are, without formats and formulas, so a page is a line of text for every row. The same numbers
make the same file, whenever they are written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import chain, count
from numbers import Real
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from laufruhe.report.sheet import Sheet

MOST_ROWS, MOST_COLUMNS, LONGEST = 1_048_576, 16_384, 32_767
"""Rows and columns of a page, and letters of a text, that spreadsheets take; what is beyond is in the CSV files."""
FAST = 1
"""Of deflate: a quarter of the time that its default takes, for a file that is a fifth larger."""

_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_OPEN = "http://schemas.openxmlformats.org"
_MAIN, _RELATED = f"{_OPEN}/spreadsheetml/2006/main", f"{_OPEN}/officeDocument/2006/relationships"
_PACKAGE, _OF_SHEETS = f"{_OPEN}/package/2006", "application/vnd.openxmlformats-officedocument.spreadsheetml"
_STYLES = (
    f'{_HEAD}<styleSheet xmlns="{_MAIN}">'
    '<fonts count="1"><font><sz val="11"/><name val="Calibri"/><family val="2"/></font></fonts>'
    '<fills count="2"><fill><patternFill patternType="none"/></fill><fill><patternFill patternType="gray125"/></fill>'
    '</fills><borders count="1"><border><left/><right/><top/><bottom/><diagonal/></border></borders>'
    '<cellStyleXfs count="1"><xf numFmtId="0" fontId="0" fillId="0" borderId="0"/></cellStyleXfs>'
    '<cellXfs count="1"><xf numFmtId="0" fontId="0" fillId="0" borderId="0" xfId="0"/></cellXfs>'
    '<cellStyles count="1"><cellStyle name="Normal" xfId="0" builtinId="0"/></cellStyles></styleSheet>'
)
# control characters, and what would be read as one
_UNWRITABLE = re.compile("[\x00-\x08\x0b-\x1f\ufffe\uffff]|_(?=x[0-9a-fA-F]{4}_)")


def write_book(sheets: Mapping[str, Sheet], path: Path) -> None:
    """All sheets as one workbook."""
    names = _page_names(sheets)
    with ZipFile(path, "w", ZIP_DEFLATED, compresslevel=FAST) as book:
        parts = {name: iter([text]) for name, text in _frame(names).items()}
        parts |= {_place(k): _page(sheet, k) for k, sheet in enumerate(sheets.values(), 1)}
        for name, texts in parts.items():
            with book.open(name, "w") as stream:
                for text in texts:
                    stream.write(text.encode("utf-8", "backslashreplace"))


def _place(k: int) -> str:
    return f"xl/worksheets/sheet{k}.xml"


def _frame(names: Sequence[str]) -> dict[str, str]:
    """Parts of the package that say where the pages are."""
    pages = range(1, len(names) + 1)
    kinds = {"xl/workbook.xml": "sheet.main", "xl/styles.xml": "styles", **{_place(k): "worksheet" for k in pages}}
    kinds_told = "".join(
        f'<Override PartName="/{name}" ContentType="{_OF_SHEETS}.{kind}+xml"/>' for name, kind in kinds.items()
    )
    sheets = "".join(f'<sheet name="{escape(name)}" sheetId="{k}" r:id="rId{k}"/>' for k, name in enumerate(names, 1))
    of_book = {**{f"worksheets/sheet{k}.xml": "worksheet" for k in pages}, "styles.xml": "styles"}
    return {
        "[Content_Types].xml": f'{_HEAD}<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" ContentType='
        '"application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" '
        f'ContentType="application/xml"/>{kinds_told}</Types>',
        "_rels/.rels": _related({"xl/workbook.xml": "officeDocument"}),
        "xl/workbook.xml": f'{_HEAD}<workbook xmlns="{_MAIN}" xmlns:r="{_RELATED}">'
        f"<sheets>{sheets}</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": _related(of_book),
        "xl/styles.xml": _STYLES,
    }


def _related(parts: Mapping[str, str]) -> str:
    lines = (
        f'<Relationship Id="rId{k}" Type="{_RELATED}/{kind}" Target="{name}"/>'
        for k, (name, kind) in enumerate(parts.items(), 1)
    )
    return f'{_HEAD}<Relationships xmlns="{_PACKAGE}/relationships">{"".join(lines)}</Relationships>'


def _page(sheet: Sheet, k: int) -> Iterator[str]:
    """A page, row by row; the first one is shown."""
    shown = ' tabSelected="1"' if k == 1 else ""
    yield (
        f'{_HEAD}<worksheet xmlns="{_MAIN}"><sheetViews><sheetView{shown} workbookViewId="0"><pane ySplit="1" '
        'topLeftCell="A2" activePane="bottomLeft" state="frozen"/><selection pane="bottomLeft"/></sheetView>'
        "</sheetViews><sheetData>"
    )
    columns = [_letters(number) for number in range(1, min(len(sheet.head), MOST_COLUMNS) + 1)]
    for number, row in zip(range(1, MOST_ROWS + 1), chain([sheet.head], sheet.rows), strict=False):
        # numbers first: most cells are
        cells = [
            f'<c r="{column}{number}"><v>{cell:.16G}</v></c>'
            if type(cell) is float and math.isfinite(cell)
            else _other(f"{column}{number}", cell)
            for column, cell in zip(columns, row, strict=False)
        ]
        if any(cells):
            yield f'<row r="{number}">{"".join(cells)}</row>'
    yield "</sheetData></worksheet>"


def _letters(number: int) -> str:
    """Name of a column, counted from one: A ... Z, AA ..."""
    found = ""
    while number:
        number, digit = divmod(number - 1, 26)
        found = chr(ord("A") + digit) + found
    return found


def _other(place: str, cell: Any) -> str:
    """A cell that is no usual number; none where it is empty, or no finite number."""
    if isinstance(cell, bool | np.bool_):
        return f'<c r="{place}" t="b"><v>{cell:d}</v></c>'
    if isinstance(cell, Real):
        return f'<c r="{place}"><v>{float(cell):.16G}</v></c>' if math.isfinite(cell) else ""
    if cell is None or cell == "":
        return ""
    # a text of its own in the file is no formula, whatever it begins with
    text = _UNWRITABLE.sub(lambda found: f"_x{ord(found[0]):04X}_", str(cell)[:LONGEST])
    kept = ' xml:space="preserve"' if text != text.strip() else ""
    return f'<c r="{place}" t="inlineStr"><is><t{kept}>{escape(text, quote=False)}</t></is></c>'


def _page_names(names: Iterable[str]) -> list[str]:
    """Names of pages: at most 31 letters, none that a workbook forbids, no two that differ in capitals alone."""
    found: list[str] = []
    for name in names:
        whole = re.sub(r"[\[\]:*?/\\]|^'|'$", "-", name)
        tries = (f"{whole[: 31 - len(end)]}{end}" for k in count(1) for end in [f" {k}" if k > 1 else ""])
        found.append(next(each for each in tries if each.lower() not in {one.lower() for one in found}))
    return found
