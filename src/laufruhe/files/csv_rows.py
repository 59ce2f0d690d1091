"""Rows of numbers in a CSV file in the folder of a problem file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from laufruhe.files.complaints import Refused, errors_at_key
from laufruhe.files.number_tables import NumberTable, number_table

MAX_ROWS, MAX_BYTES = 100_000, 30_000_000


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
