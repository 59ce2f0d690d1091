"""Picture that ranks engines in several quantities, a panel each, the best engine first."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from laufruhe.present import picture as p
from laufruhe.present.numbers import number
from laufruhe.units import readable

# height of a row, and of the margins above and below [inch]
ROW, AROUND = 0.19, 0.9
# panels side by side, and spread of values from which an axis is logarithmic
MAX_PANELS_OF_RANKS, SPREAD = 4, 200.0


def side_by_side(data: xr.Dataset, words: str) -> p.Picture:
    """Draw the metric, unless it is one of the further quantities, and all further quantities."""
    order = np.argsort(np.nan_to_num(data["objective"].values, nan=np.inf), kind="stable")
    names = [str(name) for name in data["case"].values[order]]
    units = data["quantity_unit"].values.tolist()
    quantities = [
        (str(name), *readable(str(unit)), data["further"].values[order, k])
        for k, (name, unit) in enumerate(zip(data["quantity"].values.tolist(), units, strict=True))
    ]
    unit, metric = data["objective"].attrs["units"], data.attrs["metric"]
    if unit and metric not in [name for name, *_ in quantities]:
        quantities.insert(0, (metric, *readable(unit), data["objective"].values[order]))
    # rows of similar length
    columns = -(-len(quantities) // -(-len(quantities) // MAX_PANELS_OF_RANKS))
    panels = [
        _panel(f"{name}\n[{unit}]" if unit else f"{name}\n", factor * values, names if k % columns == 0 else [])
        for k, (name, unit, factor, values) in enumerate(quantities)
    ]
    proven, count = int((data["proof"].values == "global").sum()), data.sizes["point"]
    claim = "All designs are proven optima" if proven == count else f"{proven} of {count} designs are proven optima"
    size = (p.WIDEST / columns, AROUND + ROW * len(names))
    text = f"{words} {claim}; the best is first."
    gap = 0.12 if len(quantities) == columns else 0.5
    return p.Picture(data.attrs["title"], text, panels, p.credit(data), size=size, columns=columns, gap=gap)


def _panel(title: str, values: np.ndarray, names: list[str]) -> p.Panel:
    maximum = float(np.nanmax(values, initial=0.0)) or 1.0
    minimum = float(np.nanmin(values, initial=maximum))
    # values over decades need a logarithmic axis
    low = 10.0 ** math.floor(math.log10(minimum)) if 0.0 < minimum < maximum / SPREAD else 0.0
    span = math.log(maximum / low) if low else maximum
    finite, places = np.isfinite(values), np.arange(len(values), dtype=float)
    marks: list[p.Mark] = [p.Bars(places[finite], values[finite], 0.62, upright=False)]
    for place, value in zip(places.tolist(), values.tolist(), strict=True):
        is_known = math.isfinite(value)
        text = number(value, scale=maximum) if is_known else "no value"
        start = value if is_known else low
        marks.append(p.Words(start * math.exp(0.03 * span) if low else start + 0.03 * span, place, text))
    ticks = [(float(row), name) for row, name in enumerate(names)]
    side = p.Axis(ends=(len(values) - 0.4, -0.6), ticks=ticks, grid=False)
    end = low * math.exp(1.7 * span) if low else 1.7 * span
    return p.Panel(marks, p.Axis(ends=(low, end), log=(1.0,) if low else (), ticks=_decades(low, end)), side, title)


def _decades(low: float, high: float) -> list[tuple[float, str]] | None:
    if not low:
        return None
    first, last = round(math.log10(low)), math.floor(math.log10(high))
    return [(10.0**k, f"{10.0**k:g}") for k in range(first, last + 1, max((last - first) // 2, 1))]
