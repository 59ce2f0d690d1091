"""The picture that a replication describes, its expressions evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from laufruhe.extensions.replication.expressions import ExpressionError, fill_in, number_of, value_of
from laufruhe.extensions.replication.functions import join
from laufruhe.extensions.replication.models import AxisTable, BarsTable, CurveTable, PanelTable, PictureTable
from laufruhe.present.picture import Area, Axis, Bars, Line, Mark, Panel, Picture, Words, credit
from laufruhe.present.pictures import rows_of

if TYPE_CHECKING:
    import xarray as xr

# width of a group of bars; over the largest bar: distance of a number from its bar, least bar with a number inside,
# and least number that is not written as 0
GROUP, ABOVE, MIN_INSIDE, MIN_SHOWN = 0.84, 0.012, 0.055, 1e-6
DIGITS = 3
BAR = 0.31
"""Least width of a bar and its number [inch]."""

Names = Mapping[str, Any]


def draw_picture(table: PictureTable, readings: Mapping[str, Names], data: xr.Dataset) -> Picture:
    """Return the picture of a table, evaluated once for each interpretation ("reading") of the source."""
    width = Picture("", "", (), "", (table.size[0], table.size[1]), table.columns, table.gap).width
    count, panels = sum(1 if panel.once else len(readings) for panel in table.panels), list[Panel]()
    for number, panel in enumerate(table.panels, 1):
        for reading, names in list(readings.items())[: 1 if panel.once else None]:
            try:
                drawn = _panel(panel, names, "" if panel.once else reading)
            except (TypeError, ValueError, LookupError) as error:
                rule, _, remedy = str(error).partition("; ")
                raise ExpressionError(f"panel {number} cannot be drawn: {rule}; {remedy or 'correct it'}") from None
            panels += _rows(drawn, width)
    return Picture(
        table.title or data.attrs["title"],
        fill_in(table.words, next(iter(readings.values()))),
        panels,
        credit(data),
        # panels in rows need less height
        size=(table.size[0], table.size[1] * (0.85 if len(panels) > count else 1.0)),
        columns=table.columns,
        gap=table.gap,
    )


def _rows(panel: Panel, width: float) -> list[Panel]:
    """Return a panel in several rows of one scale if its bars have no room for their numbers."""
    solid = [mark for mark in panel.marks if isinstance(mark, Bars) and not mark.hollow]
    other_marks = [mark for mark in panel.marks if not isinstance(mark, Bars | Words)]
    if not solid or panel.x.ticks is None or other_marks:
        return [panel]
    groups = len(solid[0].places)
    rows, side = rows_of(groups, int(width * GROUP / (BAR * len(solid))))
    if len(rows) == 1:
        return [panel]
    top = max(float(np.max(mark.values)) for mark in panel.marks if isinstance(mark, Bars))
    up = panel.y if panel.y.ends is not None else replace(panel.y, ends=(0.0, 1.12 * top))
    return [
        Panel(
            [part for mark in panel.marks for part in _within(mark, row)],
            replace(panel.x, ends=(row[0] - 0.55, row[0] + side - 0.45), ticks=panel.x.ticks[row[0] : row[-1] + 1]),
            up,
            panel.title if row[0] == 0 else "",
        )
        for row in rows
    ]


def _within(mark: Mark, row: range) -> Iterator[Mark]:
    if isinstance(mark, Words):
        yield from [mark] if row[0] - 0.5 < mark.x < row[-1] + 0.5 else []
    elif isinstance(mark, Bars):
        indices = list(row)
        yield replace(mark, places=np.asarray(mark.places)[indices], values=np.asarray(mark.values)[indices])


def _panel(panel: PanelTable, names: Names, reading: str) -> Panel:
    marks: list[Mark] = []
    for area in panel.areas:
        x, (low, high) = ([number_of(end, names) for end in ends] for ends in (area.x, area.y))
        marks.append(Area(x, [low, low], [high, high], area.colour, fill_in(area.label, names)))
    for curve in panel.curves:
        marks += _curves(curve, names)
    if panel.bars:
        ends = _axis(panel.y, names).ends
        marks += _bars(panel.bars, names, 0.0 if ends is None else max(ends))
    for words in panel.words:
        across, up = (number_of(coordinate, names) for coordinate in (words.x, words.y))
        marks.append(Words(across, up, fill_in(words.text, names), words.colour, words.across, words.along))
    title = ", ".join(words for words in (fill_in(panel.title, names), reading) if words)
    return Panel(marks, _axis(panel.x, names), _axis(panel.y, names), title)


def _axis(axis: AxisTable, names: Names) -> Axis:
    labels = fill_in(axis.names, names)
    ticks = [(float(k), str(text)) for k, text in enumerate(labels)] if labels else None
    if axis.ticks is not None:
        ticks = [(float(value), f"{value:g}") for value in axis.ticks]
    ends = None if axis.ends is None else tuple(number_of(end, names) for end in axis.ends)
    return Axis(axis.label, ends, ticks, tuple(axis.log), grid=labels is None)  # type: ignore[arg-type]


def _combinations(values_by_name: Mapping[str, Sequence[Any]], names: Names) -> Iterator[dict[str, Any]]:
    for name, values in values_by_name.items():
        yield from ({**names, name: value} for value in values)
    if not values_by_name:
        yield dict(names)


def _curves(curve: CurveTable, names: Names) -> Iterator[Mark]:
    for k, own_names in enumerate(_combinations(curve.loops, names)):
        colour = curve.colours[k % len(curve.colours)]
        y = value_of(curve.y, own_names)
        dims: tuple[str, ...] = getattr(y, "dims", ())
        if curve.x is None and not dims:
            raise ExpressionError(f"'{curve.y}' has no dimension for the horizontal axis; give the curve an x")
        x = value_of(curve.x, {**own_names, **{dim: y[dim] for dim in dims}}) if curve.x is not None else y[dims[0]]
        xs, ys = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (x, y))
        xs, ys = np.broadcast_arrays(xs, ys)
        yield Line(xs, ys, colour, fill_in(curve.label, own_names), curve.width, curve.dash, curve.marker)
        if curve.end:
            yield Words(float(xs[-1]), float(ys[-1]), f" {fill_in(curve.end, own_names)}", colour)


def _bars(bars: BarsTable, names: Names, end: float) -> Iterator[Mark]:
    """Yield the marks of a bar chart: filled bars, outlined bars around them, and the numbers of both."""
    series = list(_combinations(bars.loops, names))
    fills = [join(value_of(bars.filled, own_names)) for own_names in series]
    outlines = [join(value_of(bars.outline, own_names)) for own_names in series] if bars.outline else fills
    top, width = max(max(values) for values in outlines), GROUP / len(series)
    for k, (own_names, low, high) in enumerate(zip(series, fills, outlines, strict=True)):
        places = np.arange(len(low)) + (k - 0.5 * (len(series) - 1)) * width
        label = fill_in(bars.labels[k] if bars.labels else bars.label, own_names)
        colour = bars.colours[k % len(bars.colours)]
        yield Bars(places, low, 0.9 * width, colour, label)
        if bars.outline:
            yield Bars(places, high, 0.9 * width, colour, hollow=True)
        for x, inner, outer in zip(places, low, high, strict=True):
            yield Words(x, outer + ABOVE * top, _number(outer, top, bars.number), "ink", "center", "bottom")
            if bars.outline and inner > MIN_INSIDE * max(top, end):
                number = _number(inner, top, bars.number)
                yield Words(x, inner - ABOVE * top, number, "ink", "center", "top", inside=colour)


def _number(value: float, top: float, spec: str) -> str:
    if spec:
        return format(value, spec)
    figures = f"{value:#.{DIGITS}g}".rstrip(".") if abs(value) < 10.0**DIGITS else f"{value:.0f}"
    return figures if abs(value) > MIN_SHOWN * top else "0"
