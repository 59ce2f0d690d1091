"""Report section of speed ranges: worst and mean values, their speeds and orders, and the values over speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from laufruhe.extensions.speed_ranges.peaks import NEAR, RangeResponses, Response
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import DASH, RPM, figure, number
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import FINAL, INITIAL, Result

HEAD = ("range", "design", "quantity", "worst", "at", "strongest order", "of limit", "at", "mean over time")
PEAKS = 4
"""Most peaks of a design over a range that a table lists."""


def responses_of(result: Result) -> RangeResponses:
    """Return the responses over the speed ranges of a result."""
    assert isinstance(result.details, RangeResponses)
    return result.details


def has_ranges(result: Result) -> bool:
    """Return True if a result has speed ranges."""
    return isinstance(result.details, RangeResponses)


def designs_of(result: Result) -> Iterator[tuple[str, Response]]:
    """Yield the name of a design and its response, for each range; the initial design only if it differs."""
    details = responses_of(result)
    for initial, final in zip(details.initial, details.final, strict=True):
        if is_changed(result):
            yield INITIAL, initial
        yield FINAL if is_changed(result) else INITIAL, final


def _tables(result: Result) -> list[Table]:
    rows = []
    for design, one in designs_of(result):
        unit, worst = one.measure.unit, one.worst
        order, amplitude = one.strongest
        limit = (f"{100.0 * one.ratio:.1f} %", _rpm(one, one.tightest)) if one.span.limit is not None else ("-", "-")
        rows.append((
            one.span.name, design, one.measure.name, figure(float(one.values[worst]), unit), _rpm(one, worst),
            f"{order:g}, {figure(amplitude, unit)}", *limit, figure(one.mean, unit),
        ))  # fmt: skip
    note = (
        "Worst: the largest value at any speed of the range, found between samples (P23). Strongest order: that with "
        "the largest amplitude there, before it is averaged."
    )
    return [Table(HEAD, rows, title="Over ranges of speed", left=3, note=note, file="speed-ranges"), _peaks(result)]


def _peaks(result: Result) -> Table:
    rows = []
    for design, one in designs_of(result):
        tops = sorted(one.tops[:PEAKS])
        for k, (order, amplitude) in zip(tops, one.strongest_at(tops), strict=True):
            value, unit = float(one.values[k]), one.measure.unit
            limit = f"{100.0 * value / float(one.limits[k]):.1f} %" if one.span.limit is not None else DASH
            strongest = f"{order:g}, {figure(amplitude, unit)}"
            rows.append((one.span.name, design, _rpm(one, k), figure(value, unit), strongest, limit))
    note = (
        f"At most {PEAKS} peaks of the value or of its share of the limit, each with at least {100.0 * NEAR:g} % of "
        "the highest. An end of a range may be a peak."
    )
    head = ("range", "design", "at", "value", "strongest order", "of limit")
    return Table(head, rows, title="Peaks over ranges of speed", left=2, note=note, file="speed-range-peaks")


def _rpm(one: Response, k: int) -> str:
    return f"{number(RPM * float(one.speeds[k]))} rpm"


def _record(result: Result) -> Mapping[str, Any]:
    """Return worst and mean values of both designs over each range [SI]."""
    record: dict[str, Any] = {}
    for design, one in designs_of(result):
        entry = record.setdefault(one.span.name, {
            "quantity": one.measure.name, "unit": one.measure.unit, "lowest": one.span.low, "highest": one.span.high,
        })  # fmt: skip
        entry[design] = {
            "worst": float(one.values[one.worst]), "speed": float(one.speeds[one.worst]), "mean": one.mean,
            **dict(zip(("order", "amplitude"), one.strongest, strict=True)),
            "of_limit": one.ratio if one.span.limit is not None else None,
        }  # fmt: skip
    return {"rounds": responses_of(result).rounds, "ranges": record}


def _over_speed(result: Result) -> Table:
    rows = [
        [one.span.name, design, RPM * speed, value, limit if one.span.limit is not None else None]
        for design, one in designs_of(result)
        for speed, value, limit in zip(one.speeds.tolist(), one.values.tolist(), one.limits.tolist(), strict=True)
    ]
    return Table(["range", "design", "speed [rpm]", "value", "limit"], rows)


SECTION = Section(
    "speed_ranges", has_ranges, _tables, _record, ("speed-ranges", "speed-range-peaks"),
    {"over-speed-ranges": (has_ranges, _over_speed)},
)  # fmt: skip
PICTURE = ResultPicture(
    "speed_ranges",
    "Response over ranges of speed with its limit, and orders against natural frequencies, coloured by amplitude.",
    "laufruhe.extensions.speed_ranges.picture",
)
