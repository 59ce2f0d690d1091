"""Rows of numbers in a CSV file in the folder of a problem file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from laufruhe.files.complaints import Refused, errors_at_key, require_distinct
from laufruhe.files.number_tables import NumberTable, number_table
from laufruhe.numerics.arrays import Array, ComplexArray

MAX_ROWS, MAX_BYTES = 100_000, 30_000_000
# headings of the two columns of a complex number, and True if they are its amount and its angle
_PARTS = (("real", "imaginary", False), ("magnitude", "phase", True), ("amplitude", "phase", True))


def rows_of(file: str, path: Path, key: str, columns: tuple[str, ...]) -> list[tuple[float, ...]]:
    """Return the numbers in the first columns of a file, one tuple for each row; complaints name the columns."""
    table, count = table_of(file, path, key), len(columns)
    if len(table.lines) > MAX_ROWS:
        raise Refused(key, file, f"has more than {MAX_ROWS} rows", "remove rows")
    rows = np.full((len(table.lines), count), np.nan)
    rows[:, : table.values.shape[1]] = table.values[:, :count]
    for line, row in zip(table.lines, rows, strict=True):
        if np.isnan(row).any():
            rule = f"line {line} is no {'pair' if count == 2 else 'row'} of numbers"
            raise Refused(key, file, rule, "write: " + ", ".join(columns))
    return [tuple(row) for row in rows.tolist()]


def table_of(file: str, path: Path, key: str, sheet: str | None = None) -> NumberTable:
    """Return the table of numbers in a text file, a spreadsheet or a MATLAB file; complaints are about the key."""
    remedy = "give a file beside the problem"
    try:
        if path.exists() and not path.is_file():
            raise Refused(key, file, "is no file", remedy)
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror or "error" if isinstance(error, OSError) else "its name is none"
        raise Refused(key, file, f"cannot be read ({reason})", remedy) from None
    if len(content) > MAX_BYTES:
        raise Refused(key, file, f"is larger than {MAX_BYTES // 1_000_000} MB", "remove rows")
    with errors_at_key(key, file):
        return number_table(content, path.suffix.lower(), sheet)


def named_columns(file: str, table: NumberTable, where: str) -> dict[str, Array]:
    """Return the columns of a table by their headings without units, in lower case; angles in radians."""
    names = [" ".join(re.sub(r"[\[(].*?[\])]", " ", name).casefold().split()) for name in table.names]
    require_distinct(names, where, f"columns of {file} have one name")
    factors = [
        np.pi / 180.0 if name.endswith("phase") and (unit is None or unit.name != "rad") else 1.0
        for name, unit in zip(names, table.units, strict=True)
    ]
    return {name: factor * column for name, factor, column in zip(names, factors, table.values.T, strict=True)}


def take_complex(place: str, columns: dict[str, Array]) -> ComplexArray | None:
    """Remove the two columns of a complex number from `columns`, and return it; None if there are no such columns."""
    for first, second, is_polar in _PARTS:
        names = [f"{place} {part}".strip().casefold() for part in (first, second)]
        if all(name in columns for name in names):
            one, other = (columns.pop(name) for name in names)
            return np.asarray(one * np.exp(1j * other) if is_polar else one + 1j * other)
    return None
