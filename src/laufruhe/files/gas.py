"""[gas] of a problem file, and the gas model or pressure trace that it makes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, require_distinct, si_value
from laufruhe.files.fields import Table
from laufruhe.files.recorded_trace import RecordedTable, recorded_trace
from laufruhe.machine import (
    Chamber,
    Chambers,
    Cycle,
    GasModel,
    Pump,
    Seiliger,
    SliderCrank,
    Steam,
    Wiebe,
)
from laufruhe.machine.gas import AMBIENT_PRESSURE
from laufruhe.physics.gas_cycle import chamber_cycle_of, check_chamber


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


class TraceTable(RecordedTable):
    """A recorded cylinder pressure."""

    model: Literal["trace"]
    angle_zero: f.Side | None = f.optional(
        'Crank angle after firing at which the file counts zero, or its dead centre: "firing" or "gas exchange".'
    )
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
    trace: RecordedTable | None = f.optional(
        "Recorded pressure; its crank angles count from where the chamber is smallest."
    )


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
            return Chambers(_chambers(table, folder, cycle, parts, air), air)
        if isinstance(table, TraceTable):
            chamber_cycle, pace = chamber_cycle_of(parts[0], cycle) if parts else (cycle, 1.0)
            return recorded_trace(table, folder, "gas", chamber_cycle, pace, air, _angle_zero(table, chamber_cycle))
        gas: GasModel = table.makes(**table.model_dump(exclude={"model"}, exclude_none=True))
    with errors_at_key("gas.compression_ratio"):
        for part in parts:
            check_chamber(gas, part)
    return gas


def _angle_zero(table: TraceTable, cycle: Cycle) -> str | float | None:
    # a name, or a crank angle after firing [rad]
    zero, key = table.angle_zero, "gas.angle_zero"
    if zero == "gas exchange" and cycle is Cycle.TWO_STROKE:
        raise Refused(key, zero, "does not suit a two-stroke cycle, whose dead centres all fire", "leave it out")
    if zero is None or zero in ("firing", "gas exchange"):
        return zero
    if isinstance(zero, str) and not any(character.isdigit() for character in zero):
        raise Refused(key, zero, "is no dead centre", 'write "firing", "gas exchange" or a crank angle after firing')
    return si_value(f"{zero} deg" if isinstance(zero, float | int) else zero, "rad", key)


def _chambers(
    table: ChambersTable, folder: Path, cycle: Cycle, parts: Sequence[SliderCrank], air: float
) -> tuple[Chamber, ...]:
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
    chambers = tuple(
        _chamber(chamber_table, k, folder, parts, air) for k, chamber_table in enumerate(table.chambers, 1)
    )
    require_distinct([chamber.name for chamber in chambers], "gas.chambers", "chambers have one name")
    return chambers


def _chamber(table: ChamberTable, k: int, folder: Path, parts: Sequence[SliderCrank], air: float) -> Chamber:
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
        model = (
            recorded_trace(diagram, folder, f"{where}.trace", Cycle.TWO_STROKE, 1.0, air, 0.0)
            if key == "trace"
            else diagram.makes(**diagram.model_dump())
        )
    names = tuple(parts[number - 1].name for number in numbers)
    with errors_at_key(f"{where}.rod"):
        return Chamber(table.name or f"chamber {k}", names, table.end, table.bore, table.rod, model)
