"""[[operating_points]] and [friction] of a problem file: speeds, and loads of the gas or at the brake."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, require_distinct, require_one_of, si_value
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.cylinder_states import StateTable, cylinder_states
from laufruhe.files.fields import Name, Table
from laufruhe.files.gas import ChargeTable, GasTable
from laufruhe.machine import Cycle, GasModel, OperatingPoint, SliderCrank
from laufruhe.machine.gas.base import AMBIENT_PRESSURE
from laufruhe.machine.slider_crank import displacement
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.willans import FEWEST, Friction, FrictionTest, mean_pressure, motoring_friction, willans_friction

MAX_POINTS = 200
"""Largest number of operating points; each takes 14 MB and 0.2 s on four mounts."""
SAME_SPEED = 0.01
"""Relative difference of speeds within which rows of a fuel table belong together."""


class OperatingPointTable(StateTable):
    """A speed and a load."""

    name: Name | None = None
    speed: f.Speed | None = None
    mean_piston_speed: f.PistonSpeed | None = None
    imep: f.MeanPressure | None = f.optional(
        "Indicated mean effective pressure at this point, in place of that of [gas]."
    )
    peak_pressure: f.PositivePressure | None = f.optional("Peak pressure at this point, in place of that of [gas].")
    intake_pressure: f.PositivePressure | None = f.optional(
        "Absolute pressure in the manifold at this point, in place of that of [gas]; 0.3 to 0.5 bar in a throttled "
        "engine at idle."
    )
    bmep: f.NonNegativeMeanPressure | None = f.optional(
        "Brake mean effective pressure, 0 at idle; [friction] adds what friction takes, and its uncertainty. With a "
        "recorded pressure friction is the difference to its imep."
    )
    brake_torque: f.NonNegativeTorque | None = f.optional("Torque at the brake, in place of bmep.")
    motored: bool = f.optional("The charge is compressed without combustion.", False)
    gas: bool = f.optional("false: no gas at this point.", True)
    up_to: f.Speed | None = f.optional("Highest speed of a range that starts at speed.")
    steps: Annotated[int, Field(ge=2, le=1000)] | None = f.optional("Number of speeds in the range.")
    weight: f.Positive = 1.0


class FrictionTable(Table):
    """Friction mean effective pressure, measured in a CSV file or given, with its uncertainty."""

    closed: ClassVar[str] = "describes a measurement, not the engine"

    file: str | None = f.optional("CSV file: speed, load and fuel for kind fuel; speed and drag for kind motoring.")
    kind: Literal["fuel", "motoring"] = "fuel"
    speed_unit: str = "rpm"
    load_unit: str = f.optional("Unit of the load in the file: of a torque, or of a mean pressure.", "N m")
    fmep: f.PositiveMeanPressure | None = f.optional("Friction mean effective pressure, in place of a file.")
    deviation: f.NonNegativeMeanPressure | None = f.optional("Standard deviation of fmep.")
    deviations: f.NonNegative = f.optional(
        "Number of standard deviations to either side for which the load is computed.", 2.0
    )


class Brake:
    """Conversion of loads at the brake into indicated mean pressures by [friction], for a displacement [m3].

    Each converted load adds a sentence to `said`, and the measurements behind it to `tests`, both for the report.
    """

    def __init__(self, table: FrictionTable, folder: Path, displacement: float, cycle: Cycle) -> None:
        self.table, self.displacement, self.turns = table, displacement, cycle.turns
        require_one_of(table, "friction", "file", "fmep")
        if table.file is not None and table.deviation is not None:
            raise Refused("friction.deviation", None, "follows from the file", "leave it out")
        self.said: list[str] = []
        self.tests: list[FrictionTest] = []
        self._rows = [] if table.file is None else self._read(table.file, folder)

    def _read(self, file: str, folder: Path) -> list[tuple[float, ...]]:
        """Return the rows of a friction measurement: speed [rad/s], mean pressure [Pa] and, for kind fuel, fuel."""
        names = ("speed", "load", "fuel")[: 3 if self.table.kind == "fuel" else 2]
        speed = si_value(f"1 {self.table.speed_unit}", "rad/s", "friction.speed_unit", self.table.speed_unit)
        text, unit = f"1 {self.table.load_unit}", self.table.load_unit
        if units.dimension_of(text) == "Pa":
            load = si_value(text, "Pa", "friction.load_unit", unit)
        else:
            load = self.pressure(si_value(text, "N m", "friction.load_unit", unit))
        rows = rows_of(file, folder / file, "friction.file", names)
        for k, row in enumerate(rows, 1):
            if not all(map(math.isfinite, row)):
                raise Refused("friction.file", file, f"has a number in row {k} that is not finite", "leave it out")
        return [(n * speed, p * load, *remaining) for n, p, *remaining in rows]

    def pressure(self, torque: float) -> float:
        """Return the mean pressure of a torque at the brake [Pa] (W1)."""
        return mean_pressure(torque, self.displacement, self.turns)

    def indicated(self, brake: float, speed: float, where: str) -> tuple[float, float, float]:
        """Return lowest, middle and highest indicated mean pressure for a brake mean pressure at a speed [Pa] (W4)."""
        friction = self.friction(speed, where)
        pressures = friction.indicated(brake, self.table.deviations)
        if pressures[0] <= brake:
            rule = f"is less than its uncertainty, {units.quantity_text(friction.deviation, 'Pa')} times deviations"
            remedy = "measure more points, or lower friction.deviations"
            raise Refused("friction", units.quantity_text(friction.mean, "Pa"), rule, remedy)
        numbers = (*pressures, friction.mean, friction.deviation)
        lowest, middle, maximum, loss, deviation = (f"{1e-5 * p:.4g}" for p in numbers)
        self.said.append(
            f"Indicated mean pressure at {where} {middle} bar, {lowest} to {maximum} bar: {1e-5 * brake:.4g} bar at "
            f"the brake and {loss} bar of friction, {self.table.deviations:g} deviations of {deviation} bar to either "
            "side."
        )
        if self._rows:
            is_motored = self.table.kind == "motoring"
            x, y = zip(*(row[:2] if is_motored else row[1:] for row in self._readings(speed)), strict=True)
            load = speed if is_motored else brake
            self.tests.append(FrictionTest(where, is_motored, x, y, load, friction, self.table.deviations))
        return pressures

    def _readings(self, speed: float) -> list[tuple[float, ...]]:
        if self.table.kind == "motoring":
            return self._rows
        return [row for row in self._rows if math.isclose(row[0], speed, rel_tol=SAME_SPEED)]

    def friction(self, speed: float, where: str) -> Friction:
        """Return the friction of the operating point named `where`, at its speed (W2, W3)."""
        if self.table.fmep is not None:
            return Friction(self.table.fmep, self.table.deviation or 0.0)
        readings = self._readings(speed)
        with errors_at_key("friction.file", self.table.file or ""):
            if self.table.kind == "motoring":
                return motoring_friction([row[0] for row in readings], [row[1] for row in readings], speed)
            if len(readings) < FEWEST:
                speed_text = units.quantity_text(speed, "rad/s")
                rule = f"has {len(readings)} rows at {speed_text}, the speed of {where}, and a fit needs {FEWEST}"
                raise Refused("friction.file", self.table.file, rule, "measure more loads at this speed")
            return willans_friction([row[1] for row in readings], [row[2] for row in readings])


def with_load(table: GasTable | None, points: Sequence[OperatingPointTable]) -> GasTable | None:
    """Return the gas with a mean pressure; one that is not given is never used, because all points have a load."""
    if not isinstance(table, ChargeTable) or table.imep is not None:
        return table
    without = [k for k, p in enumerate(points, 1)
               if p.gas and not p.motored and p.imep is None and p.bmep is None and p.brake_torque is None]  # fmt: skip
    if without:
        remedy = f"add it, or give operating_points[{without[0]}] imep, bmep or brake_torque"
        raise Refused("gas.imep", None, "is missing", remedy)
    if any(row.imep is not None for row in table.single_cylinders):
        remedy = "add it: cylinders keep their ratio to it"
        raise Refused("gas.imep", None, "is missing beside an imep of single cylinders", remedy)
    return table.model_copy(update={"imep": AMBIENT_PRESSURE})


def operating_points(
    tables: Sequence[OperatingPointTable], gas_at: Callable[[OperatingPointTable, str], GasModel | None], cycle: Cycle,
    stroke: float | None, brake: Brake | None, parts: Sequence[SliderCrank],
) -> tuple[OperatingPoint, ...]:  # fmt: skip
    """Return the operating points of a file.

    `gas_at` returns the gas of a point before its load, and names the key of the point in complaints. The stroke [m]
    turns a mean piston speed into a crank speed; it is None for an engine without pistons. `parts` are the
    slider-cranks in the order of cylinder numbers.
    """
    points = []
    for k, table in enumerate(tables, 1):
        where = f"operating_points[{k}]"
        _check_combustion(table, where)
        speeds = _speeds(table, stroke, where)
        states = cylinder_states(table, parts, where, table.name is not None)
        base = gas_at(table, where)
        is_measured = base is not None and any(model.is_measured for model in base.models)
        record = partial(_recorded_friction, table, base, cycle, parts, where) if base and is_measured else None
        for speed in speeds:
            speed_text = units.quantity_text(speed, "rad/s", 6)
            name = (f"{table.name} {speed_text}" if len(speeds) > 1 else table.name) if table.name else speed_text
            loads = _loads(table, speed, brake, where, name, record)
            for suffix, imep, fmep in loads:
                load = _loaded(base, table.model_copy(update={"imep": imep}), cycle, where)
                share = table.weight / len(speeds) / len(loads) / len(states)
                points += [
                    OperatingPoint(f"{name}{suffix}{state.suffix}", speed, state.gas(load, cycle, where), share, fmep)
                    for state in states
                ]
    if len(points) > MAX_POINTS:
        rule = f"makes {len(points)} operating points, more than {MAX_POINTS}"
        raise Refused("operating_points", None, rule, "use fewer steps, or sweep the speed in a study")
    require_distinct([p.name for p in points], "operating_points", "operating points have one name")
    return tuple(points)


def _check_combustion(table: OperatingPointTable, where: str) -> None:
    """Raise `Refused` for single cylinders without combustion at a point whose other keys contradict them."""
    for key in ("misfire", "cut"):
        if getattr(table, key) is None:
            continue
        if table.motored or not table.gas:
            rule = "is given for a point that has no combustion in any cylinder"
            raise Refused(f"{where}.{key}", None, rule, "remove this key, or motored and gas")
        if table.bmep is not None or table.brake_torque is not None:
            rule = "is given beside a load at the brake, which is that of an engine whose cylinders all fire"
            raise Refused(f"{where}.{key}", None, rule, "give imep, the mean pressure of the cylinders that fire")


def _speeds(table: OperatingPointTable, stroke: float | None, where: str) -> tuple[float, ...]:
    """Return the speeds of a table [rad/s]: one, or equal steps over a range."""
    require_one_of(table, where, "speed", "mean_piston_speed")
    if table.speed is None and stroke is None:
        rule = "is a mean piston speed, and this engine has no pistons"
        raise Refused(f"{where}.mean_piston_speed", None, rule, "give the speed")
    # c_m = 2 s n (Roetscher eq. 290)
    first = math.pi * (table.mean_piston_speed or 0.0) / (stroke or 1.0) if table.speed is None else table.speed
    if table.up_to is None and table.steps is None:
        return (first,)
    if table.up_to is None or table.steps is None:
        missing = "up_to" if table.up_to is None else "steps"
        raise Refused(
            f"{where}.{missing}", None, "is missing", "give both up_to and steps for a range of speeds, or neither"
        )
    if table.up_to <= first:
        value = units.quantity_text(table.up_to, "rad/s")
        raise Refused(f"{where}.up_to", value, "is not above the first speed of the range", "give a higher one")
    return tuple(first + (table.up_to - first) * k / (table.steps - 1) for k in range(table.steps))


def _loads(
    table: OperatingPointTable, speed: float, brake: Brake | None, where: str, name: str,
    record: Callable[[str], float] | None,
) -> list[tuple[str, float | None, float]]:  # fmt: skip
    """Return the loads of an operating point: name suffix, indicated mean pressure and that of friction [Pa].

    A load at the brake with an uncertain friction gives three: least, mean and most load. Beside a recorded pressure it
    gives the friction, which `record` returns by the key of the load.
    """
    keys = [key for key in ("imep", "bmep", "brake_torque") if getattr(table, key) is not None]
    if len(keys) > 1 or (table.motored and keys[1:]):
        raise Refused(f"{where}.{keys[0]}", None, f"is given beside {keys[1]}", "keep one")
    if table.bmep is None and table.brake_torque is None:
        fmep = brake.friction(speed, name).mean if brake is not None and table.gas else 0.0
        return [("", table.imep, fmep)]
    if record is not None and table.gas and not table.motored:
        return [("", None, record(keys[0]))]
    if brake is None:
        remedy = "add [friction], which gives the loss between gas and brake"
        raise Refused(f"{where}.{keys[0]}", None, "needs [friction]", remedy)
    if table.motored or not table.gas:
        raise Refused(
            f"{where}.{keys[0]}", None, "needs combustion at this operating point", "remove this load, or motored"
        )
    bmep = table.bmep if table.bmep is not None else brake.pressure(table.brake_torque or 0.0)
    lowest, middle, largest = brake.indicated(bmep, speed, name)
    if lowest == largest:
        return [("", middle, middle - bmep)]
    loads = ((", least load", lowest), (", mean load", middle), (", most load", largest))
    return [(suffix, imep, imep - bmep) for suffix, imep in loads]


def _recorded_friction(
    table: OperatingPointTable, gas: GasModel, cycle: Cycle, parts: Sequence[SliderCrank], where: str, key: str
) -> float:
    """Return the mean pressure of friction [Pa]: that of the recorded pressure less that at the brake (L5b)."""
    torque = sum(float(gas_coefficients(gas, part, cycle).coefficients[0].real) for part in parts)
    volume = displacement(parts)
    imep, load = mean_pressure(torque, volume, cycle.turns), getattr(table, key)
    friction = imep - (load if key == "bmep" else mean_pressure(load, volume, cycle.turns))
    if friction < 0.0:
        rule = f"is more than the gas gives, whose recorded imep is {units.quantity_text(1e-5 * imep, 'bar')}"
        raise Refused(f"{where}.{key}", None, rule, "check angle_zero of [gas], and the load")
    return float(friction)


def _loaded(gas: GasModel | None, table: OperatingPointTable, cycle: Cycle, where: str) -> GasModel | None:
    keys = ("imep", "peak_pressure", "intake_pressure")
    pressures = {key: value for key in keys if (value := getattr(table, key)) is not None}
    for key in ("imep", "peak_pressure"):
        if table.motored and key in pressures:
            rule = "is given for a motored point, which has no combustion"
            raise Refused(f"{where}.{key}", None, rule, f"remove {key} or motored")
    if not table.gas:
        return None
    if not table.motored and not pressures:
        return gas

    def loaded(model: GasModel, common: GasModel) -> GasModel:
        # chambers beside gas that fires keep their pressures, and single cylinders their ratio to the common gas
        if not model.fires and model is not gas:
            return model
        other, numbers = [key for key in pressures if key not in model.loads], dict[str, float]()
        if other and model.loads:
            raise Refused(f"{where}.{other[0]}", None, "means nothing with this model of [gas]", "leave it out")
        for key, value in pressures.items():
            of_common, single = getattr(common, key, None), getattr(model, key, None)
            numbers[key] = value * single / of_common if model is not common and of_common and single else value
        result = None if other else model.loaded(numbers)
        result = result.motored(cycle) if result and table.motored else result
        if result is None:
            raise without_numbers
        return result

    rule, remedy = "needs [gas] with model seiliger or wiebe", "give [gas] such a model, or remove this key"
    without_numbers = Refused(f"{where}.{'motored' if table.motored else next(iter(pressures))}", None, rule, remedy)
    if gas is None:
        raise without_numbers
    return gas.mapped(lambda model: loaded(model, gas.models[0]))
