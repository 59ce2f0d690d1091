"""Tables of numbers as test benches, spreadsheets and simulations write them."""

from __future__ import annotations

import codecs
import csv
import io
import re
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array

Row: TypeAlias = Sequence[Any]
_DIALECTS: tuple[tuple[str | None, str], ...] = (
    ("\t", "."), ("\t", ","), (";", "."), (";", ","), (None, "."), (None, ","), (",", "."), (",", ",")
)  # fmt: skip
"""Separators, None for blanks, and decimal signs; the first of several that read the same number of numbers counts."""
_COMMENTS = ("#", "%", "!", "//")
_WITH_COMMA = re.compile(r"[+-]?(?:\d+(?:,\d+)?|,\d+)(?:[eE][+-]?\d+)?")
_BRACKETS = re.compile(r"[\[(<]([^\])>]+)[\])>]")
_SAMPLE = 200
MAX_UNPACKED = 300_000_000
"""Largest number of bytes of the unpacked parts of a spreadsheet."""
_BINARY = {
    b"\xd0\xcf\x11\xe0": "a workbook of the old kind (.xls)",
    b"\x89HDF": "an HDF5 file",
    b"TDSm": "a TDMS file",
    b"MDF ": "an MDF file",
}
"""First bytes of files that are not read, and their names."""
_ANGLE = re.compile(
    r"(?:ca|kw)?(?:°|deg(?:rees?)?|grad)(?:ca|kw|cra|cad|crank|crankangle)?(?:a(?:fter)?tdcf?)?|cad|dca|rad(?:ians?)?"
)
_OTHER = {"s": "s", "sec": "s", "ms": "s", "us": "s", "µs": "s", "v": "V", "mv": "V", "volt": "V"}
_PRESSURES = {
    "bar": "bar", "mbar": "mbar", "pa": "Pa", "hpa": "hPa", "kpa": "kPa", "mpa": "MPa", "psi": "psi", "atm": "atm",
    "at": "kp/cm^2", "kp/cm2": "kp/cm^2", "kgf/cm2": "kp/cm^2", "kg/cm2": "kp/cm^2", "n/mm2": "N/mm^2",
}  # fmt: skip
_TORQUES = {"nm": "N m", "knm": "kN m"}
_OVER_ANGLE = ("rad", "Pa", "N m")
_GAUGE, _ABSOLUTE = ("g", "_g", "gauge", "ü"), ("a", "_a", "abs", "_abs", "absolute")


