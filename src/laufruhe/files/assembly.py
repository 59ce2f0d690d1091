"""[assembly] of a problem file: lots of measured pistons and rods."""

from __future__ import annotations

from pathlib import Path

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, measured
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.machine import Engine
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.problem.assembly import Assembly, Lot

COLUMNS = {"pistons": ("mass",), "rods": ("mass at the small end", "mass at the big end")}
MOST_PARTS = 100


class AssemblyTable(Table):
    """Measured pistons and rods: which of them goes into which cylinder is decided."""

    pistons: str | None = f.told("CSV file with the mass of each piston.")
    rods: str | None = f.told("CSV file with the masses of each rod at the small end and at the big end.")
    mass_unit: str = f.told("Unit of the masses in these files.", "g")


def assembly_of(table: AssemblyTable | None, engine: Engine, folder: Path) -> tuple[Assembly, ...]:
    """Return the lots of the files beside the problem file."""
    if table is None:
        return ()
    unit = measured(f"1 {table.mass_unit}", "kg", "assembly.mass_unit", table.mass_unit)
    lots = []
    for key, columns in COLUMNS.items():
        file, where = getattr(table, key), f"assembly.{key}"
        if file is None:
            continue
        rows = rows_of(file, folder / file, where, columns)
        count = len(engine.slider_cranks)
        if len(rows) < count:
            raise Refused(where, file, f"has {len(rows)} parts for {count} cylinders", "measure one for each at least")
        if len(rows) > MOST_PARTS:
            raise Refused(where, file, f"has {len(rows)} parts", f"at most {MOST_PARTS} can be handled")
        if min(min(row) for row in rows) <= 0.0:
            raise Refused(where, file, "has a mass that is not above zero", "correct it")
        lots.append(Lot(key[:-1], tuple((unit * row[0], unit * row[1] if len(row) > 1 else 0.0) for row in rows)))
    if not lots:
        raise Refused("assembly", None, "has no parts to choose among", "name a file of pistons or rods")
    for part in engine.slider_cranks:
        least = part.reciprocating_mass + sum(float(lot.differences[:, 0].min()) for lot in lots)
        if type(part) is not SliderCrank or least <= 0.0:
            rule = "needs plain cylinders whose reciprocating mass is above all differences of the parts"
            raise Refused("assembly", None, rule, "correct the masses, or leave it out")
    return (Assembly(tuple(lots)),)
