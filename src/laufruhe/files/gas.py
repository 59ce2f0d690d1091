"""[gas] of a problem file, and the gas model or pressure trace that it makes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field

from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, require_distinct, si_value
from laufruhe.files.fields import Table
from laufruhe.files.recorded_trace import NEAR_FIRING, Column, RecordedTable, recorded_trace
from laufruhe.machine import (
    Chamber,
    Chambers,
    Compressor,
    Cycle,
    GasModel,
    PressureTrace,
    Pump,
    Seiliger,
    SliderCrank,
    Steam,
    Wiebe,
)
from laufruhe.machine.chambers import CommonGas, CylinderGases
from laufruhe.machine.gas import AMBIENT_PRESSURE, Charge
from laufruhe.physics.gas_cycle import chamber_cycle_of, check_chamber


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


class CompressorTable(Table):
    """A piston compressor of gas with ideal valves."""

    makes: ClassVar = Compressor
    suction: f.PositivePressure
    delivery: f.PositivePressure
    clearance: f.Positive = f.optional("Volume left at the dead centre, over that of the stroke.", 0.05)
    exponent: f.Positive = f.optional("Polytropic exponent of compression and of the expansion of what is left.", 1.3)


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
    compressor: CompressorTable | None = None
    trace: RecordedTable | None = f.optional(
        "Recorded pressure; its crank angles count from where the chamber is smallest."
    )


class SingleGasTable(Table):
    """Cylinders whose gas differs; missing keys are those of [gas]."""

    cylinders: Annotated[list[f.CylinderNumber], f.ListOrSingle(f.CylinderNumber), Field(min_length=1)] = f.required(
        "Their numbers."
    )
    imep: f.MeanPressure | None = f.optional("Indicated mean effective pressure of these cylinders.")
    peak_pressure: f.PositivePressure | None = f.optional("Peak pressure of these cylinders, with model seiliger.")
    compression_ratio: f.Positive | None = None


class ChargeTable(Table):
    """Charge and gas exchange of a computed cycle."""

    compression_ratio: f.Positive = Charge.compression_ratio
    intake_pressure: f.PositivePressure = Charge.intake_pressure
    exhaust_pressure: f.PositivePressure = Charge.exhaust_pressure
    crankcase_pressure: f.PositivePressure = Charge.crankcase_pressure


class FiredTable(Table):
    """Gas of cylinders that fire, beside chambers of pistons that do not."""

    single_cylinders: list[SingleGasTable] = Field(default_factory=list)
    chambers: Annotated[list[ChamberTable], Field(max_length=100)] = Field(
        default_factory=list,
        description="Chambers of pistons that never fire, such as those of a compressor: cylinders with bore 0.",
    )


class SeiligerTable(ChargeTable, FiredTable):
    """Seiliger cycle (mixed heat supply); its cut-off follows from the indicated mean pressure."""

    makes: ClassVar = Seiliger
    model: Literal["seiliger"]
    peak_pressure: f.PositivePressure
    imep: f.MeanPressure | None = f.optional(
        "Indicated mean effective pressure; needed unless every operating point has a load of its own."
    )
    compression_exponent: f.Positive = Seiliger.compression_exponent
    expansion_exponent: f.Positive = Seiliger.expansion_exponent


class WiebeTable(ChargeTable, FiredTable):
    """Cycle with Wiebe heat release; the heat follows from the indicated mean pressure."""

    makes: ClassVar = Wiebe
    model: Literal["wiebe"]
    imep: f.MeanPressure | None = f.optional(
        "Indicated mean effective pressure; needed unless every operating point has a load of its own."
    )
    start: f.Angle
    duration: f.Angle
    shape: f.NonNegative = Wiebe.shape
    completeness: f.Positive = Wiebe.completeness
    heat_ratio: f.Positive = Wiebe.heat_ratio


class RecordedGasTable(RecordedTable):
    """Recorded pressures of the cylinders of an engine."""

    angle_zero: f.Side | None = f.optional(
        'Crank angle after firing at which the file counts zero, or its dead centre: "firing" or "gas exchange".'
    )
    cylinder_columns: Annotated[list[Column], Field(min_length=1, max_length=48)] | None = f.optional(
        "Names or numbers of the columns with the pressures of cylinders 1, 2, 3, ..., in place of pressure_column."
    )
    motored_column: Column | None = f.optional(
        "Name or number of the column of a cylinder without combustion, counted from its own firing; of points and "
        "cylinders that are motored or misfire."
    )
    cylinder_angles: Literal["own", "common"] = f.optional(
        'Firing from which the angles of cylinder_columns count: each from that of its cylinder ("own"), or all from '
        'that of cylinder 1 ("common").',
        "own",
    )


class TraceTable(RecordedGasTable, FiredTable):
    """A recorded cylinder pressure."""

    model: Literal["trace"]
    crankcase_pressure: f.PositivePressure = AMBIENT_PRESSURE


class ChambersTable(Table):
    """Chambers on both sides of the pistons: steam engines, pumps, and both on one rod."""

    model: Literal["chambers"]
    crankcase_pressure: f.PositivePressure = f.optional("Absolute pressure of the ambient air.", AMBIENT_PRESSURE)
    chambers: Annotated[list[ChamberTable], Field(min_length=1, max_length=100)]


GasTable: TypeAlias = Annotated[SeiligerTable | WiebeTable | TraceTable | ChambersTable, Field(discriminator="model")]


_MODELS: Mapping[str, type[Table]] = {
    "seiliger": SeiligerTable, "wiebe": WiebeTable, "trace": TraceTable, "chambers": ChambersTable,
}  # fmt: skip


def default_numbers(gas: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield key and text of each number that [gas] of a file leaves to its default."""
    for key, field in _MODELS[gas["model"]].model_fields.items():
        if key not in gas and isinstance(field.default, float):
            unit = next(one.unit for one in field.metadata if isinstance(one, f.Number))
            yield key, f"{1e-5 * field.default:g} bar" if unit == "Pa" else f"{field.default:g}"


