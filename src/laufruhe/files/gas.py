"""The working gas of a problem file: its tables, and the model or the measured trace that they make."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, measured
from laufruhe.files.fields import Table
from laufruhe.machine import PressureTrace
from laufruhe.machine.gas import GasModel, Seiliger, Wiebe

MOST_ROWS = 100_000
"""Of a measured trace."""


class ChargeTable(Table):
    """What every computed cycle says of the charge and of the gas exchange."""

    compression_ratio: f.Positive | None = None
    intake_pressure: f.PositivePressure | None = None
    exhaust_pressure: f.PositivePressure | None = None
    crankcase_pressure: f.PositivePressure | None = None


class SeiligerTable(ChargeTable):
    """Mixed cycle, its cut-off solved for the indicated mean pressure."""

    makes: ClassVar = Seiliger
    model: Literal["seiliger"]
    peak_pressure: f.PositivePressure
    imep: f.Pressure
    compression_exponent: f.Positive | None = None
    expansion_exponent: f.Positive | None = None


class WiebeTable(ChargeTable):
    """Finite heat release, the heat solved for the indicated mean pressure."""

    makes: ClassVar = Wiebe
    model: Literal["wiebe"]
    imep: f.Pressure
    start: f.Angle
    duration: f.Angle
    shape: f.NonNegative | None = None
    completeness: f.Positive | None = None
    heat_ratio: f.Positive | None = None


class TraceTable(Table):
    """A measured trace: a CSV file of crank angle after the firing dead centre and absolute pressure."""

    model: Literal["trace"]
    file: str
    pressure_unit: str = "bar"
    angle_unit: str = "deg"
    crankcase_pressure: f.PositivePressure | None = None


GasTable: TypeAlias = Annotated[SeiligerTable | WiebeTable | TraceTable, Field(discriminator="model")]


def gas_of(table: GasTable | None, folder: Path) -> GasModel | None:
    """The working gas, a trace's file beside the problem file in `folder`."""
    if table is None:
        return None
    with blamed_on("gas"):
        if isinstance(table, TraceTable):
            return _trace(table, folder)
        made: GasModel = table.makes(**table.model_dump(exclude={"model"}, exclude_none=True))
        return made


def _trace(table: TraceTable, folder: Path) -> PressureTrace:
    """Crank angles and absolute pressures of a CSV file.

    Columns are parted by commas, semicolons or tabs; beside the latter two a comma may
    be the decimal sign. The first row may be a heading, rows that begin with # are notes.
    """
    angle = measured(f"1 {table.angle_unit}", "rad", "gas.angle_unit", table.angle_unit)
    pressure = measured(f"1 {table.pressure_unit}", "Pa", "gas.pressure_unit", table.pressure_unit)
    pairs = _pairs(table.file, folder / table.file)
    extra = {} if table.crankcase_pressure is None else {"crankcase_pressure": table.crankcase_pressure}
    return PressureTrace(tuple(a * angle for a, _ in pairs), tuple(p * pressure for _, p in pairs), **extra)


def _pairs(file: str, path: Path) -> list[tuple[float, float]]:
    beside = "give a CSV file beside the problem"
    try:
        if path.exists() and not path.is_file():
            raise Refused("gas.file", file, "is no file", beside)
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        why = error.strerror or "error" if isinstance(error, OSError) else "it is no UTF-8 text"
        raise Refused("gas.file", file, f"cannot be read ({why})", beside) from None
    parted_by = next((sign for sign in ";\t" if sign in text), ",")
    pairs: list[tuple[float, float]] = []
    heading = True
    for number, line in enumerate(text.splitlines(), 1):
        row = [cell.strip().strip('"') for cell in line.split(parted_by)]
        if not line.strip() or row[0].startswith("#"):
            continue
        try:
            angle, pressure = (float(cell if parted_by == "," else cell.replace(",", ".")) for cell in (row[0], row[1]))
            pairs.append((angle, pressure))
        except (ValueError, IndexError):
            if not heading:
                rule = f"line {number} is no pair of numbers"
                raise Refused("gas.file", file, rule, "write: crank angle, pressure") from None
        heading = False
        if len(pairs) > MOST_ROWS:
            raise Refused("gas.file", file, f"has more than {MOST_ROWS} rows", "thin it out")
    return pairs
