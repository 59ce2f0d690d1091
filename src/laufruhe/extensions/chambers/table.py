"""Chambers of a problem file: [gas] with model chambers, and chambers beside gas that fires."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from laufruhe.extension import is_installed, object_at
from laufruhe.extensions.chambers.gas import Chamber, Chambers, Compressor, Pump, Steam
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, require_distinct
from laufruhe.files.fields import Table
from laufruhe.files.gas import GasContext, GasTable, names_of_cylinders
from laufruhe.machine import Cycle, GasModel
from laufruhe.machine.gas.base import AMBIENT_PRESSURE, OneChamber


class DiagramTable(Table):
    """Pressure of a chamber over one turn."""

    makes: ClassVar[type[Steam | OneChamber]]

    def of_chamber(self, _folder: Path, _where: str, _air: float, /) -> Steam | OneChamber:
        """Return the pressure; `air` is that around [Pa], and `folder` has the files that keys at `where` name."""
        return self.makes(**self.model_dump())


class SteamTable(DiagramTable):
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


class PumpTable(DiagramTable):
    """A piston pump."""

    makes: ClassVar = Pump
    suction: f.PositivePressure
    delivery: f.PositivePressure


class CompressorTable(DiagramTable):
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


# the pressure of a chamber may be recorded if that extension is installed
_RECORDED = "laufruhe.extensions.recorded_pressure.table:RecordedTable"
_WORDS = "Recorded pressure; its crank angles count from where the chamber is smallest."
_KEYS = {"trace": (object_at(_RECORDED) | None, f.optional(_WORDS))} if is_installed("recorded_pressure") else {}
TABLE = f.with_keys(ChamberTable, _KEYS)


class ChambersTable(GasTable):
    """Chambers on both sides of the pistons: steam engines, pumps, and both on one rod."""

    acts_on_bore: ClassVar = False
    single_keys: ClassVar = {"chambers": (Annotated[list[TABLE], Field(max_length=100)], Field(  # type: ignore[valid-type]
        default_factory=list,
        description="Chambers of pistons that never fire, such as those of a compressor: cylinders with bore 0.",
    ))}  # fmt: skip

    model: Literal["chambers"]
    crankcase_pressure: f.PositivePressure = f.optional("Absolute pressure of the ambient air.", AMBIENT_PRESSURE)
    chambers: Annotated[list[TABLE], Field(min_length=1, max_length=100)]  # type: ignore[valid-type]

    def read(self, context: GasContext) -> tuple[Chambers, Mapping[str, GasModel]]:
        """Return the chambers of all cylinders."""
        if context.cycle is not Cycle.TWO_STROKE:
            rule = "does not suit gas chambers, which work once a turn"
            raise Refused("engine.cycle", str(context.cycle), rule, 'write "two-stroke"')
        air = self.crankcase_pressure
        return Chambers(_chambers(self.chambers, context, air), air), {}

    @classmethod
    def read_single(cls, table: GasTable, context: GasContext, /) -> Mapping[str, GasModel]:
        """Return the chambers of pistons that never fire, by their names."""
        rows, parts, air = table.chambers, context.parts, table.crankcase_pressure  # type: ignore[attr-defined]
        for k, row in enumerate(rows, 1):
            for number in row.cylinders or [0]:
                if not number:
                    rule, remedy = "is missing beside gas that fires", "name the cylinders of the chamber, with bore 0"
                    raise Refused(f"gas.chambers[{k}].cylinders", None, rule, remedy)
                if number <= len(parts) and parts[number - 1].bore != 0.0:
                    rule = "has a bore, on which the gas that fires acts"
                    raise Refused(f"gas.chambers[{k}].cylinders", number, rule, 'give this cylinder bore = "0 mm"')
        chambers = _chambers(rows, context, air)
        names = dict.fromkeys(name for chamber in chambers for name in chamber.cylinders)
        return {name: Chambers(tuple(c for c in chambers if name in c.cylinders), air) for name in names}


def _chambers(tables: Sequence[ChamberTable], context: GasContext, air: float) -> tuple[Chamber, ...]:
    if not tables:
        return ()
    parts = context.parts
    if any(not part.has_rod for part in parts):
        raise Refused(
            "gas.model", "chambers", "needs pistons, but a rotary engine has none", "use seiliger, wiebe or trace"
        )
    if any(part.faces(other_part) for part in parts for other_part in parts):
        rule = "has pistons that share a chamber, and each chamber of [gas] needs a cylinder head"
        raise Refused(
            "engine.layout", None, rule, "give each piston its own cylinder, or use another gas model such as seiliger"
        )
    chambers = tuple(_chamber(chamber_table, k, context, air) for k, chamber_table in enumerate(tables, 1))
    require_distinct([chamber.name for chamber in chambers], "gas.chambers", "chambers have one name")
    return chambers


def _chamber(table: ChamberTable, k: int, context: GasContext, air: float) -> Chamber:
    parts, where = context.parts, f"gas.chambers[{k}]"
    keys = [key for key in ("steam", "pump", "compressor", "trace") if key in type(table).model_fields]
    diagrams = {key: table_of for key in keys if (table_of := getattr(table, key)) is not None}
    if len(diagrams) != 1:
        rule = "has no pressure" if not diagrams else f"has several pressures: {' and '.join(diagrams)}"
        raise Refused(where, None, rule, f"give the chamber one of the keys {', '.join(keys[:-1])} and {keys[-1]}")
    ((key, diagram),) = diagrams.items()
    numbers = table.cylinders if table.cylinders is not None else range(1, len(parts) + 1)
    names = tuple(names_of_cylinders(numbers, parts, f"{where}.cylinders"))
    with errors_at_key(f"{where}.{key}"):
        model = diagram.of_chamber(context.folder, f"{where}.{key}", air)
    with errors_at_key(f"{where}.rod"):
        return Chamber(table.name or f"chamber {k}", names, table.end, table.bore, table.rod, model)