def needs_bore(table: GasTable | None) -> bool:
    """Return True if the gas acts on the bore of [engine]; gas chambers have bores of their own."""
    return table is not None and not isinstance(table, ChambersTable)


def gas_of(
    table: GasTable | None, folder: Path, cycle: Cycle, parts: Sequence[SliderCrank], where: str = "gas"
) -> GasModel | None:
    """Return the gas model of the engine, or None without [gas]; traces are in the folder of the problem file.

    `where` is the key of the recorded pressures in complaints. The chambers of the slider-cranks are checked.
    """
    if table is None:
        return None
    air = table.crankcase_pressure
    with errors_at_key("gas"):
        if isinstance(table, ChambersTable):
            if cycle is not Cycle.TWO_STROKE:
                rule = "does not suit gas chambers, which work once a turn"
                raise Refused("engine.cycle", str(cycle), rule, 'write "two-stroke"')
            return Chambers(_chambers(table.chambers, folder, parts, air), air)
        single = _single_chambers(table, folder, parts, air)
        common: CommonGas
        if isinstance(table, TraceTable):
            common, traces = _traces(table, folder, cycle, parts, air, where)
            single |= traces
        else:
            common = table.makes(**_numbers(table))
            for k, row in enumerate(table.single_cylinders, 1):
                where = f"gas.single_cylinders[{k}]"
                numbers = row.model_dump(exclude={"cylinders"}, exclude_none=True)
                for key in numbers:
                    if key not in type(table).model_fields:
                        raise Refused(f"{where}.{key}", None, f"means nothing with model {table.model}", "leave it out")
                with errors_at_key(where):
                    model = table.makes(**_numbers(table) | numbers)
                for name in names_of_cylinders(row.cylinders, parts, f"{where}.cylinders"):
                    if name in single:
                        raise Refused(f"{where}.cylinders", name, "is given twice", "name each cylinder at most once")
                    single[name] = model
    gas: GasModel = CylinderGases(common, tuple(single.items())) if single else common
    with errors_at_key("gas.compression_ratio"):
        for part in parts:
            check_chamber(gas, part)
    return gas


