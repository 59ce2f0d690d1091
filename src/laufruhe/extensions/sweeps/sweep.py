"""Swept quantities of a study, and their values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Table
from laufruhe.files.measures import SIDES
from laufruhe.files.study_tables import DIGITS, MAX_POINTS, End, Value, measured, parts_of, span_of


class SweepTable(Table):
    """Swept quantity of the problem and its values: listed, or spaced between two ends."""

    quantity: str = f.required("Path in the problem file: engine.rod_ratio, counterweights.web.balance_factor.")
    values: list[Value] | None = None
    first: End = Field(default=None, alias="from")
    last: End = Field(default=None, alias="to")
    points: int | None = f.optional("Number of values from the first to the last.")
    spacing: Literal["linear", "log"] | None = None

    @property
    def count(self) -> int:
        """Number of swept values."""
        return (self.points or 0) if self.values is None else len(self.values)


@dataclass(frozen=True)
class SweepAxis:
    """Swept quantity, a path in the problem file, with its values as in a problem file.

    The numbers are the values in the unit of the study file, which is "1" for plain numbers. Labels have the unit ""
    and no numbers.
    """

    quantity: str
    values: tuple[Value, ...]
    unit: str
    numbers: tuple[float, ...] | None

    @property
    def name(self) -> str:
        """Name in reports: the last part of the path, with the list of an index or the limit of a side."""
        *before, last = parts_of(self.quantity.replace("_", " "))
        if before and last.isdigit():
            return f"{before[-1]} {last}"
        if before[:1] == ["constraints"]:
            limit = f"limit {before[1]}" if before[1].isdigit() else before[1]
            return f"{limit}, {SIDES.get(last, last)}"
        return last

    def by_value(self) -> dict[Value, float]:
        """Return the numbers of the values; empty for labels."""
        return dict(zip(self.values, self.numbers, strict=True)) if self.numbers is not None else {}


def axis_of(sweep: SweepTable) -> SweepAxis:
    """Return the values of a sweep with their unit; raise `Refused` if there are fewer than two, or equal ones."""
    spaced = (sweep.first, sweep.last, sweep.points)
    if sweep.values is None:
        values, key = _spaced(sweep), "points"
    elif any(value is not None for value in (*spaced, sweep.spacing)):
        raise Refused("values", None, "are given, but also from, to, points or spacing", "give one or the other")
    else:
        values, key = tuple(sweep.values), "values"
    if len(values) < 2:
        rule = "holds one value, which is no sweep" if values else "is empty"
        raise Refused(key, list(values), rule, "give at least two values, or remove the sweep")
    unit, numbers = measured(sweep.quantity, values, key)
    # 1 and true are equal in Python, and 6 m/s is 6000 mm/s
    if len(set(numbers if numbers is not None else map(str, values))) < len(values):
        raise Refused(key, list(values), "names a value twice", "name each once")
    return SweepAxis(sweep.quantity, values, unit, numbers)


def _spaced(sweep: SweepTable) -> tuple[Value, ...]:
    ends = {"from": sweep.first, "to": sweep.last, "points": sweep.points}
    missing = [key for key, value in ends.items() if value is None]
    if len(missing) == len(ends):
        raise Refused("values", None, "is missing", "add values, or from, to and points")
    if sweep.first is None or sweep.last is None or sweep.points is None:
        raise Refused(missing[0], None, "is missing", "an equally spaced sweep needs the keys from, to and points")
    if sweep.points < 2:
        raise Refused("points", sweep.points, "makes no sweep", "give two points or more")
    if sweep.points > MAX_POINTS:
        raise Refused("points", sweep.points, f"is more than {MAX_POINTS}", "give fewer")
    span = span_of(sweep.quantity, sweep.first, sweep.last, sweep.spacing)
    with np.errstate(all="ignore"):
        numbers = (np.geomspace if span.is_log else np.linspace)(span.low, span.high, sweep.points)
    if not np.isfinite(numbers).all():
        raise Refused(
            "to", sweep.last, "is too far from the other end of the range for equal steps", "narrow the sweep"
        )
    texts = [f"{number:.{DIGITS}g}" for number in numbers]
    if not span.is_text:
        return tuple(map(float, texts))
    return tuple(texts) if span.unit == "1" else tuple(f"{text} {span.unit}" for text in texts)
