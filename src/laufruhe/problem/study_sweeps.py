"""What is swept: the values as a problem file has them, and as numbers with a unit for axes and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe import units
from laufruhe.problem.complaints import Refused
from laufruhe.problem.study_parts import SweepTable, Value
from laufruhe.problem.study_paths import field_at

MOST_POINTS = 100_000
_DIGITS = 12


@dataclass(frozen=True)
class Axis:
    """One swept quantity.

    Attributes
    ----------
    quantity
        Path in the problem file.
    values
        As they are put into the problem file.
    unit
        As the study file writes it; "1" of plain numbers, "" of labels.
    numbers
        Values in that unit; None where they are labels.
    """

    quantity: str
    values: tuple[Value, ...]
    unit: str
    numbers: tuple[float, ...] | None

    @property
    def name(self) -> str:
        """The last word of the path, as a reader says it."""
        return self.quantity.split(".")[-1].replace("_", " ")

    def by_value(self) -> dict[Value, float]:
        """Numbers of the values; none where these are labels."""
        return dict(zip(self.values, self.numbers, strict=True)) if self.numbers is not None else {}


def axis_of(sweep: SweepTable) -> Axis:
    """The values of a sweep and their unit.

    Raises
    ------
    Refused
        If it is empty, holds one value or one twice, or mixes what does not fit.
    """
    spaced = (sweep.first, sweep.last, sweep.points)
    if sweep.values is None:
        values, given = _spaced(sweep), "points"
    elif any(value is not None for value in (*spaced, sweep.spacing)):
        raise Refused("values", None, "are given beside from, to, points or spacing", "give one or the other")
    else:
        values, given = tuple(sweep.values), "values"
    if len(values) < 2:
        rule = "holds one value, which is no sweep" if values else "is empty"
        raise Refused(given, list(values), rule, "give two values or more, or leave the sweep out")
    unit, numbers = _measured(sweep.quantity, values)
    # 1 and true are equal in Python, and 6 m/s is 6000 mm/s
    told_apart = numbers if numbers is not None else tuple(str(value) for value in values)
    if len(set(told_apart)) < len(values):
        raise Refused(given, list(values), "names a value twice", "name each once")
    return Axis(sweep.quantity, values, unit, numbers)


def _spaced(sweep: SweepTable) -> tuple[Value, ...]:
    for key, value in (("from", sweep.first), ("to", sweep.last), ("points", sweep.points)):
        if value is None:
            missing_all = sweep.first is None and sweep.last is None and sweep.points is None
            if missing_all:
                raise Refused("values", None, "is missing", "add values, or from, to and points")
            raise Refused(key, None, "is missing", "a spaced sweep needs from, to and points")
    assert sweep.first is not None and sweep.last is not None and sweep.points is not None  # noqa: PT018
    if sweep.points < 2:
        raise Refused("points", sweep.points, "makes no sweep", "give two points or more")
    if sweep.points > MOST_POINTS:
        raise Refused("points", sweep.points, f"is more than {MOST_POINTS}", "give fewer")
    unit, (low, high) = _ends(sweep.quantity, sweep.first, sweep.last)
    if low >= high:
        rule = "equals to, which is no sweep" if low == high else "lies above to"
        raise Refused("from", sweep.first, rule, "write the smaller end first")
    if sweep.spacing == "log":
        if low <= 0.0:
            raise Refused("from", sweep.first, "is not above zero, so it has no logarithm", 'leave spacing = "log" out')
        numbers = np.geomspace(low, high, sweep.points)
    else:
        numbers = np.linspace(low, high, sweep.points)
    texts = [f"{number:.{_DIGITS}g}" for number in numbers]
    if unit == "1" or not isinstance(sweep.first, str):
        return tuple(float(text) for text in texts)
    return tuple(f"{text} {unit}" for text in texts)


def _ends(quantity: str, first: Value, last: Value) -> tuple[str, tuple[float, ...]]:
    unit, numbers = _measured(quantity, (first, last))
    if numbers is None:
        raise Refused("from", first, "is no number", "list the labels under values")
    return unit, numbers


def _measured(quantity: str, values: tuple[Value, ...]) -> tuple[str, tuple[float, ...] | None]:
    """Unit of the first value, and all values in it; no numbers where they are labels."""
    field = field_at(quantity)
    if field is None or any(isinstance(value, bool) for value in values):
        plain = [value for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
        return ("1", tuple(float(value) for value in plain)) if len(plain) == len(values) else ("", None)
    if not isinstance(values[0], str):
        if any(isinstance(value, str) for value in values):
            raise Refused("values", list(values), "mixes numbers with and without a unit", "write all alike")
        unit = "deg" if field.plain is not None else "1"
        return unit, tuple(float(value) for value in values)
    unit = units.unit_of(values[0]) or "1"
    try:
        one = units.parse(f"1 {unit}" if unit != "1" else "1", field.unit)
        texts = [value if isinstance(value, str) else f"{value!r}" for value in values]
        numbers = tuple(float(f"{units.parse(text, field.unit) / one:.{_DIGITS}g}") for text in texts)
    except units.UnitError as error:
        rule, _, remedy = str(error).partition("; ")
        raise Refused("values", list(values), rule, remedy) from None
    return unit, numbers
