"""Recorded pressures of [gas] with model trace: files of test benches, the trace of each cylinder, doubts about it."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field

from laufruhe.errors import Complaint, counted
from laufruhe.extensions.recorded_pressure.gas import PressureTrace, bottom_pressure, peak_angle
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, si_value
from laufruhe.files.fields import Table
from laufruhe.files.gas import GasContext, GasTable, SingleGasTable, names_of_cylinders
from laufruhe.files.recorded_file import (
    ALIKE,
    Column,
    OverAngleTable,
    Quantity,
    RecordedFile,
    correlation,
    smooth_values,
)  # fmt: skip
from laufruhe.machine import Cycle, GasModel
from laufruhe.machine.gas.base import chamber_cycle_of
from laufruhe.numerics.arrays import Array
from laufruhe.physics.gas_facts import cylinder_facts, gas_facts
from laufruhe.problem.advice import Advice
from laufruhe.problem.problem import Problem
from laufruhe.units import quantity_text

_GAUGE_NAME = re.compile(r"gauge|überdruck|ueberdruck", re.IGNORECASE)
NEAR_FIRING = math.radians(60.0)
"""Largest angle between the peak pressure and its dead centre at which the peak tells which dead centre it is."""
_PEG_WIDTH = math.radians(5.0)
"""Angle to either side over which the pressure is averaged to be pegged."""
MAX_INTAKE, LEAST_RISE = 2e5, 25.0
"""Largest pressure before compression that raises no doubt [Pa], and least ratio of the peak to a larger one."""
_EXCHANGE = "gas exchange"


class PegTable(Table):
    """Known pressure at an angle, to which a floating pressure is moved."""

    at: f.Angle = f.required("Crank angle after the firing dead centre; the mean of 5 degrees to either side counts.")
    to: f.PositivePressure = f.required(
        "Absolute pressure there, such as that in the intake at its bottom dead centre."
    )


PRESSURE = Quantity(
    "pressure", "Pa", "bar", 1e-5, "pressure of the cylinder",
    re.compile(r"^(?:p|p?[ _]?(?:cyl|zyl)[a-z]*[ ._-]*)\d+\s*(?:[\[(/].*)?$", re.IGNORECASE),
)  # fmt: skip


class RecordedTable(OverAngleTable):
    """A recorded trace of pressure."""

    records = PRESSURE

    pressure_column: Annotated[list[Column], f.ListOrSingle(Column)] | None = f.optional(
        "Name or number of the column of pressures, or several that are cycles of the cylinder."
    )
    pressure_unit: str | None = f.optional("Unit of the pressures, if it is not in the file; bar by default.")
    gauge: bool | None = f.optional("true: pressures count from crankcase_pressure. By default they are absolute.")
    peg: PegTable | None = f.optional("Moves a floating pressure to a known one, at one angle.")

    def of_chamber(self, folder: Path, where: str, air: float) -> PressureTrace:
        """Return the trace of a chamber that works once a turn; `air` is the pressure around [Pa]."""
        return recorded_trace(self, folder, where, Cycle.TWO_STROKE, 1.0, air, 0.0)


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


RecordedFileTable: TypeAlias = Annotated[
    RecordedGasTable,
    BeforeValidator(
        lambda raw: {"file": raw} if isinstance(raw, str) else raw, json_schema_input_type=str | RecordedGasTable
    ),
]
"""Recorded pressures by the name of their file, or with keys of their own."""


class TraceTable(RecordedGasTable, GasTable):
    """A recorded cylinder pressure."""

    at_points: ClassVar = {"pressure_file": (RecordedFileTable | None, f.optional(
        "File of the pressure recorded at this point, read as that of [gas] with model trace; or a table with the file "
        "and with keys in place of those of [gas], such as angle_zero."
    ))}  # fmt: skip

    model: Literal["trace"]
    single_cylinders: list[SingleGasTable] = Field(default_factory=list)

    def check_open_crank(self) -> None:
        """Raise `Refused` if angles count from the firing of cylinder 1, which an open crank changes."""
        if self.cylinder_angles == "common":
            rule = "counts angles from cylinder 1 in the firing order of the recording, and the crank is open"
            raise Refused("gas.cylinder_angles", "common", rule, "count each column from the firing of its cylinder")

    def read(self, context: GasContext) -> tuple[PressureTrace, Mapping[str, GasModel]]:
        """Return the recorded trace of cylinder 1, and those of the cylinders with columns of their own, by names."""
        parts, cycle, where, air = context.parts, context.cycle, context.where, self.crankcase_pressure
        chamber_cycle, pace = chamber_cycle_of(parts[0], cycle) if parts else (cycle, 1.0)
        zero, columns = _angle_zero(self, chamber_cycle, f"{where}.angle_zero"), self.cylinder_columns
        read = partial(
            recorded_trace, folder=context.folder, where=where, cycle=chamber_cycle, pace=pace, air=air, zero=zero
        )
        motored = None
        if self.motored_column is not None:
            if self.pressure_column is None and columns is None:
                rule = "is given without pressure_column, which has the pressure with combustion"
                raise Refused(f"{where}.motored_column", self.motored_column, rule, "name both columns")
            motored = replace(read(self.model_copy(update={"pressure_column": [self.motored_column]})), is_motored=True)
        if self.single_cylinders:
            rule, remedy = "means nothing with model trace", "name a column of each cylinder by cylinder_columns"
            raise Refused("gas.single_cylinders", None, rule, remedy)
        if columns is None:
            return replace(read(self), without_combustion=motored), {}
        if self.pressure_column is not None:
            raise Refused(f"{where}.pressure_column", None, "is given beside cylinder_columns", "keep one")
        fired = [k for k, part in enumerate(parts) if part.bore != 0.0 and not any(map(part.faces, parts[:k]))]
        if len(columns) != len(fired):
            rule = f"has {counted(len(columns), 'column')} for {counted(len(fired), 'cylinder')} that fire"
            raise Refused(f"{where}.cylinder_columns", None, rule, "name one column for each cylinder, by its number")
        traces, period = dict[str, GasModel](), chamber_cycle.angle / pace
        if zero is None and self.cylinder_angles == "common" and chamber_cycle is Cycle.FOUR_STROKE:
            # one zero for all columns, so that none hides a wrong order of firing
            leading = self.model_copy(update={"pressure_column": [columns[0]]})
            peak, starts = _peak(read(leading, zero="firing"), period), {"firing": 0.0, "gas exchange": 0.5 * period}
            near = (name for name, start in starts.items() if abs(math.remainder(peak + start, period)) <= NEAR_FIRING)
            zero = next(near, None)
            read = partial(read, zero=zero)
        first: PressureTrace | None = None
        for k, column in zip(fired, columns, strict=True):
            one = self.model_copy(update={"pressure_column": [column]})
            later = parts[k].firing_angle - parts[fired[0]].firing_angle if self.cylinder_angles == "common" else 0.0
            trace = replace(read(one, later=later), without_combustion=motored)
            if abs(peak := _peak(trace, period)) > NEAR_FIRING:
                other = "own" if self.cylinder_angles == "common" else "common"
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


def _absolute(file: RecordedFile, table: RecordedTable, air: float) -> Array:
    """Return the pressures of all rows and columns [Pa]; `air` is added to those of a gauge."""
    pressures, unit = file.read()
    is_gauge = table.gauge
    if is_gauge is None and table.peg is None:
        heading = file.numbers.names[file.columns[0]]
        is_gauge = bool((unit and unit.is_gauge) or _GAUGE_NAME.search(heading))
    if is_gauge and table.peg is not None:
        raise file.refused("is given beside peg, which finds the zero of the pressure", "keep one", "gauge")
    if is_gauge:
        file.said.append(f"Pressures are those of a gauge, in air of {1e-5 * air:.6g} bar.")
    return pressures + (air if is_gauge else 0.0)


def recorded_trace(
    table: RecordedTable, folder: Path, where: str, cycle: Cycle, pace: float, air: float, zero: str | float | None,
    later: float = 0.0,
) -> PressureTrace:  # fmt: skip
    """Return the trace of a recorded file in the folder of a problem, over one cycle over `pace`, without its noise.

    `air` is the pressure around [Pa]. `zero` is the crank angle after firing at which the file counts zero [rad], or
    the name of this dead centre; None leaves it to the peak of the pressure. The file counts from a cylinder that fires
    `later` [rad] earlier than that of the trace.
    """
    file = RecordedFile(table, folder, where)
    period = cycle.angle / pace
    angles, pressures = smooth_values(file, file.angles(), _absolute(file, table, air), cycle, pace)
    # one turn of a four-stroke has the burn, the other one the gas exchange
    other = np.interp(angles + 0.5 * period, angles, pressures, period=period)
    if cycle is Cycle.FOUR_STROKE and correlation(pressures, other) > ALIKE:
        rule = "has the same pressures in both turns of its four-stroke cycle"
        raise file.refused(rule, "check engine.cycle, or record the gas exchange too")
    exchange = 0.5 * period if cycle is Cycle.FOUR_STROKE else 0.0
    angles = angles - later
    start = _zero(file, angles, pressures, zero, exchange, period)
    angles = angles + start
    if later:
        # the end of a cycle may repeat the beginning
        last = len(angles) - int(angles[-1] - angles[0] > period * (1.0 - 1e-9))
        angles = np.mod(angles[:last] + 0.5 * period, period) - 0.5 * period
        order = np.argsort(angles)
        angles, pressures = angles[order], pressures[:last][order]
    if table.peg is not None:
        since = np.mod(angles - table.peg.at + math.pi, period) - math.pi
        rise = table.peg.to - float(np.mean(pressures[np.abs(since) <= max(_PEG_WIDTH, float(np.abs(since).min()))]))
        pressures = pressures + rise
        at = math.degrees(table.peg.at)
        moved = f"{PRESSURE.text(rise)}, to {PRESSURE.text(table.peg.to)}"
        file.said.append(f"Pressures are moved by {moved} at {at:.6g} deg.")
    if pressures.min() <= 0.0:
        rule = f"has pressures down to {PRESSURE.text(pressures.min())}, which are not absolute"
        raise file.refused(rule, 'write gauge = true, or peg = { at = "-180 deg", to = "1 bar" } with what is known')
    if pace == 1.0:
        bottom = PRESSURE.text(bottom_pressure(angles, pressures, period))
        file.said.append(f"Pressure at the bottom dead centre before compression: {bottom}.")
    with errors_at_key(f"{where}.file", table.file):
        return PressureTrace(tuple(angles.tolist()), tuple(pressures.tolist()), air, tuple(file.said))


def _zero(
    file: RecordedFile, angles: Array, pressures: Array, zero: str | float | None, exchange: float, period: float
) -> float:  # fmt: skip
    """Return the crank angle after firing at which the file counts zero; `exchange` is that of gas exchange [rad]."""
    if isinstance(zero, float):
        return zero
    if zero is not None:
        return exchange if zero == _EXCHANGE else 0.0
    peak = float(angles[int(np.argmax(pressures))])
    opposite = np.abs(np.remainder(angles - peak - exchange + 0.5 * period, period) - 0.5 * period) < NEAR_FIRING
    rise = pressures - pressures.min()
    is_near = abs(math.remainder(peak - exchange, period)) < NEAR_FIRING
    is_exchange = bool(exchange) and is_near and rise.max() > 2.0 * rise[opposite].max(initial=0.0)
    start = exchange if is_exchange else 0.0
    place = math.degrees(math.remainder(peak_angle(angles, pressures) + start, period))
    dead_centre = f"0 deg of the file is taken as the {_EXCHANGE if is_exchange else 'firing'} dead centre"
    file.said.append(f"{dead_centre}; the peak then lies {place:.4g} deg after firing.")
    return start


def _warnings(problem: Problem) -> Iterator[Complaint]:
    engine = problem.engine
    for point in problem.points:
        traces = [gas for gas in point.gas_models if isinstance(gas, PressureTrace)]
        if isinstance(point.gas, PressureTrace):
            yield from _of_charge(point.gas, engine.cycle.angle)
        # also motored traces that no operating point uses, because they show the dead centre of the file
        for trace in dict.fromkeys(trace.motored(engine.cycle) for trace in traces):
            facts = gas_facts(engine, replace(point, gas=trace))
            if facts is not None and (facts.imep > 0.0 or facts.peak_angle > 0.0):
                rule = f"has its peak {quantity_text(facts.peak_angle, 'rad', 2)} after dead centre"
                remedy = "check angle_zero; losses move the peak of a motored cylinder 0.3 to 1 deg before dead centre"
                yield Complaint("motored pressure", "", rule, remedy)


def _of_charge(trace: PressureTrace, period: float) -> Iterator[Complaint]:
    angles, pressures = np.array(trace.angles), np.array(trace.pressures)
    bottom, largest = bottom_pressure(angles, pressures, period), max(trace.pressures)
    is_charged = bottom > MAX_INTAKE and largest < LEAST_RISE * bottom
    if is_charged and not trace.is_motored and abs(math.remainder(peak_angle(angles, pressures), period)) < NEAR_FIRING:
        value, peak = (quantity_text(1e-5 * pressure, "bar") for pressure in (bottom, largest))
        rule = f"is more than usual before compression to a peak of {peak}"
        yield Complaint("pressure at the bottom dead centre", value, rule, "check peg and gauge")


def _sentences(problem: Problem) -> Iterator[str]:
    speeds = defaultdict[GasModel, set[float]](set)
    for point in problem.points:
        for _, facts in cylinder_facts(problem.engine, point, problem.fidelity):
            yield from facts.recording
        gas = problem.fidelity.gas_of(point)
        if gas and any(model.is_measured for model in gas.models):
            speeds[gas].add(point.speed)
    for several in speeds.values():
        if len(several) > 1:
            yield f"One record counts at {len(several)} speeds; pressure_file of an operating point gives another."


ADVICE = Advice("recorded pressure", about_problem=_warnings, about_gas=_sentences)
