"""Rows of numbers in a CSV file in the folder of a problem file."""

from __future__ import annotations

from pathlib import Path

from laufruhe.files.complaints import Refused

MAX_ROWS, MAX_BYTES = 100_000, 10_000_000


def rows_of(file: str, path: Path, key: str, columns: tuple[str, ...]) -> list[tuple[float, ...]]:
    """Return the numbers in the first columns of a CSV file, one tuple for each row.

    Columns are separated by commas, semicolons or tabs; with the latter two a comma may be the decimal sign. The first
    row may be a heading, and rows that begin with # are skipped. Complaints are about the key of the problem file and
    name the columns.
    """
    remedy, row_name = "give a CSV file beside the problem", "pair" if len(columns) == 2 else "row"
    try:
        if path.exists() and not path.is_file():
            raise Refused(key, file, "is no file", remedy)
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise Refused(key, file, f"is larger than {MAX_BYTES // 1_000_000} MB", "remove rows")
        text = content.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror or "error" if isinstance(error, OSError) else "it is no UTF-8 text"
        raise Refused(key, file, f"cannot be read ({reason})", remedy) from None
    separator = next((sign for sign in ";\t" if sign in text), ",")
    rows: list[tuple[float, ...]] = []
    heading = True
    for number, line in enumerate(text.splitlines(), 1):
        cells = [cell.strip().strip('"') for cell in line.split(separator, len(columns))]
        if not line.strip() or cells[0].startswith("#"):
            continue
        try:
            numbers = [cells[k] if separator == "," else cells[k].replace(",", ".") for k in range(len(columns))]
            rows.append(tuple(map(float, numbers)))
        except (ValueError, IndexError):
            if not heading:
                rule = f"line {number} is no {row_name} of numbers"
                raise Refused(key, file, rule, "write: " + ", ".join(columns)) from None
        heading = False
        if len(rows) > MAX_ROWS:
            raise Refused(key, file, f"has more than {MAX_ROWS} rows", "remove rows")
    return rows
