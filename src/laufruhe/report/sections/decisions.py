"""Table of decisions."""

from __future__ import annotations

from itertools import pairwise

from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import DASH, figure, in_grams, prices_of, share, trimmed, with_unit
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import DecisionValue
from laufruhe.units import readable

HEAD = ("decision", "initial", "final", "bounds", "at bound", "shadow price")


def tables(result: Result) -> list[Table]:
    """Return a row per decision."""
    pairs = pairwise([None, *result.decisions])
    rows = tuple(_row(before, d, objective_unit(result)) for before, d in pairs if d is not None)
    return [Table(HEAD, rows, title="Decisions", note=_free(result))]


def _free(result: Result) -> str:
    if not result.free:
        return ""
    ends = (f"{d.name} from {with_unit(d.low, d.unit)} to {with_unit(d.high, d.unit)}" for d in result.free)
    tolerance, ranges = share(result.problem.tolerance, 1), ", ".join(ends)
    return f"The optimum is not unique. Equally good within {tolerance}, other decisions adapted: {ranges}."


def _row(before: DecisionValue | None, d: DecisionValue, unit: str) -> tuple[str, ...]:
    name, factor = readable(d.unit)
    maximum = max(abs(d.lower), abs(d.upper))
    bounds = f"{trimmed(d.lower * factor)} to {trimmed(d.upper * factor)} {name}".rstrip()
    # the angle of a zero size is meaningless
    size = before if d.name.endswith(".angle") else None
    initial = DASH if size and not size.initial else with_unit(d.initial, d.unit)
    if size and size.is_zero:
        return d.name, initial, DASH, bounds, DASH, DASH
    upper = abs(d.value - d.upper) <= abs(d.value - d.lower)
    mark = DASH if not d.at_bound else "upper" if upper else "lower"
    decided = figure(d.value, d.unit, scale=maximum) + in_grams(d.value, d.unit, maximum)
    return d.name, initial, decided, bounds, mark, prices_of(d, unit)
