"""Quantities over the crank angle as test benches record them: columns, units, cycles, zeros, noise."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import PlainValidator, WithJsonSchema

from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, si_value
from laufruhe.files.csv_rows import table_of
from laufruhe.files.fields import Table
from laufruhe.files.number_tables import NumberTable, Unit, unit_in
from laufruhe.machine import Cycle
from laufruhe.numerics.arrays import Array
from laufruhe.physics.measured_cycle import smooth_cycle
from laufruhe.units import quantity_text

_ANGLE_NAME = re.compile(r"angle|winkel|^(?:ca|kw|cad|theta|phi|alpha|gamma)\b", re.IGNORECASE)
_OTHER_NAME = re.compile(
    r"(?:^|[\W_])(?:min(?:imum)?|max(?:imum)?|median|std(?:dev)?|stdev|stabw|standardabw\w*|standard deviation|sigma|"
    r"cov|motored|drag|geschleppt)(?:[\W_]|$)",
    re.IGNORECASE,
)
"""Heading of a column that is no cycle with combustion: computed from several cycles, or motored."""
ALIKE = 0.9
"""Least correlation of columns that are cycles of one cylinder."""
_UNLIKE, _MANY = 0.7, 0.2
"""Correlation with the mean below which a cycle is unlike the others, and the largest share of such cycles."""
_LARGER = 3.0
"""Range of a column over that of the first pressure from which the first may be no cylinder pressure."""
_FEWEST, _LISTED = 4, 3
_ROUNDING = 1e-9
"""Noise over the range of the pressure up to which it is that of the arithmetic."""
_SAME_ANGLE = 1e-9
"""Difference of angles [rad] that is rounding of many turns."""
_SCATTER = 0.25
"""Standard deviation over the mean of the peaks from which columns may be no cycles of one cylinder."""
_WHOLE = 0.95
"""Least share of the points of the longest cycle that a cycle has."""


def _column(raw: Any) -> str | int:
    if isinstance(raw, bool) or not isinstance(raw, str | int):
        raise f.refusal('is neither name nor number of a column; write for example "PCYL1" or 2')
    return raw


def _cycles_of_key(raw: Any) -> str | int:
    if raw in ("mean", "worst") or (isinstance(raw, int) and not isinstance(raw, bool) and raw > 0):
        return raw  # type: ignore[no-any-return]
    raise f.refusal('is no choice of cycles; write "mean", "worst" or a number counted from 1')


Column: TypeAlias = Annotated[
    str | int,
    PlainValidator(_column),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 1}]}),
]
CyclesChoice: TypeAlias = Annotated[
    str | int,
    PlainValidator(_cycles_of_key),
    WithJsonSchema({"anyOf": [{"enum": ["mean", "worst"]}, {"type": "integer", "minimum": 1}]}),
]


@dataclass(frozen=True)
class Quantity:
    """Quantity that a file records over the crank angle.

    Attributes
    ----------
    name, si
        Name, which begins its keys, and SI unit.
    unit, factor
        Unit of a file that names none, and of sentences, and its number in one SI unit.
    what
        Name of its column in a complaint.
    cylinder_heading
        Pattern of the heading of one cylinder's column; None if the quantity is not that of a cylinder.
    """

    name: str
    si: str
    unit: str
    factor: float
    what: str
    cylinder_heading: re.Pattern[str] | None = None

    def text(self, value: float, digits: int = 4) -> str:
        """Return a value [SI] with its unit."""
        return quantity_text(self.factor * value, self.unit, digits)


class OverAngleTable(Table):
    """A quantity over the crank angle, as test benches and simulations write it: a text, .xlsx or .mat file."""

    records: ClassVar[Quantity]

    file: str = f.required("Text file, .xlsx or .mat file beside the problem: crank angle, and values over it.")
    sheet: str | None = f.optional("Sheet of a spreadsheet; by default that with the most rows of numbers.")
    angle_column: Column | None = f.optional("Name or number of the column of crank angles, if it is not evident.")
    angle_unit: str | None = f.optional("Unit of the angles, if it is not in the file; deg by default.")
    cycles: CyclesChoice = f.optional(
        "Of several cycles: their mean, the one with the highest peak, or that with this number.", "mean"
    )
    smooth: bool = f.optional("false keeps the noise of the measurement.", True)


class RecordedFile:
    """Columns of a recorded file, and sentences about how they are read."""

    def __init__(self, table: OverAngleTable, folder: Path, where: str) -> None:
        self.table, self.where, self.said, self.records = table, where, list[str](), table.records
        self.numbers: NumberTable = table_of(table.file, folder / table.file, f"{where}.file", table.sheet)
        self.values = np.where(np.abs(self.numbers.values) < f.LARGEST, self.numbers.values, np.nan)
        if self.values.shape[1] < 2:
            raise self.refused(f"has no columns of crank angle and {self.records.name}", "give a file with both")
        if len(self.values) < _FEWEST:
            raise self.refused(f"has {counted(len(self.values), 'row')}, too few for a cycle", "give one every degree")
        self.angle_column = self._angle_column()
        self._require_unit(self.angle_column, "rad", "angle")
        self.columns = self._columns()
        self._require_unit(self.columns[0], self.records.si, self.records.name)
        names = [self.name(column) for column in self.columns]
        listed = f"{names[0]} to {names[-1]}" if len(names) > _LISTED else ", ".join(names)
        listed += " as cycles of one cylinder" if len(names) > 1 else ""
        self.said.insert(0, f"Crank angle from {self.name(self.angle_column)}, {self.records.name} from {listed}.")

    def refused(self, rule: str, remedy: str, key: str = "file") -> Refused:
        """Return a refusal of the file, or of a key about it."""
        value = getattr(self.table, key)
        return Refused(f"{self.where}.{key}", None if isinstance(value, bool) else value, rule, remedy)

    def name(self, column: int) -> str:
        """Return the heading of a column, or its number."""
        return f"'{self.numbers.names[column]}'" if self.numbers.names[column] else f"column {column + 1}"

    def _column(self, word: str | int, key: str) -> int:
        names, where = self.numbers.names, f"{self.where}.{key}"
        if isinstance(word, int):
            if not 1 <= word <= len(names):
                raise Refused(where, word, f"is not among {counted(len(names), 'column')}", "count them from 1")
            return word - 1
        plain = [name.strip().lower() for name in names]
        if word.strip().lower() not in plain:
            named = [name for name in names if name]
            remedy = nearest(word, named) if named else f"give its number, 1 to {len(names)}"
            raise Refused(where, word, "is no heading of the file", remedy)
        return plain.index(word.strip().lower())

    def _require_unit(self, column: int, dimension: str, thing: str) -> None:
        unit, key = self.numbers.units[column], f"{thing}_column"
        if unit and unit.dimension != dimension and not getattr(self.table, f"{thing}_unit"):
            rule = f"takes the {thing} from {self.name(column)}, whose unit is {unit.name}"
            key_or_file = "file" if getattr(self.table, key) is None else key
            raise self.refused(rule, f"name another column by {key}", key_or_file)

    def _angle_column(self) -> int:
        if self.table.angle_column is not None:
            return self._column(self.table.angle_column, "angle_column")
        values, units = self.values, self.numbers.units
        of_unit = [k for k, unit in enumerate(units) if unit and unit.dimension == "rad"]
        of_name = [k for k, name in enumerate(self.numbers.names) if _ANGLE_NAME.search(name)]
        if of_unit or of_name:
            return (of_unit or of_name)[0]
        turning = [k for k in range(len(units)) if _rises(values[:, k]) and _turns(values[:, k])]
        # each channel may have a column of the same angles
        if any(not np.array_equal(values[:, k], values[:, turning[0]]) for k in turning):
            names = ", ".join(map(self.name, turning))
            raise self.refused(f"may have its crank angles in {names}", "name one by angle_column")
        rising = [k for k in range(len(units)) if _rises(values[:, k])]
        if not turning and rising:
            first, last = _finite(values[:, rising[0]])[[0, -1]]
            rule = f"has no crank angles: {self.name(rising[0])} runs from {first:.6g} to {last:.6g}, as a time does"
            needs = "which needs the dead centre and the gain of the sensor"
            remedy = f"convert it to crank angle and {self.records.name}, {needs}"
            raise self.refused(rule, remedy)
        return turning[0] if turning else 0

    def _columns(self) -> list[int]:
        key = f"{self.records.name}_column"
        words = getattr(self.table, key)
        if words is not None:
            columns = [self._column(word, key) for word in words]
            if not columns:
                raise self.refused("names no column", "name one", key)
            if len(set(columns)) < len(columns):
                raise self.refused("names a column twice", "name it once", key)
            return columns
        values, units = self.values, self.numbers.units
        others = [k for k in range(len(units)) if k != self.angle_column]
        columns = [k for k in others if (unit := units[k]) and unit.dimension == self.records.si]
        columns = columns or [k for k in others if units[k] is None]
        columns = [k for k in columns if not _OTHER_NAME.search(self.numbers.names[k])] or columns
        if not columns:
            rule = f"has no {self.records.name}s: {self.name(others[0])} has another unit"
            raise self.refused(rule, f"convert it to a {self.records.name}, which needs the gain of the sensor")
        ranges = {k: float(np.ptp(_finite(values[:, k]))) for k in columns}
        first = columns[0]
        if max(ranges.values()) > _LARGER * ranges[first]:
            names = ", ".join(map(self.name, columns))
            raise self.refused(f"may have the {self.records.what} in {names}", f"name one by {key}")
        alike = [k for k in columns if k == first or correlation(values[:, first], values[:, k]) > ALIKE]
        heading = self.records.cylinder_heading
        cylinders = [k for k in columns if heading and heading.search(self.numbers.names[k])]
        if len(set(alike) & set(cylinders)) > 1:
            names = ", ".join(map(self.name, cylinders))
            rule, remedy = (
                f"may have one cylinder in each of {names}",
                "write cylinder_columns = [...] with their names",
            )
            raise self.refused(rule, f"{remedy}, or pressure_column = [...] if they are cycles of one cylinder")
        unused = [self.name(k) for k in others if k not in alike]
        of_cylinders = "; cylinder_columns gives each cylinder its own" if len(cylinders) > 1 else ""
        self.said += [f"Columns that are not used: {', '.join(unused)}{of_cylinders}."] if unused else []
        return alike

    def angles(self) -> Array:
        """Return the angles of all rows [rad]."""
        values, unit = self.values[:, self.angle_column], self.numbers.units[self.angle_column]
        name = self.table.angle_unit or (unit.name if unit else "")
        if not name:
            name = "rad" if _turns(values) == math.tau else "deg"
            self.said.append(f"Angles are taken as {name}, because the file names no unit.")
        return self._used(self.angle_column) * si_value(f"1 {name}", "rad", f"{self.where}.angle_unit", name)

    def read(self) -> tuple[Array, Unit | None]:
        """Return the values of all rows and columns [SI], and the unit of their column if it has one."""
        of_file, key = self.numbers.units[self.columns[0]], f"{self.records.name}_unit"
        name, things = getattr(self.table, key), f"{self.records.name.capitalize()}s"
        of_key = unit_in(name) if name else None
        if name and of_file and of_key != of_file:
            self.said.append(f"{things} are taken as {name}, as the problem says; the file says {of_file.name}.")
        if not name and not of_file:
            self.said.append(f"{things} are taken as {self.records.unit}, because the file names no unit.")
        unit = of_key or (None if name else of_file)
        text = unit.name if unit else name or self.records.unit
        factor = si_value(f"1 {text}", self.records.si, f"{self.where}.{key}", name or text)
        return np.stack([self._used(column) for column in self.columns], axis=1) * factor, unit

    def _used(self, column: int) -> Array:
        missing = np.flatnonzero(np.isnan(self.values[:, column]))
        if len(missing):
            rule = f"line {self.numbers.lines[missing[0]]} has no number in {self.name(column)}"
            raise self.refused(rule, "correct or remove it")
        return self.values[:, column]


def smooth_values(
    file: RecordedFile, angles: Array, values: Array, cycle: Cycle, pace: float
) -> tuple[Array, Array]:  # fmt: skip
    """Return angles [rad] and values [SI] of one cycle over `pace`, without noise, from all rows and columns."""
    angles, all_cycles = _cycles(file, angles, values, cycle.angle / pace)
    chosen, table = _chosen(file, all_cycles), file.table
    with errors_at_key(f"{file.where}.file", table.file):
        smooth = smooth_cycle(angles, chosen, cycle, pace)
    treatment = "kept"
    if smooth.cut_off is not None and table.smooth:
        angles, chosen = smooth.angles, smooth.pressures
        treatment = f"removed by a low-pass that halves order {smooth.cut_off:.3g} of crank speed"
    if smooth.noise > _ROUNDING * np.ptp(chosen):
        file.said.append(f"Noise: {file.records.text(smooth.noise, 2)} rms, {treatment}.")
    return angles, chosen


def _finite(values: Array) -> Array:
    return np.asarray(values[np.isfinite(values)]) if np.isfinite(values).any() else np.zeros(2)


def _rises(values: Array) -> bool:
    # true if values rise or fall steadily, with some restarts
    steps = np.diff(_finite(values))
    sign = np.sign(np.median(steps)) if len(steps) else 0.0
    return bool(sign != 0.0 and np.mean(np.sign(steps) == sign) > 0.95)


def _turns(values: Array) -> float:
    # length of a turn of the crank in values that may be angles, 360 or 2 pi; zero if they are none
    steps = np.diff(_finite(values))
    step = abs(float(np.median(steps))) if len(steps) else 0.0
    extent = float(np.ptp(_finite(values))) + step
    if extent > 300.0:
        return 360.0
    turns = extent / math.tau
    return math.tau if turns > 0.9 and abs(turns - round(turns)) * math.tau < 1.5 * step else 0.0


def correlation(first: Array, other: Array) -> float:
    """Return the correlation of two columns."""
    deviations = [np.nan_to_num(column - np.nanmean(column)) for column in (first, other)]
    lengths = math.prod(float(np.linalg.norm(deviation)) for deviation in deviations)
    return float(deviations[0] @ deviations[1]) / lengths if lengths > 0.0 else 0.0


def _cycles(file: RecordedFile, angles: Array, pressures: Array, period: float) -> tuple[Array, Array]:
    """Return the angles of one cycle, shape (n,), and the pressures of every cycle, shape (cycles, n).

    Cycles stand one under another, each with its angles, or with angles that rise on; columns are cycles too.
    """
    if np.median(np.diff(angles)) < 0.0:
        angles, pressures = angles[::-1], pressures[::-1]
    # where angles begin anew, whole turns make them rise on
    drops = np.concatenate([[0.0], np.maximum(-np.diff(angles), 0.0)])
    turns = np.where(drops > math.pi, np.ceil(drops / math.tau - 1e-6), 0.0)
    # a cycle that gives both ends begins where the one before ends, but for rounding
    angles = angles + math.tau * np.cumsum(turns)
    back = np.flatnonzero(np.diff(angles) < -_SAME_ANGLE)
    if len(back):
        late, early = (f"{math.degrees(angles[back[0] + side]):.6g} deg" for side in (1, 0))
        raise file.refused(f"has {late} after {early}", "sort its rows by angle")
    angles = np.maximum.accumulate(angles)
    step = float(np.median(np.diff(angles)))
    new = np.concatenate([[True], (np.diff(angles) > 1e-3 * step) | np.any(np.diff(pressures, axis=0) != 0.0, axis=1)])
    angles, pressures = angles[new], pressures[new]
    if len(angles) < _FEWEST:
        raise file.refused(f"has {counted(len(angles), 'angle')}, too few for a cycle", "give one every degree")
    if angles[-1] - angles[0] <= period + 1e-3 * step:
        return angles, pressures.T
    index = np.floor((angles - angles[0]) / period + 1e-6).astype(int)
    counts = np.bincount(index)
    whole = np.flatnonzero(counts >= _WHOLE * counts.max())
    # the last point of the file may be the end of a whole cycle
    partial = np.count_nonzero((counts > 1) & (counts < _WHOLE * counts.max()))
    file.said += [f"Cycles that are not whole and not used: {partial}."] if partial else []
    grid, cycles = np.zeros(0), list[Array]()
    for k in whole:
        local, values = angles[index == k] - k * period, pressures[index == k]
        # the end of a cycle may repeat the beginning of the next
        new = np.concatenate([[True], np.diff(local) > 1e-3 * step])
        local, values, grid = local[new], values[new], grid if len(grid) else local[new]
        is_same = len(local) == len(grid) and np.abs(local - grid).max() < 1e-3 * step
        cycles += [column if is_same else np.interp(grid, local, column, period=period) for column in values.T]
    return grid, np.array(cycles)


def _chosen(file: RecordedFile, cycles: Array) -> Array:
    """Return the mean, the worst or the named cycle."""
    choice, count, peaks = file.table.cycles, len(cycles), cycles.max(axis=1)
    if count == 1:
        if choice not in ("mean", "worst", 1):
            raise file.refused("is not in the file, which has one cycle", "leave it out", "cycles")
        return np.asarray(cycles[0])
    mean = np.asarray(cycles.mean(axis=0))
    unlike = sum(correlation(mean, cycle) < _UNLIKE for cycle in cycles)
    if unlike > _MANY * count:
        rule = f"has {counted(count, 'cycle')} that differ, and {unlike} of them are unlike their mean"
        raise file.refused(rule, f"check engine.cycle, or name one by {file.records.name}_column or cycles")
    spread, text = file.records.text(peaks.std(ddof=1), 3), file.records.text(peaks.mean())
    which = f"Of {count} cycles, with peaks of {text} and a standard deviation of {spread}"
    if peaks.std(ddof=1) > _SCATTER * peaks.mean():
        which += " (more than usual; are all of one cylinder and one load?)"
    if choice == "mean":
        file.said.append(f"{which}, the mean is used.")
        return mean
    if isinstance(choice, int) and not 1 <= choice <= count:
        raise file.refused(f"is not among {counted(count, 'cycle')}", "count them from 1", "cycles")
    k = int(peaks.argmax()) if choice == "worst" else int(choice) - 1
    file.said.append(f"{which}, number {k + 1} is used.")
    return np.asarray(cycles[k])
