"""[gas] of a problem file, and the gas model or pressure trace that it makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, require_distinct, si_value
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.machine import (
    Chamber,
    Chambers,
    Cycle,
    GasModel,
    PressureTrace,
    Pump,
    Seiliger,
    SliderCrank,
    Steam,
    Wiebe,
)
from laufruhe.machine.gas import AMBIENT_PRESSURE
from laufruhe.physics.gas_cycle import check_chamber


class ChargeTable(Table):
    """Charge and gas exchange of a computed cycle."""

    compression_ratio: f.Positive | None = None
    intake_pressure: f.PositivePressure | None = None
    exhaust_pressure: f.PositivePressure | None = None
    crankcase_pressure: f.PositivePressure | None = None


class SeiligerTable(ChargeTable):
    """Seiliger cycle (mixed heat supply); its cut-off follows from the indicated mean pressure."""

    makes: ClassVar = Seiliger
    model: Literal["seiliger"]
    peak_pressure: f.PositivePressure
    imep: f.Pressure
    compression_exponent: f.Positive | None = None
    expansion_exponent: f.Positive | None = None


class WiebeTable(ChargeTable):
    """Cycle with Wiebe heat release; the heat follows from the indicated mean pressure."""

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


class SteamTable(Table):
    """An indicator diagram of straight lines and hyperbolas, its points parts of the stroke."""

    makes: ClassVar = Steam
    admission: f.PositivePressure
    back_pressure: f.PositivePressure
    cut_off: f.Part = f.required("Part of the stroke from the dead centre at which admission ends.")
    release: f.Part = f.optional("Part of the stroke at which the outlet opens.", 1.0)
    compression: f.Part = f.optional(
        "Part of the stroke before the dead centre at which the outlet closes on the way back.", 0.0
    )
    lead: f.Part = f.optional(
        "Part of the stroke before the dead centre at which fresh steam enters on the way back.", 0.0
    )
    clearance: f.NonNegative = f.optional("Volume left at the dead centre, over that of the stroke.", 0.05)
    exponent: f.Positive = f.optional("Exponent of expansion and compression; 1, a hyperbola, by default.", 1.0)


class PumpTable(Table):
    """A piston pump."""

    makes: ClassVar = Pump
    suction: f.PositivePressure
    delivery: f.PositivePressure


class SideTraceTable(Table):
    """A measured trace of one side: crank angle from where its chamber is smallest, and absolute pressure."""

    file: str
    pressure_unit: str = "bar"
    angle_unit: str = "deg"


class ChamberTable(Table):
    """A space on one side of a piston, or of a further piston on the same rod."""

    name: f.Name | None = None
    cylinders: list[f.CylinderNumber] | None = f.optional("Cylinders whose rods carry such a piston; all by default.")
    end: Literal["head", "crank"] = f.required(
        "head: pressure drives the piston towards the crank; crank: away from it."
    )
    bore: f.PositiveLength
    rod: f.NonNegativeLength = f.optional("Diameter of the piston rod where it passes through this end.", 0.0)
    steam: SteamTable | None = None
    pump: PumpTable | None = None
    trace: SideTraceTable | None = None


class ChambersTable(Table):
    """Chambers on both sides of the pistons: steam engines, pumps, and both on one rod."""

    model: Literal["chambers"]
    crankcase_pressure: f.PositivePressure | None = f.optional("Absolute pressure of the ambient air.")
    chambers: Annotated[list[ChamberTable], Field(min_length=1, max_length=100)]


GasTable: TypeAlias = Annotated[SeiligerTable | WiebeTable | TraceTable | ChambersTable, Field(discriminator="model")]


def needs_bore(table: GasTable | None) -> bool:
    """Return True if the gas acts on the bore of [engine]; gas chambers have bores of their own."""
    return table is not None and not isinstance(table, ChambersTable)


def gas_of(table: GasTable | None, folder: Path, cycle: Cycle, parts: Sequence[SliderCrank]) -> GasModel | None:
    """Return the gas model of the engine, or None without [gas]; traces are in the folder of the problem file.

    The chambers of the slider-cranks are checked.
    """
    if table is None:
        return None
    air = AMBIENT_PRESSURE if table.crankcase_pressure is None else table.crankcase_pressure
    with errors_at_key("gas"):
        if isinstance(table, ChambersTable):
            return Chambers(_chambers(table, folder, cycle, parts), air)
        if isinstance(table, TraceTable):
            return replace(_trace(table, folder, "gas"), crankcase_pressure=air)
        gas: GasModel = table.makes(**table.model_dump(exclude={"model"}, exclude_none=True))
    with errors_at_key("gas.compression_ratio"):
        for part in parts:
            check_chamber(gas, part)
    return gas


def _chambers(table: ChambersTable, folder: Path, cycle: Cycle, parts: Sequence[SliderCrank]) -> tuple[Chamber, ...]:
    if cycle is not Cycle.TWO_STROKE:
        rule = "does not suit gas chambers, which work once a turn"
        raise Refused("engine.cycle", str(cycle), rule, 'write "two-stroke"')
    if any(not part.has_rod for part in parts):
        raise Refused(
            "gas.model", "chambers", "needs pistons, but a rotary engine has none", "use seiliger, wiebe or trace"
        )
    if any(part.faces(other_part) for part in parts for other_part in parts):
        rule = "has pistons that share a chamber, and each chamber of [gas] needs a cylinder head"
        raise Refused(
            "engine.layout", None, rule, "give each piston its own cylinder, or use another gas model such as seiliger"
        )
    chambers = tuple(_chamber(chamber_table, k, folder, parts) for k, chamber_table in enumerate(table.chambers, 1))
    require_distinct([chamber.name for chamber in chambers], "gas.chambers", "chambers have one name")
    return chambers


def _chamber(table: ChamberTable, k: int, folder: Path, parts: Sequence[SliderCrank]) -> Chamber:
    where = f"gas.chambers[{k}]"
    diagrams = {key: table_of for key in ("steam", "pump", "trace") if (table_of := getattr(table, key)) is not None}
    if len(diagrams) != 1:
        rule = "has no pressure" if not diagrams else f"has several pressures: {' and '.join(diagrams)}"
        raise Refused(where, None, rule, "give the chambers one of the keys steam, pump and trace")
    ((key, diagram),) = diagrams.items()
    numbers = table.cylinders if table.cylinders is not None else range(1, len(parts) + 1)
    for number in numbers:
        if number > len(parts):
            rule = f"is not among {counted(len(parts), 'cylinder')}"
            raise Refused(f"{where}.cylinders", str(number), rule, "count them from 1")
    with errors_at_key(f"{where}.{key}"):
        is_trace = key == "trace"
        model = _trace(diagram, folder, f"{where}.trace") if is_trace else diagram.makes(**diagram.model_dump())
    names = tuple(parts[number - 1].name for number in numbers)
    with errors_at_key(f"{where}.rod"):
        return Chamber(table.name or f"chamber {k}", names, table.end, table.bore, table.rod, model)


def _trace(table: TraceTable | SideTraceTable, folder: Path, key: str) -> PressureTrace:
    angle = si_value(f"1 {table.angle_unit}", "rad", f"{key}.angle_unit", table.angle_unit)
    pressure = si_value(f"1 {table.pressure_unit}", "Pa", f"{key}.pressure_unit", table.pressure_unit)
    pairs = rows_of(table.file, folder / table.file, f"{key}.file", ("crank angle", "pressure"))
    return PressureTrace(tuple(a * angle for a, _ in pairs), tuple(p * pressure for _, p in pairs))