def _numbers(table: SeiligerTable | WiebeTable) -> dict[str, Any]:
    return table.model_dump(exclude={"model", "single_cylinders", "chambers"}, exclude_none=True)


def names_of_cylinders(numbers: Sequence[int], parts: Sequence[SliderCrank], where: str) -> list[str]:
    """Return the names of cylinders by their numbers; two pistons in one cylinder are named together."""
    names = []
    for number in numbers:
        if number > len(parts):
            raise Refused(where, number, f"is not among {counted(len(parts), 'cylinder')}", "count them from 1")
        part = parts[number - 1]
        names += [part.name, *(other.name for other in parts if part.faces(other) or other.faces(part))]
    return names


def _single_chambers(table: FiredTable, folder: Path, parts: Sequence[SliderCrank], air: float) -> dict[str, CommonGas]:
    """Return the chambers of pistons that never fire, by their names."""
    for k, row in enumerate(table.chambers, 1):
        for number in row.cylinders or [0]:
            if not number:
                rule, remedy = "is missing beside gas that fires", "name the cylinders of the chamber, with bore 0"
                raise Refused(f"gas.chambers[{k}].cylinders", None, rule, remedy)
            if number <= len(parts) and parts[number - 1].bore != 0.0:
                rule = "has a bore, on which the gas that fires acts"
                raise Refused(f"gas.chambers[{k}].cylinders", number, rule, 'give this cylinder bore = "0 mm"')
    chambers = _chambers(table.chambers, folder, parts, air)
    names = dict.fromkeys(name for chamber in chambers for name in chamber.cylinders)
    return {name: Chambers(tuple(c for c in chambers if name in c.cylinders), air) for name in names}


def _traces(
    table: TraceTable, folder: Path, cycle: Cycle, parts: Sequence[SliderCrank], air: float, where: str
) -> tuple[PressureTrace, dict[str, CommonGas]]:
    """Return the recorded trace of cylinder 1, and those of the cylinders with columns of their own, by names."""
    chamber_cycle, pace = chamber_cycle_of(parts[0], cycle) if parts else (cycle, 1.0)
    zero, columns = _angle_zero(table, chamber_cycle, f"{where}.angle_zero"), table.cylinder_columns
    read = partial(recorded_trace, folder=folder, where=where, cycle=chamber_cycle, pace=pace, air=air, zero=zero)
    motored = None
    if table.motored_column is not None:
        if table.pressure_column is None and columns is None:
            rule = "is given without pressure_column, which has the pressure with combustion"
            raise Refused(f"{where}.motored_column", table.motored_column, rule, "name both columns")
        motored = replace(read(table.model_copy(update={"pressure_column": [table.motored_column]})), is_motored=True)
    if table.single_cylinders:
        rule, remedy = "means nothing with model trace", "name a column of each cylinder by cylinder_columns"
        raise Refused("gas.single_cylinders", None, rule, remedy)
    if columns is None:
        return replace(read(table), motored=motored), {}
    if table.pressure_column is not None:
        raise Refused(f"{where}.pressure_column", None, "is given beside cylinder_columns", "keep one")
    fired = [k for k, part in enumerate(parts) if part.bore != 0.0 and not any(map(part.faces, parts[:k]))]
    if len(columns) != len(fired):
        rule = f"has {counted(len(columns), 'column')} for {counted(len(fired), 'cylinder')} that fire"
        raise Refused(f"{where}.cylinder_columns", None, rule, "name one column for each cylinder, by its number")
    traces, period = dict[str, CommonGas](), chamber_cycle.angle / pace
    if zero is None and table.cylinder_angles == "common" and chamber_cycle is Cycle.FOUR_STROKE:
        # one zero for all columns, so that none hides a wrong order of firing
        leading = table.model_copy(update={"pressure_column": [columns[0]]})
        peak, starts = _peak(read(leading, zero="firing"), period), {"firing": 0.0, "gas exchange": 0.5 * period}
        near = (name for name, start in starts.items() if abs(math.remainder(peak + start, period)) <= NEAR_FIRING)
        zero = next(near, None)
        read = partial(read, zero=zero)
    first: PressureTrace | None = None
    for k, column in zip(fired, columns, strict=True):
        one = table.model_copy(update={"pressure_column": [column]})
        later = parts[k].firing_angle - parts[fired[0]].firing_angle if table.cylinder_angles == "common" else 0.0
        trace = replace(read(one, later=later), motored=motored)
        if abs(peak := _peak(trace, period)) > NEAR_FIRING:
            other = "own" if table.cylinder_angles == "common" else "common"
            rule = f"puts the peak of {parts[k].name} {math.degrees(peak):.4g} deg after its firing"
            remedy = f'check columns and firing_order, or write cylinder_angles = "{other}"'
            raise Refused(f"{where}.cylinder_columns", column, rule, remedy)
        first = first or trace
        traces |= dict.fromkeys(names_of_cylinders([k + 1], parts, f"{where}.cylinder_columns"), trace)
    assert first is not None
    return first, traces


