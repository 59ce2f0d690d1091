"""A measured pressure trace from its CSV file."""

from __future__ import annotations

import csv
from pathlib import Path

from laufruhe.files.complaints import Refused, measured
from laufruhe.files.file_models import TraceTable
from laufruhe.machine import PressureTrace


def trace_of(table: TraceTable, folder: Path) -> PressureTrace:
    """Crank angles and absolute pressures of a CSV file beside the problem file.

    Columns are parted by commas, semicolons or tabs; beside the latter two a comma may
    be the decimal sign. The first row may be a heading, rows that begin with # are notes.

    Raises
    ------
    Refused
        If the file cannot be read, or has a row that is no pair of numbers.
    """
    angle = measured(f"1 {table.angle_unit}", "rad", "gas.angle_unit", table.angle_unit)
    pressure = measured(f"1 {table.pressure_unit}", "Pa", "gas.pressure_unit", table.pressure_unit)
    pairs = _pairs(table.file, folder / table.file)
    extra = {} if table.crankcase_pressure is None else {"crankcase_pressure": table.crankcase_pressure}
    return PressureTrace(tuple(a * angle for a, _ in pairs), tuple(p * pressure for _, p in pairs), **extra)


def _pairs(file: str, path: Path) -> list[tuple[float, float]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror or "error" if isinstance(error, OSError) else "it is no UTF-8 text"
        raise Refused("gas.file", file, f"cannot be read ({why})", "give a CSV file beside the problem") from None
    parted_by = next((sign for sign in ";\t" if sign in text), ",")
    reader = csv.reader(text.splitlines(), delimiter=parted_by)
    pairs: list[tuple[float, float]] = []
    heading = True
    for row in reader:
        if not row or row[0].lstrip().startswith("#"):
            continue
        try:
            pairs.append((_number(row[0], parted_by), _number(row[1], parted_by)))
        except (ValueError, IndexError):
            if not heading:
                rule = f"line {reader.line_num} is no pair of numbers"
                raise Refused("gas.file", file, rule, "write: crank angle, pressure") from None
        heading = False
    return pairs


def _number(text: str, parted_by: str) -> float:
    return float(text if parted_by == "," else text.replace(",", "."))
