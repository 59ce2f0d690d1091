"""Engines side by side in several quantities: a panel each, a lying bar an engine, the best above."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from laufruhe.present.numbers import number
from laufruhe.studies import picture as p
from laufruhe.units import readable

# height of a row, and of what stands above and below all of them [inch]
ROW, AROUND = 0.19, 0.9


def side_by_side(data: xr.Dataset, words: str) -> p.Picture:
    """The metric where it is one quantity and not among the others, and all further quantities."""
    order = np.argsort(np.nan_to_num(data["objective"].values, nan=np.inf), kind="stable")
    names = [str(name) for name in data["case"].values[order]]
    units = data["quantity_unit"].values.tolist()
    told = [
        (str(name), *readable(str(unit)), data["further"].values[order, k])
        for k, (name, unit) in enumerate(zip(data["quantity"].values.tolist(), units, strict=True))
    ]
    unit, metric = data["objective"].attrs["units"], data.attrs["metric"]
    if unit and metric not in [name for name, *_ in told]:
        told.insert(0, (metric, *readable(unit), data["objective"].values[order]))
    columns = min(len(told), 4)
    panels = [
        _panel(f"{name}\n[{unit}]" if unit else f"{name}\n", factor * values, names if k % columns == 0 else [])
        for k, (name, unit, factor, values) in enumerate(told)
    ]
    proven, whole = int((data["proof"].values == "global").sum()), data.sizes["point"]
    decided = "Each at its proven optimum" if proven == whole else f"{proven} of {whole} at a proven optimum"
    size = (p.WIDEST / columns, AROUND + ROW * len(names))
    said = f"{words} {decided}, the best first."
    return p.Picture(
        data.attrs["title"], said, panels, p.credit(data), size=size, columns=columns, gap=0.12
    )  # fmt: skip


def _panel(title: str, values: np.ndarray, names: list[str]) -> p.Panel:
    most = float(np.nanmax(values, initial=0.0)) or 1.0
    known, places = np.isfinite(values), np.arange(len(values), dtype=float)
    marks: list[p.Mark] = [p.Bars(places[known], values[known], 0.62, upright=False)]
    for place, value in zip(places.tolist(), values.tolist(), strict=True):
        is_told = math.isfinite(value)
        shown = number(value, scale=most) if is_told else "not told"
        marks.append(p.Words((value if is_told else 0.0) + 0.03 * most, place, shown))
    ticks = [(float(row), each) for row, each in enumerate(names)]
    side = p.Axis(ends=(len(values) - 0.4, -0.6), ticks=ticks, grid=False)
    return p.Panel(marks, p.Axis(ends=(0.0, 1.7 * most)), side, title)