@dataclass(frozen=True)
class Unit:
    """Unit in a heading: SI unit of its dimension (such as "rad"), its name, and True for a gauge pressure."""

    dimension: str
    name: str
    is_gauge: bool = False


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Columns of numbers in a file.

    Attributes
    ----------
    names, units
        Heading and unit of each column; empty and None if the file has none.
    values
        Numbers, shape (rows, columns); nan if a cell has none.
    lines
        Line of the file for each row, counted from one.
    """

    names: tuple[str, ...]
    units: tuple[Unit | None, ...]
    values: Array
    lines: tuple[int, ...]


def unit_in(text: str) -> Unit | None:
    """Return the unit that a text is, such as "bar", "[°KW]" or "kPa abs"; None for other texts."""
    plain = re.sub(r"[\s.^()<>\[\]-]+", "", text.lower()).replace("º", "°").replace("²", "2")
    if _ANGLE.fullmatch(plain):
        return Unit("rad", "rad" if plain.startswith("rad") else "deg")
    if (torque := _TORQUES.get(re.sub("[·*]", "", plain))) is not None:
        return Unit("N m", torque)
    if plain in _OTHER:
        return Unit(_OTHER[plain], plain)
    for suffix in ("", *_GAUGE, *_ABSOLUTE):
        if plain.endswith(suffix) and (name := _PRESSURES.get(plain.removesuffix(suffix))):
            return Unit("Pa", name, suffix in _GAUGE)
    return None


def _unit_of_name(name: str) -> Unit | None:
    # unit in a heading such as "p [bar]", "Druck in bar" or "crank_angle_deg"
    in_brackets = [part for text in _BRACKETS.findall(name) for part in (text, text.split()[0] if text.split() else "")]
    words = re.split(r"[\s_/,]+", name.strip())
    return next((unit for text in (*in_brackets, *words[1:][-1:]) if (unit := unit_in(text))), None)


@lru_cache(maxsize=4)
def number_table(content: bytes, suffix: str, sheet: str | None = None) -> NumberTable:
    """Return the table of numbers in the content of a text, .xlsx or .mat file; `sheet` is that of a spreadsheet.

    Raises
    ------
    ModelError
        If the file cannot be read; the text has rule and remedy.
    """
    for mark, name in _BINARY.items():
        if content.startswith(mark):
            raise ModelError(f"is {name}; save it as text, as .xlsx, or as .mat with -v7")
    is_book = suffix in (".xlsx", ".xlsm") or content.startswith(b"PK\x03\x04")
    if sheet is not None and not is_book:
        raise ModelError("is no workbook, so it has no sheets; leave out the key sheet")
    if suffix == ".mat" or content.startswith(b"MATLAB"):
        return _of_matlab(content)
    if is_book:
        return _of_spreadsheet(content, sheet)
    lines = [line.strip("\r\n") for line in _text(content).splitlines()]
    separator, decimal = _dialect(lines)
    is_comment = [line.lstrip().startswith(_COMMENTS) for line in lines]
    plain = [line.lstrip().lstrip("#%!/ ") if skip else line for line, skip in zip(lines, is_comment, strict=True)]
    return _table(list(_cells(plain, separator)), decimal, is_comment)


def _text(content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    if b"\0" in content[:100]:
        return content.decode("utf-16-le" if content[1:2] == b"\0" else "utf-16-be", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # every text is valid in this encoding, and its degree sign is that of most test benches
        return content.decode("latin-1")


def _cells(lines: Sequence[str], separator: str | None) -> Iterator[list[str]]:
    for line in lines:
        if separator is None:
            yield line.split()
        elif '"' in line:
            yield next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        else:
            yield line.split(separator)


def _number(cell: Any, decimal: str) -> float | None:
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    if not isinstance(cell, str):
        return None
    text = cell.strip()
    if decimal == ",":
        return float(text.replace(",", ".")) if _WITH_COMMA.fullmatch(text) else None
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _dialect(lines: Sequence[str]) -> tuple[str | None, str]:
    # separator and decimal sign that read the most numbers in the middle of a file
    filled = [line for line in lines if line.strip() and not line.lstrip().startswith(_COMMENTS)]
    first = max((len(filled) - _SAMPLE) // 2, 0)
    sample = filled[first : first + _SAMPLE]

    def count(dialect: tuple[str | None, str]) -> int:
        return sum(_number(cell, dialect[1]) is not None for row in _cells(sample, dialect[0]) for cell in row)

    return max(_DIALECTS, key=count)


def _table(rows: Sequence[Row], decimal: str, is_comment: Sequence[bool] = ()) -> NumberTable:
    """Return the table of a block of numbers with headings over it; comments may hold headings, but no numbers."""
    numbers = [
        [None] * len(row) if is_comment and is_comment[k] else [_number(cell, decimal) for cell in row]
        for k, row in enumerate(rows)
    ]
    usual = _usual_columns(numbers)
    if not usual:
        return NumberTable((), (), np.empty((0, 0)), ())
    numbers = [[*row, *[None] * (usual[-1] + 1 - len(row))] for row in numbers]
    present = [sum(row[column] is not None for column in usual) for row in numbers]
    start = next(k for k, count in enumerate(present) if count == len(usual))
    last = max(k for k, count in enumerate(present) if count)
    headings = {_cell(row, 0).lower() for row in rows[:start]} - {""}
    selection = [k for k in range(start, last + 1) if 2 * present[k] >= len(usual) and numbers[k][usual[0]] is not None]
    for k in sorted(set(range(start, last)) - set(selection)):
        is_blank = not any(_cell(rows[k], column) for column in range(len(rows[k])))
        if not (is_blank or (is_comment and is_comment[k]) or _cell(rows[k], 0).lower() in headings):
            raise ModelError(f"line {k + 1} is no row of numbers; correct or remove it")
    values = np.array([[numbers[k][column] for column in usual] for k in selection], dtype=float)
    width = max(len(rows[k]) for k in selection)
    names, units = _headings([row for row in rows[:start] if any(map(str, row))], usual, width)
    return NumberTable(names, units, values, tuple(k + 1 for k in selection))


def _usual_columns(numbers: Sequence[Sequence[float | None]]) -> list[int]:
    # columns that have numbers in most rows of the middle
    filled = [row for row in numbers if any(x is not None for x in row)]
    first = max((len(filled) - _SAMPLE) // 2, 0)
    sample = filled[first : first + _SAMPLE]
    counts = Counter(frozenset(k for k, x in enumerate(row) if x is not None) for row in sample)
    ranked = sorted(counts.items(), key=lambda pair: (pair[1], len(pair[0])))
    return sorted(ranked[-1][0]) if ranked else []


def _cell(row: Row, column: int) -> str:
    return "" if column >= len(row) or row[column] is None else str(row[column]).strip()


def _is_unit(cell: str) -> bool:
    # "CA [deg]" is a name with its unit; "°CA" and "[deg CA]" are units
    unit, is_named = unit_in(cell), cell[:1] not in "[(<" and any(map(unit_in, _BRACKETS.findall(cell)))
    return unit is not None and unit.dimension in _OVER_ANGLE and not is_named


def _headings(rows: Sequence[Row], usual: Sequence[int], width: int) -> tuple[tuple[str, ...], tuple[Unit | None, ...]]:
    """Return names and units of columns from the rows over the numbers: the nearest names, and a row of units.

    A row of more cells than the `width` of the numbers has names with separators in them.
    """
    aligned = [[_cell(row, column) for column in usual] for row in rows if len(usual) <= len(row) <= width]
    unit_rows = [cells for cells in aligned if any(map(_is_unit, cells))]
    name_rows = [cells for cells in aligned if cells not in unit_rows and 2 * sum(map(bool, cells)) >= len(cells)]
    names = tuple(name_rows[-1]) if name_rows else ("",) * len(usual)
    of_names = [_unit_of_name(name) for name in names]
    if not name_rows and rows:
        # names with blanks do not stand over their columns, but their units have the same order
        texts = _BRACKETS.findall(" ".join(map(str, rows[-1])))
        of_names = [unit_in(text) for text in texts] if len(texts) == len(usual) else of_names
    of_row = [unit_in(cell) for cell in unit_rows[-1]] if unit_rows else [None] * len(usual)
    return names, tuple(unit or other for unit, other in zip(of_row, of_names, strict=True))


def _of_spreadsheet(content: bytes, sheet: str | None) -> NumberTable:
    """Return the table on a sheet of a workbook; by default on that with the most rows of numbers."""
    try:
        import openpyxl
    except ModuleNotFoundError:
        raise ModelError("is a spreadsheet, and the Python library openpyxl is missing; pip install openpyxl") from None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MAX_UNPACKED:
            raise ModelError(f"has more than {MAX_UNPACKED // 1_000_000} MB when unpacked; remove rows")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
            rows_of = {page.title: list(page.iter_rows(values_only=True)) for page in book.worksheets}
    except ModelError:
        raise
    except Exception as error:
        # the library raises errors of zip and XML files of many kinds
        raise ModelError("is no spreadsheet that can be read; save it as .xlsx again") from error
    if sheet is not None and sheet not in rows_of:
        raise ModelError(f"has no sheet '{sheet}'; it has: {', '.join(rows_of)}")

    def count(title: str) -> int:
        return sum(sum(_number(cell, ".") is not None for cell in row) > 1 for row in rows_of[title])

    return _table(rows_of.get(sheet or max(rows_of, key=count, default=""), []), ".")


def _of_matlab(content: bytes) -> NumberTable:
    """Return the variables with as many numbers as the longest vector or matrix, those of structures by their paths."""
    from scipy.io import loadmat

    # stubs of the library know paths only
    stream: Any = io.BytesIO(content)
    try:
        variables = loadmat(stream, simplify_cells=True)
    except NotImplementedError:
        raise ModelError("is a MATLAB file of version 7.3; save it with -v7") from None
    except Exception as error:
        # the library raises many kinds of errors
        raise ModelError("is no MATLAB file; save it with -v7, or as text") from error
    arrays = dict(_arrays({name: value for name, value in variables.items() if not name.startswith("__")}))
    rows = max((max(array.shape) for array in arrays.values()), default=0)
    columns: dict[str, Array] = {}
    for name, array in arrays.items():
        matrix = array.reshape(len(array), -1)
        if len(matrix) != rows:
            matrix = matrix.T
        if len(matrix) == rows:
            is_one = matrix.shape[1] == 1
            columns |= {name if is_one else f"{name} {k + 1}": column for k, column in enumerate(matrix.T)}
    if not columns:
        return _table([], ".")
    names = tuple(columns)
    values = np.stack([columns[name] for name in names], axis=1).astype(float)
    return NumberTable(names, tuple(_unit_of_name(name) for name in names), values, tuple(range(1, rows + 1)))


def _arrays(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    # numeric arrays of up to two dimensions in nested variables, with their paths
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _arrays(inner, f"{name}.{key}" if name else str(key))
    elif (isinstance(value, np.ndarray) and value.dtype == object) or isinstance(value, list):
        for k, inner in enumerate(value, 1):
            yield from _arrays(inner, f"{name}[{k}]")
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.size > 1 and value.ndim <= 2:
        yield name, value
