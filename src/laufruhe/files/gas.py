"""The working gas of a problem file: its tables, and the model or the measured trace that they make."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.complaints import blamed_on, measured
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.machine import PressureTrace
from laufruhe.machine.gas import GasModel, Seiliger, Wiebe


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
    """Crank angles and absolute pressures of a CSV file."""
    angle = measured(f"1 {table.angle_unit}", "rad", "gas.angle_unit", table.angle_unit)
    pressure = measured(f"1 {table.pressure_unit}", "Pa", "gas.pressure_unit", table.pressure_unit)
    pairs = rows_of(table.file, folder / table.file, "gas.file", ("crank angle", "pressure"))
    extra = {} if table.crankcase_pressure is None else {"crankcase_pressure": table.crankcase_pressure}
    return PressureTrace(tuple(a * angle for a, _ in pairs), tuple(p * pressure for _, p in pairs), **extra)