def _peak(trace: PressureTrace, period: float) -> float:
    return math.remainder(trace.angles[int(np.argmax(trace.pressures))], period)


def _angle_zero(table: TraceTable, cycle: Cycle, key: str) -> str | float | None:
    # a name, or a crank angle after firing [rad]
    zero = table.angle_zero
    if zero == "gas exchange" and cycle is Cycle.TWO_STROKE:
        raise Refused(key, zero, "does not suit a two-stroke cycle, whose dead centres all fire", "leave it out")
    if zero is None or zero in ("firing", "gas exchange"):
        return zero
    if isinstance(zero, str) and not any(character.isdigit() for character in zero):
        raise Refused(key, zero, "is no dead centre", 'write "firing", "gas exchange" or a crank angle after firing')
    return si_value(f"{zero} deg" if isinstance(zero, float | int) else zero, "rad", key)


def _chambers(
    tables: Sequence[ChamberTable], folder: Path, parts: Sequence[SliderCrank], air: float
) -> tuple[Chamber, ...]:
    if not tables:
        return ()
    if any(not part.has_rod for part in parts):
        raise Refused(
            "gas.model", "chambers", "needs pistons, but a rotary engine has none", "use seiliger, wiebe or trace"
        )
    if any(part.faces(other_part) for part in parts for other_part in parts):
        rule = "has pistons that share a chamber, and each chamber of [gas] needs a cylinder head"
        raise Refused(
            "engine.layout", None, rule, "give each piston its own cylinder, or use another gas model such as seiliger"
        )
    chambers = tuple(_chamber(chamber_table, k, folder, parts, air) for k, chamber_table in enumerate(tables, 1))
    require_distinct([chamber.name for chamber in chambers], "gas.chambers", "chambers have one name")
    return chambers


def _chamber(table: ChamberTable, k: int, folder: Path, parts: Sequence[SliderCrank], air: float) -> Chamber:
    where = f"gas.chambers[{k}]"
    keys = ("steam", "pump", "compressor", "trace")
    diagrams = {key: table_of for key in keys if (table_of := getattr(table, key)) is not None}
    if len(diagrams) != 1:
        rule = "has no pressure" if not diagrams else f"has several pressures: {' and '.join(diagrams)}"
        raise Refused(where, None, rule, f"give the chamber one of the keys {', '.join(keys[:-1])} and {keys[-1]}")
    ((key, diagram),) = diagrams.items()
    numbers = table.cylinders if table.cylinders is not None else range(1, len(parts) + 1)
    names = tuple(names_of_cylinders(numbers, parts, f"{where}.cylinders"))
    with errors_at_key(f"{where}.{key}"):
        model = (
            recorded_trace(diagram, folder, f"{where}.trace", Cycle.TWO_STROKE, 1.0, air, 0.0)
            if key == "trace"
            else diagram.makes(**diagram.model_dump())
        )
    with errors_at_key(f"{where}.rod"):
        return Chamber(table.name or f"chamber {k}", names, table.end, table.bore, table.rod, model)
