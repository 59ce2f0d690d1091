"""[friction] of a problem file: what the engine loses between its gas and its brake, measured or told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, measured, one_of
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.machine import Cycle
from laufruhe.physics.willans import FEWEST, Friction, FrictionTest, mean_pressure, motoring_friction, willans_friction

SAME_SPEED = 0.01
"""Share of a speed within which rows of a fuel table belong to it."""


class FrictionTable(Table):
    """Friction mean effective pressure, measured in a CSV file or given, with its uncertainty."""

    closed: ClassVar[str] = "is of a measurement"

    file: str | None = f.told("CSV file: speed, load and fuel for kind fuel; speed and drag for kind motoring.")
    kind: Literal["fuel", "motoring"] = "fuel"
    speed_unit: str = "rpm"
    load_unit: str = f.told("Unit of the load in the file: of a torque, or of a mean pressure.", "N m")
    fmep: f.PositivePressure | None = f.told("Friction mean effective pressure, in place of a file.")
    deviation: Annotated[float, f.Number("Pa", least=0.0)] | None = f.told("Standard deviation of fmep.")
    deviations: f.NonNegative = f.told(
        "Number of standard deviations to either side for which the load is computed.", 2.0
    )


class Brake:
    """Indicated mean pressures of loads that are given at the brake.

    Attributes
    ----------
    displacement
        Of the engine [m3].
    said
        Of every load asked so far, for the reader of a report.
    tests
        Readings behind these, where there are any.
    """

    def __init__(self, table: FrictionTable, folder: Path, displacement: float, cycle: Cycle) -> None:
        self.table, self.displacement, self.turns = table, displacement, cycle.turns
        one_of(table, "friction", "file", "fmep")
        if table.file is not None and table.deviation is not None:
            raise Refused("friction.deviation", None, "follows from the file", "leave it out")
        self.said: list[str] = []
        self.tests: list[FrictionTest] = []
        self._rows = [] if table.file is None else self._read(table.file, folder)

    def _read(self, file: str, folder: Path) -> list[tuple[float, ...]]:
        names = ("speed", "load", "fuel")[: 3 if self.table.kind == "fuel" else 2]
        speed = measured(f"1 {self.table.speed_unit}", "rad/s", "friction.speed_unit", self.table.speed_unit)
        load, rows = self._load(), rows_of(file, folder / file, "friction.file", names)
        for k, row in enumerate(rows, 1):
            if not all(map(math.isfinite, row)):
                raise Refused("friction.file", file, f"has a number in row {k} that is not finite", "leave it out")
        return [(n * speed, p * load, *rest) for n, p, *rest in rows]

    def _load(self) -> float:
        """Mean pressure of one of the unit of the load [Pa]."""
        text, where = f"1 {self.table.load_unit}", "friction.load_unit"
        if units.dimension_of(text) == "N m":
            return self.pressure(measured(text, "N m", where, self.table.load_unit))
        return measured(text, "Pa", where, self.table.load_unit)

    def pressure(self, torque: float) -> float:
        """Mean pressure of a torque at the brake [Pa] (W1)."""
        return mean_pressure(torque, self.displacement, self.turns)

    def indicated(self, brake: float, speed: float, where: str) -> tuple[float, float, float]:
        """Least, middle and largest indicated mean pressure at a speed [Pa] (W4)."""
        friction = self._friction(speed, where)
        found = friction.indicated(brake, self.table.deviations)
        if found[0] <= brake:
            rule = f"is off by as much as {units.shown(friction.deviation, 'Pa')}, more than it is itself"
            raise Refused(
                "friction", units.shown(friction.mean, "Pa"), rule, "measure more points, or fewer deviations"
            )
        least, middle, most, loss, off = (f"{1e-5 * p:.4g}" for p in (*found, friction.mean, friction.deviation))
        self.said.append(
            f"Indicated mean pressure at {where} {middle} bar, {least} to {most} bar: {1e-5 * brake:.4g} bar at the "
            f"brake and {loss} bar of friction, {self.table.deviations:g} deviations of {off} bar to either side."
        )
        if self._rows:
            is_motored = self.table.kind == "motoring"
            x, y = zip(*(row[:2] if is_motored else row[1:] for row in self._at(speed)), strict=True)
            asked = speed if is_motored else brake
            self.tests.append(FrictionTest(where, is_motored, x, y, asked, friction, self.table.deviations))
        return found

    def _at(self, speed: float) -> list[tuple[float, ...]]:
        """Readings that tell the friction at a speed."""
        if self.table.kind == "motoring":
            return self._rows
        return [row for row in self._rows if math.isclose(row[0], speed, rel_tol=SAME_SPEED)]

    def _friction(self, speed: float, where: str) -> Friction:
        if self.table.fmep is not None:
            return Friction(self.table.fmep, self.table.deviation or 0.0)
        own = self._at(speed)
        with blamed_on("friction.file", self.table.file or ""):
            if self.table.kind == "motoring":
                return motoring_friction([row[0] for row in own], [row[1] for row in own], speed)
            if len(own) < FEWEST:
                rule = f"has {len(own)} points at {units.shown(speed, 'rad/s')} of {where}, and a line takes {FEWEST}"
                raise Refused("friction.file", self.table.file, rule, "measure more loads at that speed")
            return willans_friction([row[1] for row in own], [row[2] for row in own])
